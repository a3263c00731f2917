"""Define the commands with their arguments, and read or refuse the text of each value.

A command's code is imported when the command is called.
"""

from __future__ import annotations

import argparse
import math
import os
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

import rotor_mbs
from rotor_mbs.errors import InputError, nearest, shown_value
from rotor_mbs.processes import MAX_WORKERS, cores
from rotor_mbs.scenario.toml_file import file_path

REPRODUCED = Path("rotor-mbs-out")  # default output folder of `reproduce`
EXPORT_FORMATS = ("mjcf", "exudyn", "csv")

# Limits of the size of a speed that is not 0, in rad/s. Numbers in a scene have the same limits.
_MIN_SPEED, _MAX_SPEED = 1e-25, 1e25
_SPEED_UNITS = {"rad/s": 1.0, "rpm": math.pi / 30.0}
_MAX_SPAN = 10_000  # largest COUNT in FROM:TO:COUNT
_MAX_NUMBER = 1e9  # largest count, and largest time in s (thirty years)


def default_results() -> Path:
    """Return the results file that is read if none is named.

    It is `results.h5` in the current folder, the default output of `run`, if this file exists;
    otherwise it is the default output of `reproduce`.
    """
    results = Path("results.h5")
    return results if results.exists() else REPRODUCED / results


def pages_beside(results: Path) -> Path:
    """Return the default folder for the pages that are made from a file.

    It is `report` beside results.h5, and `x-report` beside any other file x.h5.
    """
    return results.parent / ("report" if results.name == "results.h5" else f"{results.stem}-report")


def _not_allowed(text: str, allowed: str) -> argparse.ArgumentTypeError:
    return argparse.ArgumentTypeError(f"{shown_value(text)} given, allowed: {allowed}")


def path(text: str) -> Path:
    """Return the path of a file or folder, whether it exists or not."""
    try:
        return file_path(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def file(text: str) -> Path:
    """Return the path of an output file; refuse an empty name and an existing folder."""
    output = path(text)
    if not output.name or output.name == ".." or output.is_dir():
        raise _not_allowed(text, "a file's name, not a folder")
    return output


def folder(text: str) -> Path:
    """Return the path of an output folder that exists or can be created."""
    output = path(text)
    existing = next((place for place in (output, *output.parents) if place.exists()), output)
    if not (existing.is_dir() and os.access(existing, os.W_OK)):
        raise _not_allowed(text, "a folder that can be written")
    return output


def span(text: str, unit: str = "rad/s") -> tuple[float, ...]:
    """Return COUNT equally spaced speeds from FROM to TO, both included, in rad/s.

    Parameters
    ----------
    text : "FROM:TO:COUNT".
    unit : unit of the numbers in the text, "rad/s" or "rpm".

    Raises
    ------
    argparse.ArgumentTypeError
        If the text has another form, or a speed is out of range.
    """
    try:
        start, end, number = text.split(":")
        size = _SPEED_UNITS[unit]
        first, last, count = float(start) * size, float(end) * size, int(number)
        if -_MAX_SPEED <= first < last <= _MAX_SPEED and 2 <= count <= _MAX_SPAN:
            rounding = 1e-14 * max(abs(first), abs(last))
            numbers = []
            for i in range(count):
                speed = first + (last - first) * i / (count - 1)
                # A speed that differs from 0 by a rounding error only is set to 0.
                numbers.append(0.0 if abs(speed) <= rounding else speed)
            # If FROM and TO differ by a few units of rounding only, there are fewer than COUNT
            # different numbers between them. Speeds that are too close to 0 are refused, because
            # the inverse of a speed such as 1e-320 is infinite.
            slowest = min(abs(speed) for speed in numbers if speed)
            if len(set(numbers)) == count and slowest >= _MIN_SPEED:
                return tuple(numbers)
    except ValueError:
        pass
    allowed = f"FROM:TO:COUNT with FROM < TO and COUNT from 2 to {_MAX_SPAN}"
    allowed += (
        f"; speeds that differ, each 0 or of a size from {_MIN_SPEED:g} to {_MAX_SPEED:g} rad/s"
    )
    if unit != "rad/s":
        lowest, highest = _MIN_SPEED / _SPEED_UNITS[unit], _MAX_SPEED / _SPEED_UNITS[unit]
        allowed += f" ({lowest:.3g} to {highest:.3g} {unit})"
    raise _not_allowed(text, allowed)


def span_in_rpm(text: str) -> tuple[float, ...]:
    """Return speeds in rad/s from "FROM:TO:COUNT" in rpm, see `span`."""
    return span(text, "rpm")


def part(text: str) -> tuple[int, int]:
    """Return (K, N) from "K/N": part K of the N parts of a sweep."""
    number, _, parts = text.partition("/")
    try:
        are_whole = number.isdecimal() and parts.isdecimal()
        if are_whole and 1 <= int(number) <= int(parts) <= _MAX_NUMBER:
            return int(number), int(parts)
    except ValueError:  # Python does not convert more than 4300 digits
        pass
    raise _not_allowed(text, f"K/N with K from 1 to N, N at most {_MAX_NUMBER:g}")


def setting(text: str) -> tuple[str, object]:
    """Return (name, value) from "name=value"; the value is a number if it can be read as one."""
    name, equals, value = (piece.strip() for piece in text.partition("="))
    if not (name and equals and value):
        raise _not_allowed(text, "NAME=VALUE")
    for kind in (int, float):
        try:
            return name, kind(value)
        except ValueError:
            continue
    return name, value


def _positive(
    kind: type[int] | type[float], allowed: str, largest: float = _MAX_NUMBER
) -> Callable[[str], float]:
    """Return a function that reads an argument as a number above 0, at most `largest`."""

    def read(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:  # not a number, or a whole number of more than 4300 digits
            value = kind(0)  # 0 is refused below
        if not 0 < value <= largest:
            raise _not_allowed(text, allowed)
        return value

    return read


COUNT = _positive(int, "a whole number from 1 to 1e9")
JOBS = _positive(int, f"a whole number from 1 to {MAX_WORKERS}", MAX_WORKERS)
SECONDS = _positive(float, "seconds, more than 0, at most 1e9")
POSITIVE = _positive(float, "a number more than 0, at most 1e9")


class _Parser(argparse.ArgumentParser):
    """An argument parser that reports an error in one line.

    argparse itself prints a usage text before the error.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        # argparse reads a word that begins with "-" as an option, unless it is a plain number. No
        # option of this program begins with a digit. Words such as "-1e-6" and "-1:3:5" are
        # therefore read as values, too.
        self._negative_number_matcher = re.compile(r"-\.?[0-9]")

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")

    def flag(self, *names: str, help: str) -> None:
        self.add_argument(*names, action="store_true", help=help)

    # Arguments that several commands have.

    def scenes(self, **options: Any) -> None:
        text = "a name (paper/fig05), a folder (paper) or a TOML file"
        options = {"nargs": "+", "help": text} | options
        self.add_argument("scenes", metavar="SCENE", **options)

    def method(
        self, help: str = "method (see rotor-mbs list), or a Python file that defines methods"
    ) -> None:
        self.add_argument(
            "-m", "--method", action="append", metavar="METHOD", help=f"{help}; may be repeated"
        )

    def settings(self) -> None:
        text = (
            "method setting, ignored by methods without it; may be repeated (see rotor-mbs show "
            "METHOD)"
        )
        self.add_argument("--set", action="append", type=setting, metavar="NAME=VALUE", help=text)

    def output(self, kind: Any, metavar: str, default: Path | None = None, help: str = "") -> None:
        help = help or f"output {kind.__name__} (default: %(default)s)"
        self.add_argument("-o", "--output", type=kind, default=default, metavar=metavar, help=help)

    def results(self) -> None:
        text = (
            "file written by rotor-mbs (default: results.h5 if it exists, else "
            "rotor-mbs-out/results.h5)"
        )
        self.add_argument(
            "file", nargs="?", type=path, default=default_results(), metavar="FILE", help=text
        )

    def jobs(self) -> None:
        text = "parallel processes (default: number of cores, here %(default)s)"
        self.add_argument("-j", "--jobs", type=JOBS, default=cores(), metavar="N", help=text)

    def timeout(self, seconds: float = 60.0, exception: str = "", text: str = "") -> None:
        text = text or "time limit per run in s; longer runs have the status timed_out"
        text += f" (default: %(default)g{exception})"
        self.add_argument("--timeout", type=SECONDS, default=seconds, metavar="SECONDS", help=text)


class _Names(argparse.Action):
    """Print the column names that `compare` knows, and end the program, as --help does."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        # imported late: other commands do not need it
        from rotor_mbs.analysis.text_tables import TextTable
        from rotor_mbs.comparison.channels import known_names

        names = "known by (case, blanks and underscores do not matter)"
        print(TextTable(("channel", names), known_names()))
        parser.exit()


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """Return the parsed arguments of a command; end with status 2 on bad usage.

    Parameters
    ----------
    argv : the command and its arguments; without any, the help is printed.

    Returns
    -------
    argparse.Namespace
        The parsed arguments. Their `command` is the function to call, "module:function" in
        `rotor_mbs.cli`.
    """
    parser, commands = _parser()
    if argv and not argv[0].startswith("-") and argv[0] not in commands:
        hint = nearest(argv[0], commands)
        parser.error(
            f"unknown command {shown_value(argv[0])}{hint}; allowed: {', '.join(commands)}"
        )
    arguments, unknown = parser.parse_known_args(argv or ["--help"])
    if unknown:
        message = f"unrecognized arguments: {' '.join(unknown)}"
        if argv[0] == "list" and not unknown[0].startswith("-"):
            message += f"; allowed: none, or rotor-mbs show {unknown[0]} (a file, scene or method)"
        commands.get(argv[0], parser).error(message)
    return arguments


def load_methods(arguments: argparse.Namespace) -> None:
    """Replace each Python file in the arguments by the names of the methods that it defines.

    Raises InputError for an unknown method, and for a file that cannot be loaded.
    """
    given = [name for name in ("method", "methods") if name in arguments]
    if given:
        # imported late: other commands do not need it
        from rotor_mbs.methods.catalogue import check_names

        for name in given:
            setattr(arguments, name, check_names(getattr(arguments, name) or ()))


def _parser() -> tuple[_Parser, dict[str, _Parser]]:
    """Return the parser of the command line, and the parsers of the commands by name."""
    formatter = argparse.RawDescriptionHelpFormatter
    parser = _Parser(
        prog="rotor-mbs",
        description=(
            "Simulate wind-turbine rotors with independent models, and compare these with each "
            "other."
        ),
        epilog="start with:\n  rotor-mbs list\n  rotor-mbs show paper/fig11\n  rotor-mbs run "
        "paper/fig11\n"
        "rotor-mbs COMMAND --help shows the options of a command and an example.\n"
        "exit status: 0 success; 1 a check failed or a run did not succeed; 2 bad input; 130 "
        "interrupted",
        formatter_class=formatter,
    )
    parser.add_argument("--version", action="version", version=f"rotor-mbs {rotor_mbs.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def command(name: str, text: str, function: str, *examples: str) -> _Parser:
        """Add a command, and return its parser.

        Parameters
        ----------
        name : name of the command.
        text : description of the command.
        function : function that performs the command, "module:function" in `rotor_mbs.cli`.
        *examples : arguments of the command, one text for each example in the help.
        """
        lines = ["example:"]
        for example in examples:
            lines.append(f"  rotor-mbs {name} {example}".rstrip())
        options = commands.add_parser(
            name, help=text, description=text, epilog="\n".join(lines), formatter_class=formatter
        )  # fmt: skip
        options.set_defaults(command=function)
        return options

    options = command("list", "list scenes, sweeps and methods", "commands:list_all", "", "--json")
    options.flag("--json", help="print JSON")

    options = command(
        "show",
        "show a scene and its methods, the settings of a method, or what is in a file",
        "commands:show",
        "paper/fig11",
        "paper/fig11 --build",
        "results.h5",
    )
    what = (
        "a scene (paper/fig05), a TOML file, a method (lagrange/taylor, mine.py), or a file of "
        "results (results.h5)"
    )
    options.add_argument("scene", metavar="NAME", help=what)
    options.flag("--build", help="also list the items that each model builds")
    options.flag("--json", help="print JSON")

    options = command(
        "new", "write a commented scene file to start from", "commands:new",
        "my.toml", "mine.toml --from paper/fig11", "mine.toml --from MODEL.fst",
    )  # fmt: skip
    options.add_argument(
        "file", type=file, metavar="FILE", help="a TOML file that does not exist yet"
    )
    text = (
        "a scene (paper/fig11) or a TOML file to copy, or an OpenFAST model (MODEL.fst) to make a "
        "scene of"
    )
    options.add_argument("--from", dest="source", metavar="SOURCE", help=text)

    options = command(
        "reproduce",
        (
            "run every scene of the paper with the default methods and with each erratum alone, "
            "and write the report"
        ),
        "runs:reproduce",
        "",
        "-o out -j 4",
    )
    options.output(folder, "DIR", REPRODUCED)
    options.jobs()
    options.timeout()

    options = command(
        "run", "run scenes with one or more methods and store the results in a file", "runs:run",
        "my.toml -o my.h5", "paper/fig11 -m lagrange/taylor -m exudyn_tree/rk67 --set step=1e-3",
    )  # fmt: skip
    options.scenes()
    options.method(
        "method (see rotor-mbs list), or a Python file that defines methods (default: selected for "
        "each scene)"
    )
    options.settings()
    options.output(file, "FILE", Path("results.h5"))
    options.jobs()
    options.timeout()

    options = command(
        "compare",
        (
            "compare another program's trajectory, loads or modes with a scene; exit status 1 if "
            "they differ"
        ),
        "commands:compare",
        "mine.csv --scene paper/fig11",
        "OpenFAST.out --scene my.toml --columns map.toml",
    )
    text = (
        "text with a header, .json, .npz, .mat, HDF5, netCDF, an Exudyn sensor file, OpenFAST .out "
        "or .outb"
    )
    options.add_argument("data", type=path, metavar="DATA", help=text)
    options.add_argument(
        "--scene", required=True, metavar="SCENE", help="a name (paper/fig05) or a TOML file"
    )
    text = (
        "mapping file: column, unit, sign and offset of channels that are not known by name (see "
        "docs/compare.md)"
    )
    options.add_argument("--columns", type=path, metavar="MAP.toml", help=text)
    text = (
        "bound (rad) on interval defects (the equations of motion integrated from each row to the "
        "next, minus the next row) and on errors divided by the error growth; for loads and "
        "frequencies a relative bound (default: %(default)g)"
    )
    options.add_argument("--tolerance", type=POSITIVE, default=1e-6, metavar="X", help=text)
    text = "time limit for the reference in s (default: %(default)g)"
    options.add_argument("--timeout", type=SECONDS, default=600.0, metavar="SECONDS", help=text)
    options.output(folder, "DIR", Path("comparison"), "output folder (default: %(default)s)")
    options.flag("--json", help="print the verdict as JSON")
    options.add_argument(
        "--names", action=_Names, nargs=0, help="print the names that columns may have, and end"
    )

    options = command(
        "bench",
        "measure error and run time of each method at several tolerances or steps",
        "commands:bench",
        "paper/fig11",
        "paper/fig11 my.toml -m lagrange/taylor -m exudyn_tree/rk67 -o bench.h5",
    )
    options.scenes()
    options.method(
        "method (see rotor-mbs list), or a Python file that defines methods (default: all)"
    )
    options.output(file, "FILE", Path("bench.h5"))
    text = "timed runs per point (default: %(default)s; at most 5 for runs over 0.5 s)"
    options.add_argument("--repeats", type=COUNT, default=20, metavar="N", help=text)
    # With this default, `bench` takes eight minutes for the paper's seventeen scenes.
    text = "time budget per scene in s (default: %(default)g)"
    options.add_argument("--budget", type=SECONDS, default=28.0, metavar="SECONDS", help=text)

    options = command(
        "reference",
        "recompute quad-precision references",
        "runs:reference",
        "paper/fig08 -o reference.h5",
    )
    options.scenes()
    options.add_argument(
        "-o", "--output", type=file, required=True, metavar="FILE", help="output file"
    )
    options.jobs()
    options.timeout()

    options = command(
        "check",
        "check the accuracy of stored runs; exit status 1 if a check fails",
        "verdicts:check",
        "",
        "rotor-mbs-out/results.h5 --junit check.xml",
    )
    options.add_argument(
        "file",
        nargs="?",
        type=path,
        metavar="FILE",
        help="file to check (default: compute a set of runs)",
    )
    options.method("method to compute if no FILE is given, or a Python file that defines methods")
    options.add_argument(
        "--bounds",
        type=path,
        metavar="TOML",
        help="bounds that take precedence over reference/accuracy.toml",
    )
    text = "fail if a scene of FILE has no run with this method; may be repeated"
    options.add_argument("--require", action="append", metavar="METHOD", help=text)
    text = (
        "also fail if, compared with this earlier file, a margin has shrunk more than tenfold, a "
        "run is missing or a scene was changed"
    )
    options.add_argument("--against", type=path, metavar="OLD", help=text)
    options.flag(
        "--allow-changed", help="tell what changed in scenes since OLD, and do not fail for it"
    )
    options.add_argument(
        "--junit", type=file, metavar="XML", help="write the verdicts as JUnit XML"
    )
    options.add_argument(
        "--json",
        type=file,
        metavar="FILE",
        help="write the verdicts as JSON; - for standard output",
    )
    options.flag("--github", help="print the ten worst failures as annotations")
    options.flag("-v", "--verbose", help="print verdicts that pass, too")
    options.jobs()

    options = command(
        "test-method",
        (
            "test a method, your own or a built-in one, and report faults with their most likely "
            "causes"
        ),
        "verdicts:test_method",
        "./mine.py",
        "lagrange/dop853 --json -",
    )
    options.add_argument(
        "methods",
        nargs="+",
        metavar="METHOD",
        help="a method (see rotor-mbs list), or a Python file",
    )
    options.add_argument("--junit", type=file, metavar="XML", help="write the checks as JUnit XML")
    options.add_argument(
        "--json",
        type=file,
        metavar="FILE",
        help="write the checks as JSON; - for standard output",
    )
    options.timeout()

    options = command(
        "sweep", "run a parameter study and store it in one dataset", "commands:sweep",
        "sweeps/fig11-spread -o spread.h5", "my-sweep.toml --dry-run",
    )  # fmt: skip
    options.add_argument(
        "file",
        type=path,
        metavar="SWEEP.toml",
        help="a file, or a shipped sweep (sweeps/fig11-spread)",
    )
    options.method("method to use instead of those in the file")
    options.output(file, "FILE", help="output file (default: name of the sweep with .h5)")
    options.flag("--metadata", help="also write Croissant metadata beside FILE, as JSON")
    text = "also write a folder for Hugging Face datasets: a file per split and a dataset card"
    options.add_argument("--datasets", type=path, metavar="DIR", help=text)
    options.add_argument(
        "--engine",
        default="local",
        metavar="ENGINE",
        help="local (default), or dask:tcp://HOST:PORT",
    )
    options.add_argument(
        "--part",
        type=part,
        default=(1, 1),
        metavar="K/N",
        help="compute part K of N, for a job array",
    )
    options.flag("--fresh", help="recompute all stored runs")
    options.flag("--dry-run", help="only print number of runs and disk space")
    options.flag("--json", help="print the summary or the estimate as JSON")
    options.jobs()
    options.timeout()

    options = command(
        "stability",
        "run stiff and extreme scenes with every method and report which are stable and accurate",
        "commands:stability",
        "",
        "stiff/bearing-1e8 -o stiff.h5",
    )
    options.scenes(
        nargs="*", help="names of scenes, folders or TOML files (default: stiff extreme)"
    )
    options.method(
        "method (see rotor-mbs list), or a Python file that defines methods (default: all)"
    )
    options.settings()
    options.output(file, "FILE", Path("stability.h5"))
    options.jobs()
    # Many runs of the stability suite reach the time limit, however long it is. With this short
    # limit the suite takes minutes.
    options.timeout(8.0, "; at least 120 for lagrange/taylor")

    options = command(
        "modes",
        (
            "compute natural frequencies at rest and over rotor speed, and Floquet multipliers "
            "under gravity"
        ),
        "commands:modes",
        "stiff/nrel-5mw --speeds 0:3:31",
    )
    options.scenes()
    options.method(
        "method, or a Python file, whose model is compared with the closed form (default: all)"
    )
    either = options.add_mutually_exclusive_group()
    text = "rotor speeds in rad/s, equally spaced, such as 0:3:31 (default: only at rest)"
    either.add_argument("--speeds", type=span, default=(), metavar="FROM:TO:COUNT", help=text)
    text = "the same in rpm, such as 0:30:31"
    either.add_argument(
        "--rpm", type=span_in_rpm, dest="speeds", metavar="FROM:TO:COUNT", help=text
    )
    options.output(file, "FILE", Path("modes.h5"))
    options.flag("--json", help="print the table as JSON")
    options.jobs()
    options.timeout(
        600.0,
        text="time limit per scene in s; the modes of a scene that takes longer are not stored",
    )

    options = command(
        "report",
        "write HTML pages from a results, bench, sweep, modes or comparison file",
        "commands:report",
        "my.h5 --open",
    )
    options.results()
    text = "folder for the pages (default: NAME-report beside NAME.h5; report beside results.h5)"
    options.output(folder, "DIR", help=text)
    options.flag("--open", help="open the index in a browser")

    options = command(
        "figures",
        "draw the paper's figures for a manuscript, from a results file",
        "commands:figures",
        "--format svg --figure 11",
    )
    options.results()
    options.output(folder, "DIR", Path("figures"))
    options.add_argument(
        "--format",
        choices=("pdf", "svg", "png"),
        default="pdf",
        help="format (default: %(default)s)",
    )
    options.add_argument(
        "--figure", action="append", metavar="N", help="only this figure; may be repeated"
    )

    options = command(
        "animate", "animate a scene from a results file", "commands:animate",
        "paper/fig11", "my my.h5 -o my.gif",
    )  # fmt: skip
    options.add_argument("scene", metavar="SCENE", help="name of a scene in the results file")
    options.results()
    text = "FILE.gif or FILE.webp (default: name of the scene with .webp)"
    options.output(file, "FILE", help=text)
    text = (
        "magnification of the tip's distance from its pitch axis (default: scaled to 10 %% of "
        "blade length)"
    )
    options.add_argument("--offset", type=POSITIVE, metavar="TIMES", help=text)

    options = command(
        "export", "export a scene for MuJoCo or Exudyn, or its reference as CSV", "commands:export",
        "paper/fig11 --to mjcf", "my.toml --to csv -o my.csv",
    )  # fmt: skip
    options.add_argument("scene", metavar="SCENE", help="a name (paper/fig05) or a TOML file")
    text = "mjcf: MuJoCo model; exudyn: stand-alone Exudyn script; csv: reference trajectory"
    options.add_argument("--to", required=True, choices=EXPORT_FORMATS, metavar="FORMAT", help=text)
    options.output(
        file,
        "FILE",
        help="output file (default: name of the scene with .xml, -exudyn.py or .csv)",
    )

    return parser, dict(commands.choices)
