"""Every command that writes HDF5 over every kind of file: it extends its own kind and loses
nothing, and leaves the bytes of any other; the table of docs/data.md."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.checking import results_file
from support.commands import rotor_mbs
from support.scenes import paper
from support.stored import Made, rotor, store

import rotor_mbs as rm
from rotor_mbs.errors import RotorError
from rotor_mbs.runs.merge import fit_file_to_request
from rotor_mbs.runs.read import points_table, read_records, write_records
from rotor_mbs.runs.table import TableFile
from rotor_mbs.scenario.catalogue import find_scenes
from rotor_mbs.studies import reproduce
from rotor_mbs.studies.sweep_metadata import write_splits

SCENE = "check/held"
OTHER = "paper/fig08"  # of what is there before: no command computes it again
METHOD = "lagrange/dop853"
TABLES = {"results", "unfinished results", "bench", "stability"}
# By command, the kinds that it extends; every other one is refused.
EXTENDS = {
    "run": TABLES,
    "reference": TABLES,
    "bench": TABLES,
    "stability": TABLES,
    "reproduce": TABLES,
    "save of runs": set[str](),  # they would be lost: see the test of copies
    "sweep": {"sweep", "unfinished sweep"},
    "save of a sweep": {"sweep", "unfinished sweep"},
    "datasets of a sweep": {"split"},
    "modes": {"modes"},
    "save of modes": {"modes"},
    "compare": {"comparison"},
    "save of a comparison": {"comparison"},
}
KINDS = sorted({*TABLES, *(kind for kinds in EXTENDS.values() for kind in kinds)})
KINDS += ["damaged", "written to", "earlier format", "foreign", "text"]
_QUICK = {"run", "sweep", "modes", "compare", "save of runs", "save of modes"}


@pytest.fixture(scope="module")
def folder(files: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of every kind, by its name."""
    made = tmp_path_factory.mktemp("kinds")
    shutil.copy(files / "s.h5", made / "sweep")
    shutil.copy(files / "s.h5", made / "unfinished sweep")
    TableFile(made / "unfinished sweep").tables[""].place(1).mark_missing([0])
    write_splits(files / "s.h5", made / "splits")
    shutil.move(made / "splits" / "train.h5", made / "split")

    short = paper("fig08", samples=11)
    for name in ("results", "unfinished results"):
        store(
            made / name,
            [Made(short, "reference", rotor(np.sin)), Made(short, METHOD, rotor(np.sin))],
        )
    TableFile(made / "unfinished results").place(f"{OTHER}/{METHOD}").mark_missing([0])
    known = {"run": "one", "scene": OTHER, "method_name": METHOD, "step": 0.5, "tolerance": np.nan}
    table = points_table("stability", [known])
    place = fit_file_to_request(made / "stability", [table]).place("one", "stability")
    place.write(place.encode({"status": "ok", "angle_error_max": 0.25}))
    ended = rotor_mbs("bench", OTHER, "-m", METHOD, "--budget", "0.01", "-o", made / "bench")
    assert ended.status == 0
    for kind in ("modes", "comparison"):
        records = read_records(files / f"{kind}.h5", kind)
        write_records(made / kind, [replace(record, scene=OTHER) for record in records])

    content = (made / "results").read_bytes()
    (made / "damaged").write_bytes(content[:3000] + bytes([content[3000] ^ 1]) + content[3001:])
    shutil.copy(made / "results", made / "written to")
    with h5py.File(made / "written to", "r+") as file:
        file.attrs["title"] = "mine"
    with h5py.File(made / "earlier format", "w") as file:
        file.attrs["format"], file.attrs["format_version"] = "rotor_mbs", 2
    with h5py.File(made / "foreign", "w") as file:
        file["time"] = [0.0, 1.0]
    (made / "text").write_text("time [s],rotor [rad]\n0.0,0.5\n")
    return made


def answer(command: str, path: Path, files: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """ "" where a command has written to `path`, else its one line."""
    sweep, data = files / "s.toml", files / "data.csv"
    lines: dict[str, list[object]] = {
        "run": ["run", SCENE, "-m", METHOD, "-j", "1", "-o", path],
        "reference": ["reference", SCENE, "-j", "1", "-o", path],
        "bench": ["bench", SCENE, "-m", METHOD, "--budget", "1", "-o", path],
        "stability": ["stability", SCENE, "-m", METHOD, "-j", "1", "-o", path],
        "sweep": ["sweep", sweep, "-j", "1", "-o", path],
        "modes": ["modes", SCENE, "-j", "1", "-o", path],
        "compare": ["compare", data, "--scene", SCENE, "-o", path.parent],
    }
    calls: dict[str, Callable[[], object]] = {
        "reproduce": lambda: reproduce.reproduce(path, workers=0, timeout_s=60.0),
        "save of runs": lambda: rm.open(files / "results.h5").save(path),
        "save of a sweep": lambda: rm.open(files / "s.h5").save(path),
        "save of modes": lambda: rm.modes(SCENE).save(path),
        "save of a comparison": lambda: rm.compare(data, SCENE).save(path),
        "datasets of a sweep": lambda: write_splits(files / "s.h5", path.parent),
    }
    if command in calls:
        if command == "reproduce":  # of one scene that takes no time
            monkeypatch.setattr(reproduce, "find_scenes", lambda _: find_scenes([SCENE]))
            monkeypatch.setattr(reproduce, "default_methods", lambda: (METHOD,))
            monkeypatch.setattr(reproduce, "errata_methods", dict)
            monkeypatch.setattr(reproduce, "short_curves", lambda _: [])
        try:
            calls[command]()
        except RotorError as refusal:
            return str(refusal)
        return ""
    ended = rotor_mbs(*lines[command])
    assert ended.status in (0, 2), ended
    return ended.err.splitlines()[-1] if ended.status else ""


def stored(path: Path) -> dict[str, object]:
    """All that a file holds of the scene that no command computes, and of a sweep."""
    found: dict[str, object] = {}

    def note(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and (
            name.startswith(("modes/", "comparison/")) or "/" not in name
        ):
            found[name] = np.asarray(item[()]).tobytes()

    with h5py.File(path) as file:
        file.visititems(note)
        names = [name for name in ("runs", "bench", "stability") if name in file]
    tables = TableFile(path) if names else None
    for group in names:
        assert tables is not None
        for run, known in tables.tables[group].known_rows.items():
            place = tables.place(run, group)
            if known["scene"] == OTHER and place.is_stored:
                found |= {
                    f"{group} {run} {name}": values.tobytes()
                    for name, values in place.read().items()
                }
    # has the row's number
    return {name: content for name, content in found.items() if not name.endswith("crc32")}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "command",
    [pytest.param(name, marks=() if name in _QUICK else pytest.mark.full) for name in EXTENDS],
)
def test_a_command_extends_its_own_kind_and_leaves_every_other(
    command: str,
    kind: str,
    folder: Path,
    files: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    names = {"compare": "comparison.h5", "datasets of a sweep": "train.h5"}
    path = tmp_path / names.get(command, "file.h5")
    before = (folder / kind).read_bytes()
    path.write_bytes(before)
    line = answer(command, path, files, monkeypatch)
    if kind in EXTENDS[command]:
        assert line == ""
        earlier, now = stored(folder / kind), stored(path)
        assert earlier
        if not kind.startswith("unfinished sweep"):  # whose missing run is there now
            assert {name: now.get(name) for name in earlier} == earlier
    else:
        assert line.startswith(f"{path}: ")
        assert "\n" not in line
        assert path.read_bytes() == before


def test_the_documentation_has_the_same_table() -> None:
    text = (Path(__file__).parents[2] / "docs" / "data.md").read_text()
    heads, _, *rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.partition("## What a command writes to")[2].partition("##")[0].splitlines()
        if line.startswith("|")
    ]
    extended = {
        row[0]: {kind for kind, cell in zip(heads[1:], row[1:], strict=True) if cell == "extends"}
        for row in rows
    }
    told = {
        "`run`, `reference`, `bench`, `stability`, `reproduce`": "run",
        "`sweep`": "sweep",
        "`sweep --datasets`": "datasets of a sweep",
        "`modes`, `.save` of modes": "modes",
        "`compare`, `.save` of a comparison": "compare",
        "`.save` of runs of a sweep": "save of a sweep",
    }
    for written_by, command in told.items():
        assert extended.pop(written_by) == EXTENDS[command] & {*heads}
    assert extended == {"`.save` of runs of scenes": {"results"}}  # the test of copies


@pytest.mark.parametrize("command", ["run", "sweep", "modes", "compare", "save of runs"])
def test_an_empty_file_is_a_new_one(
    command: str, files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / ("comparison.h5" if command == "compare" else "file.h5")
    path.touch()
    assert answer(command, path, files, monkeypatch) == ""
    assert h5py.is_hdf5(path)


def test_a_copy_of_runs_replaces_one_with_the_same_runs(files: Path, tmp_path: Path) -> None:
    """A script that is called again; runs that the copy does not have are not lost."""
    target = tmp_path / "copy.h5"
    runs = rm.open(files / "results.h5")
    for _ in range(2):
        assert runs.save(target).read_bytes() == runs.path.read_bytes()
    results_file(target, [SCENE], ["lagrange/ode45"])
    before = target.read_bytes()
    with pytest.raises(
        rm.InputError, match="has runs: check/held/lagrange/ode45, which would be lost"
    ):
        runs.save(target)
    assert target.read_bytes() == before
