"""The commands and their arguments as one table, and how each value is read from its text, or refused.

Loads the code of no command: the others would wait for it.
"""

from __future__ import annotations

import argparse
import importlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import rotor_mbs
from rotor_mbs.errors import nearest
from rotor_mbs.runs import cores

REPRODUCED = Path("rotor-mbs-out")  # where `reproduce` writes
_LONGEST_SPAN = 10_000
_LONGEST_NAME = 200  # bytes of a file's name; file systems allow 255, and temporary names are longer
_LARGEST = 1e9  # of a count; of seconds: thirty years
EXPORT_FORMATS = ("mjcf", "exudyn", "csv", "sympy", "iftomm")


def default_results() -> Path:
    """The results file that is read where none is named: `run`'s in this folder, else `reproduce`'s."""
    here = Path("results.h5")
    return here if here.exists() else REPRODUCED / here


def pages_beside(results: Path) -> Path:
    """The folder for the pages of a file where none is named: `report` beside results.h5, x-report beside x.h5."""
    return results.parent / ("report" if results.name == "results.h5" else f"{results.stem}-report")


def path(text: str) -> Path:
    """A path that the system can look up, whether there is something or not."""
    try:
        Path(text).stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as exc:
        raise argparse.ArgumentTypeError(f"{_short(text)}: {exc.strerror}; allowed: a path that can be read") from exc
    except ValueError as exc:
        raise argparse.ArgumentTypeError(f"{_short(text)}: {exc}; allowed: a path without it") from exc
    return Path(text)


def file(text: str) -> Path:
    """Where a file is to be written: neither nothing, nor a folder that is there; with room for a longer name."""
    found = path(text)
    if not found.name or found.name == ".." or found.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r} given, allowed: a file's name, not a folder")
    if len(os.fsencode(found.name)) > _LONGEST_NAME:
        raise argparse.ArgumentTypeError(f"{_short(text)}: allowed: a file's name of at most {_LONGEST_NAME} bytes")
    return found


def folder(text: str) -> Path:
    """Where files are to be written: a folder that is there, or that can be made."""
    found = path(text)
    there = next((one for one in (found, *found.parents) if one.exists()), found)
    if not (there.is_dir() and os.access(there, os.W_OK)):
        raise argparse.ArgumentTypeError(f"{text!r} given, allowed: a folder that can be written")
    return found


def _short(text: str) -> str:
    return ascii(text if len(text) <= 80 else f"{text[:77]}...")


def span(text: str) -> tuple[float, ...]:
    """COUNT numbers from FROM to TO, both included, of "FROM:TO:COUNT"."""
    try:
        first, last, count = (kind(part) for kind, part in zip((float, float, int), text.split(":"), strict=True))
        if 0.0 <= first < last < float("inf") and 2 <= count <= _LONGEST_SPAN:
            return tuple(first + (last - first) * i / (count - 1) for i in range(int(count)))
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(
        f"{text!r} given, allowed: FROM:TO:COUNT with 0 <= FROM < TO and COUNT from 2 to {_LONGEST_SPAN}"
    )


def part(text: str) -> tuple[int, int]:
    """(K, N) of "K/N"."""
    number, _, parts = text.partition("/")
    if not (number.isdecimal() and parts.isdecimal() and 1 <= int(number) <= int(parts)):
        raise argparse.ArgumentTypeError(f"{text!r} given, allowed: K/N with K from 1 to N")
    return int(number), int(parts)


def setting(text: str) -> tuple[str, object]:
    """(name, value) of "name=value": a number where it is one."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f"{text!r} given, allowed: NAME=VALUE")
    for kind in (int, float):
        try:
            return name, kind(value)
        except ValueError:
            continue
    return name, value


def positive(kind: type[int] | type[float], allowed: str) -> Callable[[str], float]:
    def read(text: str) -> float:
        try:
            value = kind(text)
        except ValueError:
            value = kind(0)
        if not 0 < value <= _LARGEST:
            raise argparse.ArgumentTypeError(f"{text!r} given, allowed: {allowed}")
        return value

    return read


COUNT = positive(int, "a whole number from 1 to 1e9")
SECONDS = positive(float, "seconds, more than 0, at most 1e9")
POSITIVE = positive(float, "a number more than 0, at most 1e9")

Argument = tuple[tuple[str, ...], dict[str, Any]]  # names and options of `ArgumentParser.add_argument`


class Command(NamedTuple):
    """function: "module:name" in this package, imported when it is called; examples: what may follow the name."""

    name: str
    text: str
    function: str
    examples: tuple[str, ...]
    arguments: tuple[Argument, ...]

    def __call__(self, arguments: argparse.Namespace) -> int:
        module, _, name = self.function.partition(":")
        return int(getattr(importlib.import_module(f"rotor_mbs.cli.{module}"), name)(arguments))


def _argument(*names: str, **options: Any) -> Argument:
    return names, options


def _flag(*names: str, help: str) -> Argument:
    return names, {"action": "store_true", "help": help}


def _output(kind: Any, metavar: str, default: object = None, help: str = "to write (default: %(default)s)") -> Argument:
    return _argument("-o", "--output", type=kind, default=default, metavar=metavar, help=help)


def _method(help: str = "model/integrator, as in rotor-mbs list") -> Argument:
    return _argument("-m", "--method", action="append", metavar="METHOD", help=f"{help}; may be repeated")


def _timeout(seconds: float = 60.0) -> Argument:
    text = "a run longer than this is ended and recorded as timed_out (default: %(default)g)"
    return _argument("--timeout", type=SECONDS, default=seconds, metavar="SECONDS", help=text)


# What several commands have.
_SCENE, _SCENES = "a name (paper/fig05) or a TOML file", "a name (paper/fig05), a folder (paper), a TOML file"
_PAGES = "(default: beside FILE, its name with -report; of results.h5: report)"
# fmt: off
_AS_JSON = _flag("--json", help="as JSON, for a script")
_RESULTS = (
    _argument("file", nargs="?", type=path, metavar="FILE",
              help="a results file (default: results.h5 of this folder, else that of reproduce)"),
    _argument("--results", type=path, help=argparse.SUPPRESS),  # as it was called before; it stays for scripts
)
_SET = _argument("--set", action="append", type=setting, metavar="NAME=VALUE",
                 help="of the methods that have it, in place of the default; may be repeated "
                      "(see rotor-mbs show METHOD)")
_JOBS = _argument("-j", "--jobs", type=COUNT, default=cores(), metavar="N",
                  help="parallel processes (default: the cores, %(default)s)")
_REPORT = _argument("--report", type=folder, metavar="DIR", help=f"its pages {_PAGES}")
_SOME_SCENES = _argument("scenes", nargs="+", metavar="SCENE", help=_SCENES)

_COMMANDS = (
    Command("list", "scenes, sweeps and methods, a line each", "scenes:list_all", ("", "--json"), (_AS_JSON,)),
    Command("show", "one scene: its data and its methods; or one method: its settings", "scenes:show",
            ("paper/fig11", "paper/fig11 --build"), (
        _argument("scene", metavar="SCENE", help=f"{_SCENE}; or a method (lagrange/taylor)"),
        _flag("--build", help="also the items that each model builds"),
        _AS_JSON,
    )),
    Command("new", "a commented scene file to start from", "scenes:new", ("my.toml",), (
        _argument("file", type=file, metavar="FILE", help="a TOML file that does not exist yet"),
    )),
    Command("reproduce", "every scene of the paper by every model, and the report", "runs:reproduce",
            ("", "-o out -j 4"), (_output(folder, "DIR", REPRODUCED), _JOBS, _timeout())),
    Command("run", "scenes by methods, into one results file", "runs:run",
            ("my.toml -o my.h5", "paper/fig11 -m lagrange/taylor -m exudyn_tree/rk67 --set step=1e-3"),
            (_SOME_SCENES, _method(), _SET, _output(file, "FILE", Path("results.h5")), _JOBS, _timeout())),
    Command("compare", "another program's trajectory against a scene's reference; exit status 1 where it differs",
            "studies:compare", ("mine.csv --scene paper/fig11", "OpenFAST.out --scene my.toml --columns map.toml"), (
        _argument("data", type=Path, metavar="DATA",
                  help="text with a header, .npz, .mat, HDF5, netCDF, an Exudyn sensor file, OpenFAST .out or .outb"),
        _argument("--scene", required=True, metavar="SCENE", help=_SCENE),
        _argument("--columns", type=Path, metavar="MAP.toml",
                  help="column, unit, sign, zero of each channel (default: guessed)"),
        _argument("--tolerance", type=POSITIVE, default=1e-6, metavar="X",
                  help="rad per unit of error growth that still agree (default: %(default)g)"),
        _output(folder, "DIR", Path("comparison"), "of the page (default: %(default)s)"),
        _flag("--json", help="the verdict as JSON, for a script"),
    )),
    Command("bench", "error against run time, method by method", "studies:bench",
            ("paper/fig11", "paper/fig11 my.toml -m lagrange/taylor -m exudyn_tree/rk67 -o bench.h5"), (
        _argument("scenes", nargs="*", metavar="SCENE", help=_SCENES),
        _method(),
        _SET,
        _output(file, "FILE", Path("bench.h5")),
        _flag("--growth", help="also how cost grows with blades and with duration"),
        _argument("--repeats", type=COUNT, default=20, metavar="N",
                  help="timed runs of each point (default: %(default)s; 5 at most for runs over 0.5 s)"),
        # The paper's seventeen scenes in eight minutes.
        _argument("--budget", type=SECONDS, default=28.0, metavar="SECONDS",
                  help="for each scene (default: %(default)g)"),
    )),
    Command("reference", "quad precision references, computed anew, as they are frozen", "runs:reference",
            ("paper/fig08 -o reference.h5",), (
        _SOME_SCENES,
        _argument("-o", "--output", type=file, required=True, metavar="FILE"),
        _JOBS,
        _timeout(),
    )),
    Command("check", "accuracy verdicts; exit status 1 where one fails", "check:check",
            ("", "rotor-mbs-out/results.h5 --junit check.xml"), (
        _argument("file", nargs="?", type=path, metavar="FILE", help="a results file (default: a quick set, computed)"),
        _argument("--bounds", type=path, metavar="TOML", help="own bounds, read before reference/accuracy.toml"),
        _argument("--require", action="append", metavar="METHOD",
                  help="fail where a scene of FILE has no run of it; may be repeated"),
        _argument("--against", type=path, metavar="OLD",
                  help="also fail where a verdict on this earlier results file passed by more, or its run is gone"),
        _argument("--shrink", type=POSITIVE, default=10.0, metavar="FACTOR",
                  help="with --against: by how much a margin may shrink (default: %(default)g)"),
        _argument("--junit", type=file, metavar="XML", help="verdicts as JUnit XML"),
        _argument("--json", type=file, metavar="FILE", help="verdicts as JSON; - for standard output"),
        _argument("--trend", type=file, metavar="FILE", help="shares of the bounds as JSON, for charts over time"),
        _argument("--badge", type=file, metavar="FILE", help="the outcome as JSON for shields.io"),
        _flag("--github", help="the ten worst failures as annotations, a table as job summary"),
        _flag("--speed", help="run times too, against a calibration run"),
        _flag("-v", "--verbose", help="print verdicts that pass, too"),
        _flag("--margins", help="a table: largest value seen, bound, ratio, by method"),
        _JOBS,
    )),
    Command("sweep", "a parameter study into one dataset", "sweep:sweep",
            ("sweeps/fig11-spread -o spread.h5", "my-sweep.toml --dry-run"), (
        _argument("file", type=path, metavar="SWEEP.toml", help="or a shipped one: sweeps/fig11-spread"),
        _method("in place of the file's"),
        _output(file, "FILE", help="(default: the sweep's name with its ending)"),
        _argument("--format", choices=("h5", "nc"), default="h5",
                  help="ending of the default FILE (default: h5); one content"),
        _flag("--metadata", help="RO-Crate, Croissant and statistics for normalization beside FILE, as JSON"),
        _argument("--engine", default="local", metavar="ENGINE", help="local, or dask:tcp://host:port"),
        _argument("--part", type=part, default=(1, 1), metavar="K/N", help="part K of N alone, for a job array"),
        _flag("--fresh", help="compute stored runs again"),
        _flag("--dry-run", help="how many runs, about how long, how much"),
        _flag("--yes", help="start a sweep of over a million runs"),
        _flag("--json", help="progress and summary as JSON lines"),
        _JOBS,
        _timeout(),
    )),
    Command("stability", "stiff and extreme scenes by every method: where each holds, and the map of it",
            "studies:stability", ("", "stiff/bearing-1e8 -o stiff.h5"), (
        _argument("scenes", nargs="*", metavar="SCENE", help="some of them (default: stiff extreme)"),
        _method(),
        _SET,
        _output(file, "FILE", Path("stability.h5")),
        _REPORT,
        _JOBS,
        # The suite has many runs that would reach any limit: with a shorter one it ends in minutes.
        _timeout(8.0),
    )),
    Command("modes", "natural frequencies at rest and over rotor speed, multipliers of a turn under gravity",
            "studies:modes", ("stiff/nrel-5mw --speeds 0:3:31",), (
        _SOME_SCENES,
        _argument("--speeds", type=span, default=(), metavar="FROM:TO:COUNT",
                  help="rad/s, equally spaced: Campbell diagram and Floquet multipliers, as 0:3:31 "
                       "(default: at rest alone)"),
        _argument("--stiffness", type=span, default=(), metavar="FROM:TO:COUNT",
                  help="N m/rad of every bearing: the stability chart over speed and stiffness"),
        _output(file, "FILE", Path("modes.h5")),
        _REPORT,
        _flag("--json", help="the table as JSON, for a script"),
        _JOBS,
        _timeout(600.0),
    )),
    Command("claims", "the paper's claims in words as shares of many runs, its numbers under other conditions",
            "studies:claims", ("--runs 20",), (
        _output(file, "FILE", Path("claims.h5")),
        _argument("--runs", type=COUNT, default=100, metavar="N",
                  help="starts moved by up to 1e-15 rad, for each scene, method and duration (default: %(default)s)"),
        _argument("--seed", type=COUNT, default=2020, metavar="N", help="of the moved starts (default: %(default)s)"),
        _JOBS,
    )),
    Command("report", "HTML pages from any file of this program", "studies:report", ("my.h5 --open",), (
        *_RESULTS,
        _output(folder, "DIR", help=_PAGES),
        _flag("--open", help="show the index in the browser"),
    )),
    Command("figures", "the paper's figures as files for a manuscript, from a results file", "studies:figures",
            ("--format svg --figure 11",), (
        *_RESULTS,
        _output(folder, "DIR", Path("figures")),
        _argument("--format", choices=("pdf", "svg", "png"), default="pdf", help="(default: %(default)s)"),
        _argument("--figure", action="append", metavar="N", help="this one alone; may be repeated"),
    )),
    Command("animate", "a scene moving, from a results file", "studies:animate",
            ("paper/fig11", "mine my.h5 -o mine.gif"), (
        _argument("scene", metavar="SCENE", help="its name in the results file"),
        *_RESULTS,
        _output(file, "FILE", help="FILE.gif, FILE.webp, or FILE.mp4 where ffmpeg is installed "
                                   "(default: the scene's name with .webp)"),
        _argument("--offset", type=POSITIVE, metavar="TIMES",
                  help="how many times the tip's distance from its pitch axis is drawn "
                       "(default: to a tenth of the blade)"),
    )),
    Command("export", "a scene for MuJoCo, Exudyn, SymPy, as CSV, as a benchmark", "studies:export",
            ("paper/fig11 --to mjcf", "my.toml --to csv -o my.csv"), (
        _argument("scene", metavar="SCENE", help=_SCENE),
        _argument("--to", required=True, choices=EXPORT_FORMATS, metavar="FORMAT",
                  help="mjcf: a MuJoCo model; exudyn: a script without this package; csv: the reference trajectory; "
                       "sympy: the equations; iftomm: a folder with description, error definition, acceptance and "
                       "results"),
        _output(path, "FILE", help="or folder (default: the scene's name with an ending)"),
    )),
)
# fmt: on


class _Parser(argparse.ArgumentParser):
    """Bad usage is one clear line, as all bad input is, without the usage above it."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The arguments, with `command` set to the function that carries them out. Ends with status 2 on bad usage."""
    parser, known = _parser(), [command.name for command in _COMMANDS]
    if argv and not argv[0].startswith("-") and argv[0] not in known:
        parser.error(f"no command {argv[0]!r}{nearest(argv[0], known)}; allowed: {', '.join(known)}")
    arguments, unknown = parser.parse_known_args(argv or ["--help"])
    if unknown:
        parser.prog += f" {arguments.command.name}"
        parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    if hasattr(arguments, "results"):
        arguments.file = arguments.results or arguments.file or default_results()
    return arguments


def _parser() -> _Parser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = _Parser(
        prog="rotor-mbs",
        description="Scenes of a rotor by independent models, compared with each other and with a published paper.",
        epilog="start with:\n  rotor-mbs list\n  rotor-mbs show paper/fig11\n  rotor-mbs run paper/fig11\n"
        "rotor-mbs COMMAND --help tells the options of a command and has an example.\n"
        "exit status: 0 all well; 1 a check failed or a run did not succeed; 2 bad input; 130 interrupted",
        formatter_class=raw,
    )
    parser.add_argument("--version", action="version", version=f"rotor-mbs {rotor_mbs.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in _COMMANDS:
        shown = "".join(f"\n  rotor-mbs {command.name} {one}".rstrip() for one in command.examples)
        own = commands.add_parser(
            command.name, help=command.text, description=command.text, epilog=f"example:{shown}", formatter_class=raw
        )
        own.set_defaults(command=command)
        for names, options in command.arguments:
            own.add_argument(*names, **options)
    return parser
