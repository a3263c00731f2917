"""The command line's grammar. Loads no command's code: `rotor-mbs list` must answer in a blink."""

from __future__ import annotations

import argparse
import importlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

import rotor_mbs

_DEFAULT_FOLDER = Path("rotor-mbs-out")
_DEFAULT_TIMEOUT_S = 60.0
# The suite has runs by the dozen that no limit would let end: so that it ends in minutes, they are given less.
_SUITE_TIMEOUT_S = 8.0
_DEFAULT_BUDGET_S = 28.0  # the paper's seventeen scenes in eight minutes


class _Parser(argparse.ArgumentParser):
    """Bad usage is one clear line, as all bad input is, without the usage above it."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The arguments, with `command` set to the function that carries them out. Ends with status 2 on bad usage."""
    return _parser().parse_args(argv)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
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
    _add_language(reproduce)

    run = _command(commands, "run", "a batch of scenes into one results file", "runs:run")
    run.add_argument("scenes", nargs="+", metavar="SCENE", help="a name (paper/fig05), a folder (paper), a TOML file")
    run.add_argument("-m", "--method", action="append", metavar="METHOD", help="model/integrator; may be repeated")
    run.add_argument("-o", "--output", type=Path, default=Path("results.h5"), metavar="FILE", help=_default("FILE"))
    _add_batch_options(run)

    bench = _command(commands, "bench", "error against run time, method by method", "bench:bench")
    bench.add_argument("scenes", nargs="*", metavar="SCENE", help="a name (paper/fig05), a folder (paper), a TOML file")
    bench.add_argument("-m", "--method", action="append", metavar="METHOD", help="model/integrator; may be repeated")
    bench.add_argument("-o", "--output", type=Path, default=Path("bench.h5"), metavar="FILE", help=_default("FILE"))
    bench.add_argument("--growth", action="store_true", help="also how cost grows with blades and with duration")
    bench.add_argument(
        "--repeats", type=_positive(int, "a whole number from 1 up"), default=20, metavar="N",
        help="timed runs of each point (default: %(default)s; 5 at most for runs over 0.5 s)",
    )  # fmt: skip
    bench.add_argument(
        "--budget", type=_positive(float, "seconds, more than 0"), default=_DEFAULT_BUDGET_S, metavar="SECONDS",
        help="for each scene (default: %(default)g)",
    )  # fmt: skip

    reference = _command(
        commands, "reference", "quad precision references, computed anew, as they are frozen", "runs:freeze"
    )
    reference.add_argument("scenes", nargs="+", metavar="SCENE")
    reference.add_argument("-o", "--output", type=Path, required=True, metavar="FILE")
    _add_batch_options(reference)

    check = _command(commands, "check", "accuracy verdicts; exit status 1 where one fails", "check:check")
    check.add_argument(
        "file", nargs="?", type=Path, metavar="FILE", help="a results file (default: a quick set, computed)"
    )
    check.add_argument("--bounds", type=Path, metavar="TOML", help="own bounds, read before reference/accuracy.toml")
    check.add_argument("--junit", type=Path, metavar="XML", help="verdicts as JUnit XML")
    check.add_argument("--json", metavar="FILE", help="verdicts as JSON; - for standard output")
    check.add_argument("--github", action="store_true", help="failures as GitHub annotations")
    check.add_argument("--speed", action="store_true", help="run times too, against a calibration run")
    check.add_argument("-v", "--verbose", action="store_true", help="print verdicts that pass, too")
    _add_jobs(check)

    _add_sweep(commands)

    stability = _command(
        commands, "stability", "stiff and extreme scenes by every method: where each holds, and the map of it",
        "stability:stability",
    )  # fmt: skip
    stability.add_argument("scenes", nargs="*", metavar="SCENE", help="some of them (default: stiff extreme)")
    stability.add_argument(
        "-o", "--output", type=Path, default=Path("stability.h5"), metavar="FILE", help=_default("FILE")
    )
    stability.add_argument("--report", type=Path, metavar="DIR", help="its pages (default: FILE's name with -report)")
    _add_batch_options(stability, timeout_s=_SUITE_TIMEOUT_S)

    report = _command(commands, "report", "HTML pages from a results file", "reports:report")
    report.add_argument("file", type=Path, metavar="FILE")
    report.add_argument("-o", "--output", type=Path, default=Path("report"), metavar="DIR", help=_default("DIR"))
    _add_language(report)

    _add_pictures(commands)
    return parser


def _add_pictures(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    figures = _command(
        commands, "figures", "the paper's figures as files for a manuscript, from a results file", "figures:figures"
    )
    figures.add_argument("-o", "--output", type=Path, default=Path("figures"), metavar="DIR", help=_default("DIR"))
    figures.add_argument("--format", choices=("pdf", "svg", "png"), default="pdf", help="(default: %(default)s)")
    figures.add_argument("--figure", action="append", metavar="N", help="this one alone; may be repeated")
    _add_results(figures)
    _add_language(figures)

    animate = _command(commands, "animate", "a scene moving, from a results file", "animate:animate")
    animate.add_argument("scene", metavar="SCENE")
    animate.add_argument(
        "-o", "--output", type=Path, required=True, metavar="FILE",
        help="FILE.webp, FILE.gif, or FILE.mp4 where ffmpeg is installed",
    )  # fmt: skip
    animate.add_argument(
        "--offset", type=_positive(float, "a number more than 0"), default=40.0, metavar="TIMES",
        help="how many times the tip's distance from its pitch axis is drawn (default: %(default)g)",
    )  # fmt: skip
    _add_results(animate)


def _add_results(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--results",
        dest="file",
        type=Path,
        default=_DEFAULT_FOLDER / "results.h5",
        metavar="FILE",
        help=_default("FILE"),
    )


def _add_language(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--lang", choices=("en", "es"), default="en", help="of the texts (default: %(default)s)")


def _add_sweep(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    sweep = _command(commands, "sweep", "a parameter study into one dataset", "sweep:sweep")
    sweep.add_argument("file", type=Path, metavar="SWEEP.toml", help="or a shipped one: sweeps/fig11-spread")
    sweep.add_argument(
        "-m", "--method", action="append", metavar="METHOD", help="in place of the file's; may be repeated"
    )
    sweep.add_argument("-o", "--output", type=Path, metavar="FILE", help="(default: the sweep's name with .h5)")
    sweep.add_argument("--engine", default="local", metavar="ENGINE", help="local, or dask:tcp://host:port")
    sweep.add_argument("--part", type=_part, default=(1, 1), metavar="K/N", help="part K of N alone, for a job array")
    sweep.add_argument("--dry-run", action="store_true", help="how many runs, about how long, how much")
    sweep.add_argument("--yes", action="store_true", help="start a sweep of over a million runs")
    sweep.add_argument("--json", action="store_true", help="progress and summary as JSON lines")
    _add_batch_options(sweep)


def _part(text: str) -> tuple[int, int]:
    """(K, N) of "K/N"."""
    number, _, parts = text.partition("/")
    if not (number.isdecimal() and parts.isdecimal() and 1 <= int(number) <= int(parts)):
        raise argparse.ArgumentTypeError(f"{text!r} given, allowed: K/N with K from 1 to N")
    return int(number), int(parts)


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


def _add_jobs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-j", "--jobs", type=_positive(int, "a whole number from 1 up"), default=_cores(), metavar="N",
        help="parallel processes (default: the cores, %(default)s)",
    )  # fmt: skip


def _add_batch_options(parser: argparse.ArgumentParser, timeout_s: float = _DEFAULT_TIMEOUT_S) -> None:
    _add_jobs(parser)
    parser.add_argument(
        "--timeout", type=_positive(float, "seconds, more than 0"), default=timeout_s, metavar="SECONDS",
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
