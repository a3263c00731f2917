"""The command line's grammar. Loads no command's code: `rotor-mbs list` must answer in a blink."""

from __future__ import annotations

import argparse
import importlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path

import rotor_mbs

_DEFAULT_FOLDER = Path("rotor-mbs-out")
_DEFAULT_TIMEOUT_S = 60.0


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The arguments, with `command` set to the function that carries them out. Ends with status 2 on bad usage."""
    return _parser().parse_args(argv)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="rotor-mbs",
        description="Every scene of a rotor by independent models, compared, and held against a published paper.",
        epilog="exit status: 0 all well; 1 a check failed or a run did not succeed; 2 bad input; 130 interrupted",
    )
    parser.add_argument("--version", action="version", version=f"rotor-mbs {rotor_mbs.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    listing = _command(commands, "list", "the scenes, a line each", "scenes:list_all")
    listing.add_argument("--json", action="store_true", help="for a script")

    show = _command(commands, "show", "one scene: its data, what each model builds, its methods", "scenes:show")
    show.add_argument("scene", metavar="SCENE")
    show.add_argument("--json", action="store_true", help="for a script")

    reproduce = _command(
        commands, "reproduce", "every scene of the paper by every model, and the report", "runs:reproduce"
    )
    reproduce.add_argument("-o", "--output", type=Path, default=_DEFAULT_FOLDER, metavar="DIR", help=_default("DIR"))
    _add_batch_options(reproduce)

    run = _command(commands, "run", "a batch of scenes into one results file", "runs:run")
    run.add_argument("scenes", nargs="+", metavar="SCENE", help="a name (paper/fig05), a folder (paper), a TOML file")
    run.add_argument("-m", "--method", action="append", metavar="METHOD", help="model/integrator; may be repeated")
    run.add_argument("-o", "--output", type=Path, default=Path("results.h5"), metavar="FILE", help=_default("FILE"))
    _add_batch_options(run)

    reference = _command(
        commands, "reference", "quad precision references, computed anew, as they are frozen", "runs:freeze"
    )
    reference.add_argument("scenes", nargs="+", metavar="SCENE")
    reference.add_argument("-o", "--output", type=Path, required=True, metavar="FILE")
    _add_batch_options(reference)

    report = _command(commands, "report", "HTML pages from a results file", "reports:report")
    report.add_argument("file", type=Path, metavar="FILE")
    report.add_argument("-o", "--output", type=Path, default=Path("report"), metavar="DIR", help=_default("DIR"))
    return parser


def _default(metavar: str) -> str:
    return f"{metavar} (default: %(default)s)"


def _command(
    commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str, text: str, target: str
) -> argparse.ArgumentParser:
    parser = commands.add_parser(name, help=text, description=text)
    parser.set_defaults(command=_late(target))
    return parser


def _late(target: str) -> Callable[[argparse.Namespace], int]:
    """The function "module:name" of this package, imported when it is called."""
    module, _, name = target.partition(":")

    def call(arguments: argparse.Namespace) -> int:
        function = getattr(importlib.import_module(f"rotor_mbs.cli.{module}"), name)
        return int(function(arguments))

    return call


def _add_batch_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-j", "--jobs", type=_positive(int, "a whole number from 1 up"), default=_cores(), metavar="N",
        help="parallel processes (default: the cores, %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--timeout", type=_positive(float, "seconds, more than 0"), default=_DEFAULT_TIMEOUT_S, metavar="SECONDS",
        help="a run longer than this is ended and recorded as timed_out (default: %(default)g)",
    )  # fmt: skip


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _positive(kind: type[int] | type[float], allowed: str) -> Callable[[str], float]:
    def read(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = kind(0)
        if not 0 < value < float("inf"):
            raise argparse.ArgumentTypeError(f"{text!r} given, allowed: {allowed}")
        return value

    return read
