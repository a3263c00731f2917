"""The arguments of all commands. Loads the code of none, so that the others do not wait for it."""

from __future__ import annotations

import argparse
import importlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn, TypeAlias

import rotor_mbs
from rotor_mbs.cli.argument_values import (
    COUNT,
    POSITIVE,
    REPRODUCED,
    SECONDS,
    default_results,
    file,
    part,
    path,
    setting,
    span,
)  # fmt: skip
from rotor_mbs.errors import nearest

_SCENE, _SCENES = "a name (paper/fig05) or a TOML file", "a name (paper/fig05), a folder (paper), a TOML file"
_PAGES = "(default: beside FILE, its name with -report; of results.h5: report)"
EXPORT_FORMATS = ("mjcf", "exudyn", "csv", "sympy", "iftomm")
_DEFAULT_TIMEOUT_S = 60.0
# The suite has many runs that would reach any limit: with a shorter one it ends in minutes.
_SUITE_TIMEOUT_S = 8.0
_CHART_TIMEOUT_S = 600.0
_DEFAULT_BUDGET_S = 28.0  # the paper's seventeen scenes in eight minutes


class _Parser(argparse.ArgumentParser):
    """Bad usage is one clear line, as all bad input is, without the usage above it."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


_Commands: TypeAlias = "argparse._SubParsersAction[_Parser]"


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The arguments, with `command` set to the function that carries them out. Ends with status 2 on bad usage."""
    parser, commands = _parser()
    if argv and not argv[0].startswith("-") and argv[0] not in commands.choices:
        known = ", ".join(commands.choices)
        parser.error(f"no command {argv[0]!r}{nearest(argv[0], commands.choices)}; allowed: {known}")
    arguments = parser.parse_args(argv or ["--help"])
    if getattr(arguments, "results", None):
        arguments.file = arguments.results
    return arguments


def _parser() -> tuple[_Parser, _Commands]:
    parser = _Parser(
        prog="rotor-mbs",
        description="Scenes of a rotor by independent models, compared with each other and with a published paper.",
        epilog="start with:\n  rotor-mbs list\n  rotor-mbs show paper/fig11\n  rotor-mbs run paper/fig11\n"
        "rotor-mbs COMMAND --help tells the options of a command and has an example.\n"
        "exit status: 0 all well; 1 a check failed or a run did not succeed; 2 bad input; 130 interrupted",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"rotor-mbs {rotor_mbs.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for add in (
        _add_list_and_show,
        _add_runs,
        _add_compare,
        _add_bench,
        _add_reference,
        _add_check,
        _add_sweep,
        _add_stability,
        _add_modes,
        _add_claims,
        _add_report,
        _add_export,
    ):
        add(commands)
    return parser, commands


def _add_list_and_show(commands: _Commands) -> None:
    listing = _command(commands, "list", "scenes, sweeps and methods, a line each", "scenes:list_all", "", "--json")
    listing.add_argument("--json", action="store_true", help="as JSON, for a script")

    show = _command(
        commands, "show", "one scene: its data and its methods; or one method: its settings", "scenes:show",
        "paper/fig11", "paper/fig11 --build",
    )  # fmt: skip
    show.add_argument("scene", metavar="SCENE", help=f"{_SCENE}; or a method (lagrange/taylor)")
    show.add_argument("--build", action="store_true", help="also the items that each model builds")
    show.add_argument("--json", action="store_true", help="as JSON, for a script")

    new = _command(commands, "new", "a commented scene file to start from", "scenes:new", "my.toml")
    new.add_argument("file", type=file, metavar="FILE", help="a TOML file that does not exist yet")


def _add_runs(commands: _Commands) -> None:
    reproduce = _command(
        commands, "reproduce", "every scene of the paper by every model, and the report", "runs:reproduce",
        "", "-o out -j 4",
    )  # fmt: skip
    reproduce.add_argument("-o", "--output", type=path, default=REPRODUCED, metavar="DIR", help=_default("DIR"))
    _add_pool_options(reproduce)

    run = _command(
        commands, "run", "scenes by methods, into one results file", "runs:run",
        "my.toml -o my.h5", "paper/fig11 -m lagrange/taylor -m exudyn_tree/rk67 --set step=1e-3",
    )  # fmt: skip
    run.add_argument("scenes", nargs="+", metavar="SCENE", help=_SCENES)
    _add_methods(run)
    _add_settings(run)
    _add_output(run, "results.h5")
    _add_pool_options(run)


def _add_compare(commands: _Commands) -> None:
    compare = _command(
        commands, "compare", "another program's trajectory against a scene's reference; exit status 1 where it differs",
        "compare:compare", "mine.csv --scene paper/fig11", "OpenFAST.out --scene my.toml --columns map.toml",
    )  # fmt: skip
    compare.add_argument(
        "data", type=Path, metavar="DATA",
        help="text with a header, .npz, .mat, HDF5, netCDF, an Exudyn sensor file, OpenFAST .out or .outb",
    )  # fmt: skip
    compare.add_argument("--scene", required=True, metavar="SCENE", help=_SCENE)
    compare.add_argument(
        "--columns", type=Path, metavar="MAP.toml", help="column, unit, sign, zero of each channel (default: guessed)"
    )
    compare.add_argument(
        "--tolerance", type=POSITIVE, default=1e-6, metavar="X",
        help="rad per unit of error growth that still agree (default: %(default)g)",
    )  # fmt: skip
    compare.add_argument(
        "-o", "--output", type=Path, default=Path("comparison"), metavar="DIR", help="of the page " + _default("DIR")
    )
    compare.add_argument("--json", action="store_true", help="the verdict as JSON, for a script")


def _add_bench(commands: _Commands) -> None:
    bench = _command(
        commands, "bench", "error against run time, method by method", "bench:bench",
        "paper/fig11", "paper/fig11 my.toml -m lagrange/taylor -m exudyn_tree/rk67 -o bench.h5",
    )  # fmt: skip
    bench.add_argument("scenes", nargs="*", metavar="SCENE", help=_SCENES)
    _add_methods(bench)
    _add_settings(bench)
    _add_output(bench, "bench.h5")
    bench.add_argument("--growth", action="store_true", help="also how cost grows with blades and with duration")
    bench.add_argument(
        "--repeats", type=COUNT, default=20, metavar="N",
        help="timed runs of each point (default: %(default)s; 5 at most for runs over 0.5 s)",
    )  # fmt: skip
    bench.add_argument(
        "--budget", type=SECONDS, default=_DEFAULT_BUDGET_S,
        metavar="SECONDS", help="for each scene (default: %(default)g)",
    )  # fmt: skip


def _add_reference(commands: _Commands) -> None:
    reference = _command(
        commands, "reference", "quad precision references, computed anew, as they are frozen", "runs:reference",
        "paper/fig08 -o reference.h5",
    )  # fmt: skip
    reference.add_argument("scenes", nargs="+", metavar="SCENE", help=_SCENES)
    reference.add_argument("-o", "--output", type=file, required=True, metavar="FILE")
    _add_pool_options(reference)


def _add_check(commands: _Commands) -> None:
    check = _command(
        commands, "check", "accuracy verdicts; exit status 1 where one fails", "check:check",
        "", "rotor-mbs-out/results.h5 --junit check.xml",
    )  # fmt: skip
    check.add_argument(
        "file", nargs="?", type=path, metavar="FILE", help="a results file (default: a quick set, computed)"
    )
    check.add_argument("--bounds", type=path, metavar="TOML", help="own bounds, read before reference/accuracy.toml")
    check.add_argument(
        "--require", action="append", metavar="METHOD",
        help="fail where a scene of FILE has no run of it; may be repeated",
    )  # fmt: skip
    check.add_argument(
        "--against", type=path, metavar="OLD",
        help="also fail where a verdict on this earlier results file passed by more, or its run is gone",
    )  # fmt: skip
    check.add_argument(
        "--shrink", type=POSITIVE, default=10.0, metavar="FACTOR",
        help="with --against: by how much a margin may shrink (default: %(default)g)",
    )  # fmt: skip
    check.add_argument("--junit", type=file, metavar="XML", help="verdicts as JUnit XML")
    check.add_argument("--json", type=file, metavar="FILE", help="verdicts as JSON; - for standard output")
    check.add_argument("--trend", type=file, metavar="FILE", help="shares of the bounds as JSON, for charts over time")
    check.add_argument("--badge", type=file, metavar="FILE", help="the outcome as JSON for shields.io")
    check.add_argument(
        "--github", action="store_true", help="the ten worst failures as annotations, a table as job summary"
    )
    check.add_argument("--speed", action="store_true", help="run times too, against a calibration run")
    check.add_argument("-v", "--verbose", action="store_true", help="print verdicts that pass, too")
    check.add_argument("--margins", action="store_true", help="a table: largest value seen, bound, ratio, by method")
    _add_jobs(check)


def _add_stability(commands: _Commands) -> None:
    stability = _command(
        commands, "stability", "stiff and extreme scenes by every method: where each holds, and the map of it",
        "stability:stability", "", "stiff/bearing-1e8 -o stiff.h5",
    )  # fmt: skip
    stability.add_argument("scenes", nargs="*", metavar="SCENE", help="some of them (default: stiff extreme)")
    _add_settings(stability)
    _add_output(stability, "stability.h5")
    stability.add_argument("--report", type=path, metavar="DIR", help=f"its pages {_PAGES}")
    _add_pool_options(stability, timeout_s=_SUITE_TIMEOUT_S)


def _add_modes(commands: _Commands) -> None:
    modes = _command(
        commands, "modes", "natural frequencies at rest and over rotor speed, multipliers of a turn under gravity",
        "modes:modes", "stiff/nrel-5mw --speeds 0:3:31",
    )  # fmt: skip
    modes.add_argument("scenes", nargs="+", metavar="SCENE", help=_SCENES)
    modes.add_argument(
        "--speeds", type=span, default=(), metavar="FROM:TO:COUNT",
        help="rad/s, equally spaced: Campbell diagram and Floquet multipliers, as 0:3:31 (default: at rest alone)",
    )  # fmt: skip
    modes.add_argument(
        "--stiffness", type=span, default=(), metavar="FROM:TO:COUNT",
        help="N m/rad of every bearing: the stability chart over speed and stiffness",
    )  # fmt: skip
    _add_output(modes, "modes.h5")
    modes.add_argument("--report", type=path, metavar="DIR", help=f"its pages {_PAGES}")
    modes.add_argument("--json", action="store_true", help="the table as JSON, for a script")
    _add_pool_options(modes, timeout_s=_CHART_TIMEOUT_S)


def _add_claims(commands: _Commands) -> None:
    claims = _command(
        commands, "claims", "the paper's claims in words as shares of many runs, its numbers under other conditions",
        "claims:claims", "--runs 20",
    )  # fmt: skip
    _add_output(claims, "claims.h5")
    claims.add_argument(
        "--runs", type=COUNT, default=100, metavar="N",
        help="starts moved by up to 1e-15 rad, for each scene, method and duration (default: %(default)s)",
    )  # fmt: skip
    claims.add_argument(
        "--seed", type=COUNT, default=2020, metavar="N", help="of the moved starts (default: %(default)s)"
    )
    _add_jobs(claims)


def _add_report(commands: _Commands) -> None:
    report = _command(commands, "report", "HTML pages from any file of this program", "reports:report", "my.h5 --open")
    _add_results(report)
    report.add_argument("-o", "--output", type=path, metavar="DIR", help=_PAGES)
    report.add_argument("--open", action="store_true", help="show the index in the browser")

    figures = _command(
        commands, "figures", "the paper's figures as files for a manuscript, from a results file", "reports:figures",
        "--format svg --figure 11",
    )  # fmt: skip
    _add_results(figures)
    figures.add_argument("-o", "--output", type=path, default=Path("figures"), metavar="DIR", help=_default("DIR"))
    figures.add_argument("--format", choices=("pdf", "svg", "png"), default="pdf", help="(default: %(default)s)")
    figures.add_argument("--figure", action="append", metavar="N", help="this one alone; may be repeated")

    animate = _command(
        commands, "animate", "a scene moving, from a results file", "reports:animate",
        "paper/fig11", "mine my.h5 -o mine.gif",
    )  # fmt: skip
    animate.add_argument("scene", metavar="SCENE", help="its name in the results file")
    _add_results(animate)
    animate.add_argument(
        "-o", "--output", type=file, metavar="FILE",
        help="FILE.gif, FILE.webp, or FILE.mp4 where ffmpeg is installed (default: the scene's name with .webp)",
    )  # fmt: skip
    animate.add_argument(
        "--offset", type=POSITIVE, metavar="TIMES",
        help="how many times the tip's distance from its pitch axis is drawn (default: to a tenth of the blade)",
    )  # fmt: skip


def _add_results(parser: argparse.ArgumentParser) -> None:
    text = "a results file (default: results.h5 of this folder, else that of reproduce)"
    parser.add_argument("file", nargs="?", type=path, default=default_results(), metavar="FILE", help=text)
    # As it was called before; it stays for scripts.
    parser.add_argument("--results", type=path, help=argparse.SUPPRESS)


def _add_sweep(commands: _Commands) -> None:
    sweep = _command(
        commands, "sweep", "a parameter study into one dataset", "sweep:sweep",
        "sweeps/fig11-spread -o spread.h5", "my-sweep.toml --dry-run",
    )  # fmt: skip
    sweep.add_argument("file", type=path, metavar="SWEEP.toml", help="or a shipped one: sweeps/fig11-spread")
    _add_methods(sweep, "in place of the file's")
    sweep.add_argument("-o", "--output", type=file, metavar="FILE", help="(default: the sweep's name with its ending)")
    sweep.add_argument(
        "--format", choices=("h5", "nc"), default="h5", help="ending of the default FILE (default: h5); one content"
    )
    sweep.add_argument(
        "--metadata", action="store_true",
        help="RO-Crate, Croissant and statistics for normalization beside FILE, as JSON",
    )  # fmt: skip
    sweep.add_argument("--engine", default="local", metavar="ENGINE", help="local, or dask:tcp://host:port")
    sweep.add_argument("--part", type=part, default=(1, 1), metavar="K/N", help="part K of N alone, for a job array")
    sweep.add_argument("--dry-run", action="store_true", help="how many runs, about how long, how much")
    sweep.add_argument("--yes", action="store_true", help="start a sweep of over a million runs")
    sweep.add_argument("--json", action="store_true", help="progress and summary as JSON lines")
    _add_pool_options(sweep)


def _add_export(commands: _Commands) -> None:
    export = _command(
        commands, "export", "a scene for MuJoCo, Exudyn, SymPy, as CSV, as a benchmark", "export:write",
        "paper/fig11 --to mjcf", "my.toml --to csv -o my.csv",
    )  # fmt: skip
    export.add_argument("scene", metavar="SCENE", help=_SCENE)
    export.add_argument(
        "--to", required=True, choices=EXPORT_FORMATS, metavar="FORMAT",
        help="mjcf: a MuJoCo model; exudyn: a script without this package; csv: the reference trajectory; sympy: the "
        "equations; iftomm: a folder with description, error definition, acceptance and results",
    )  # fmt: skip
    export.add_argument(
        "-o", "--output", type=path, metavar="FILE", help="or folder (default: the scene's name with an ending)"
    )


def _default(metavar: str) -> str:
    return f"{metavar} (default: %(default)s)"


def _command(commands: _Commands, name: str, text: str, target: str, *examples: str) -> argparse.ArgumentParser:
    shown = "".join(f"\n  rotor-mbs {name} {one}".rstrip() for one in examples)
    parser = commands.add_parser(
        name, help=text, description=text, epilog=f"example:{shown}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.set_defaults(command=_late(target))
    return parser


def _late(target: str) -> Callable[[argparse.Namespace], int]:
    """The function "module:name" of this package, imported when it is called."""
    module, _, name = target.partition(":")

    def call(arguments: argparse.Namespace) -> int:
        function = getattr(importlib.import_module(f"rotor_mbs.cli.{module}"), name)
        return int(function(arguments))

    return call


def _add_output(parser: argparse.ArgumentParser, name: str) -> None:
    parser.add_argument("-o", "--output", type=file, default=Path(name), metavar="FILE", help=_default("FILE"))


def _add_methods(parser: argparse.ArgumentParser, text: str = "model/integrator") -> None:
    parser.add_argument("-m", "--method", action="append", metavar="METHOD", help=f"{text}; may be repeated")


def _add_settings(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--set", action="append", type=setting, metavar="NAME=VALUE",
        help="of the methods that have it, in place of the default; may be repeated (see rotor-mbs show METHOD)",
    )  # fmt: skip


def _add_jobs(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-j", "--jobs", type=COUNT, default=cores(), metavar="N",
        help="parallel processes (default: the cores, %(default)s)",
    )  # fmt: skip


def _add_pool_options(parser: argparse.ArgumentParser, timeout_s: float = _DEFAULT_TIMEOUT_S) -> None:
    _add_jobs(parser)
    parser.add_argument(
        "--timeout", type=SECONDS, default=timeout_s, metavar="SECONDS",
        help="a run longer than this is ended and recorded as timed_out (default: %(default)g)",
    )  # fmt: skip


def cores() -> int:
    """How many processes this one may run at once."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
