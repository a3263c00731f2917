"""What files, scenes, runs and long calls tell of themselves: `show FILE`, `rotor_mbs.open`, reprs,
progress."""

from __future__ import annotations

import io
import json
import os
import shutil
import sys
import types
from collections.abc import Callable, Collection
from pathlib import Path

import h5py
import numpy as np
import pytest
from support.commands import refusal, rotor_mbs
from support.scenes import paper
from support.stored import Made, rotor, store

import rotor_mbs as rm
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.runs import progress, table, untrusted
from rotor_mbs.runs.hdf5 import TableSpec
from rotor_mbs.runs.runner import RunOutcome
from rotor_mbs.runs.trailer import Trailer
from rotor_mbs.studies import check

SHORT = {"duration": 0.5, "samples": 26}
SCREEN = (140, 50)  # characters in a line, lines
METHOD = "lagrange/dop853"


@pytest.fixture(scope="module")
def scene() -> rm.Scene:
    return rm.scene("paper/fig08").replace(**SHORT)


@pytest.fixture(scope="module")
def files(scene: rm.Scene, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A file of every kind."""
    folder = tmp_path_factory.mktemp("files")
    data = {"time": np.linspace(0.0, 0.5, 26), "rotor": np.zeros(26)}
    curve = rotor(np.sin, np.cos, np.sin, np.cos)
    two = [
        Made(paper(name, samples=51), method, curve)
        for name in ("fig08", "fig11")
        for method in ("reference", METHOD)
    ]
    many = []
    for name in (f"fig{number}" for number in ("08", "09", "11", "12", "13b", "14a")):
        many += [Made(paper(name, samples=3), method, curve) for method in ("reference", *SEVEN)]
    rm.run(scene, [METHOD]).save(folder / "one.h5")
    rm.sweep(
        scene,
        {"bearing.stiffness": [0.0, 10.0]},
        methods=METHOD,
        samples=5,
        output=folder / "sweep.h5",
    )
    rm.modes(scene, [0.0, 1.0]).save(folder / "modes.h5")
    rm.compare(data, scene, columns={"omit": ["pitch_1", "pitch_2", "pitch_3"]}).save(
        folder / "comparison.h5"
    )
    return {
        **{path.stem: path for path in folder.iterdir() if path.suffix == ".h5"},
        "two": store(folder / "two.h5", two),
        "many": store(folder / "many.h5", many),
    }


SEVEN = (
    "printed/ode45",
    "printed_e1/ode45",
    "lagrange/taylor",
    "lagrange/ode45",
    METHOD,
    "exudyn_tree/rk67",
    "exudyn_chain/extrapolated",
)


def fits(text: str) -> bool:
    lines = text.splitlines()
    return len(lines) <= SCREEN[1] and max(map(len, lines)) <= SCREEN[0]


@pytest.mark.parametrize(
    ("name", "parts"),
    {
        "one": (
            "results",
            "paper/fig08",
            METHOD,
            "angles, rates, tip, energy",
            "1 ok",
            "rotor-mbs check",
            "0.5",
        ),
        "two": ("results", "paper/fig08, paper/fig11", METHOD),
        "sweep": ("sweep", "bearing.stiffness  N m/rad  0     10  2", "2 ok", METHOD),
        "modes": (
            "modes",
            "lagrange, exudyn_tree, exudyn_chain",
            "damped (Hz)",
            "modes differ by at most",
        ),
        "comparison": (
            "comparison",
            "data/trajectory  paper/fig08, changed: duration  26    0.5",
            "1e-06",
        ),
    }.items(),
)
def test_show_tells_what_is_in_a_file_and_what_to_do_next(
    name: str, parts: tuple[str, ...], files: dict[str, Path]
) -> None:
    shown = rotor_mbs("show", files[name])
    assert (shown.status, shown.err) == (0, "")
    for part in (
        *parts,
        f"rotor_mbs {rm.__version__}",
        f"rotor-mbs report {files[name]}",
        "rm.open(",
    ):
        assert part in shown.out, part
    assert fits(shown.out)
    facts = json.loads(rotor_mbs("show", files[name], "--json").out)
    assert facts["kind"] == parts[0]
    assert facts["bytes"] == files[name].stat().st_size
    assert facts["made_with"]["rotor_mbs"] == rm.__version__


def test_show_as_json_has_the_rows_of_a_file_in_its_order(tmp_path: Path) -> None:
    """For programs that read no texts of HDF5; a row that is not computed yet counts, too."""
    curve = rotor(np.sin, np.cos, np.sin, np.cos)
    made = [
        Made(paper(name, samples=3), method, curve)
        for name in ("fig11", "fig12")
        for method in ("exudyn_tree/rk67", METHOD, "printed/ode45")
        if (name, method) != ("fig11", METHOD)
    ]
    path = store(tmp_path / "r.h5", made)
    table.TableFile(path).place("paper/fig12/printed/ode45").mark_missing([0])
    with h5py.File(path) as file:
        rows = file["runs/run"].asstr()[:].tolist()
        scenes = {}
        for name in ("paper/fig11", "paper/fig12"):
            scenes[name] = file[name]["run"].asstr()[:].tolist()
    shown = json.loads(rotor_mbs("show", path, "--json").out)["runs"]
    assert shown == rows
    assert len(shown) == 5
    for name, methods in scenes.items():
        assert [row for row in shown if row.startswith(f"{name}/")] == [
            f"{name}/{method}" for method in methods
        ]


def test_a_run_of_a_sweep_does_not_say_up_to_when_it_was_compared(
    files: dict[str, Path],
) -> None:
    """Its predicted error has a limit; it has no horizon, and nothing follows the last word."""
    run = rm.open(files["sweep"])[0]
    (line,) = [line for line in repr(run).splitlines() if "angle error" in line]
    assert line.endswith("predicted, limit 0.01")
    assert "compared to" not in run._repr_html_()


def test_the_headline_of_runs_does_not_read_as_a_value_of_what_was_changed(
    scene: rm.Scene,
) -> None:
    headline = repr(rm.run(scene, [METHOD])).splitlines()[0]
    assert headline == "paper/fig08, changed: duration; 2 runs: 2 ok"


def test_show_of_runs_that_are_not_ok_has_their_reasons(tmp_path: Path) -> None:
    failed = {"status": "solver_failed", "message": "the step became too small"}
    made = [
        Made(
            paper("fig08", samples=11),
            METHOD,
            rotor(np.sin, np.cos, np.sin, np.cos),
            attributes=failed,
        )
    ]
    out = rotor_mbs("show", store(tmp_path / "r.h5", made)).out
    assert f"paper/fig08 {METHOD} solver_failed: the step became too small" in out


def test_show_suggests_check_only_where_it_has_something_to_check(tmp_path: Path) -> None:
    """As of a bench, or the stability suite, whose only runs are the references."""
    curve = rotor(np.sin, np.cos, np.sin, np.cos)
    path = store(tmp_path / "bench.h5", [Made(paper("fig08", samples=3), "reference", curve)])
    shown = json.loads(rotor_mbs("show", path, "--json").out)
    assert shown["next"] == [f"rotor-mbs report {path}", f'rm.open("{path}")']


def test_show_of_a_file_that_is_none(tmp_path: Path) -> None:
    assert "no such file" in refusal("show", tmp_path / "missing.h5")
    (tmp_path / "other.h5").write_bytes(b"x" * 100)
    assert "not an HDF5 file" in refusal("show", tmp_path / "other.h5")


def test_show_of_a_method_file_lists_its_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text((Path(__file__).parent / "extension" / "rotor_rk4.py").read_text())
    out = rotor_mbs("show", "mine.py").out
    assert "rotor-mbs run SCENE -m" in out


def test_what_was_saved_is_opened(scene: rm.Scene, files: dict[str, Path]) -> None:
    runs = rm.open(files["one"])
    assert list(runs) == ["reference", METHOD]
    assert (
        runs[f"paper/fig08/{METHOD}"].status
        == runs["paper/fig08"][METHOD].status
        == runs[METHOD].status
        == "ok"
    )
    assert list(rm.open(files["two"])) == [
        f"paper/{name}/{m}" for name in ("fig08", "fig11") for m in ("reference", METHOD)
    ]
    modes = rm.open(files["modes"])
    assert modes.agrees
    np.testing.assert_array_equal(
        modes.rotation["lagrange"].eigenvalues,
        rm.modes(scene, [0.0, 1.0]).rotation["lagrange"].eigenvalues,
    )
    comparison = rm.open(files["comparison"])
    assert comparison.verdict.rows == 26
    errors = [channel.error_max for channel in comparison.verdict.channels]
    assert comparison.table().error_max.tolist() == errors
    assert rm.open(files["sweep"]).statuses == {"ok": 2}


def test_a_file_is_opened_once_and_a_run_reads_its_scene_alone(
    files: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[list[str]] = []
    read = table.read_groups

    def counted(
        path: Path, kinds: Collection[str], only: Collection[str] | None = None
    ) -> tuple[dict[str, TableSpec], Trailer]:
        groups, trailer = read(path, kinds, only)
        opened.append([name for name in groups if name])
        return groups, trailer

    path = Path(shutil.copy(files["many"], tmp_path / "many.h5"))
    os.utime(path, (1e9, 1e9))  # long ago
    monkeypatch.setattr(table, "read_groups", counted)
    runs = rm.open(path)
    assert [groups for groups in opened if groups] == [["runs"]]
    opened.clear()
    label = f"paper/fig11/{METHOD}"
    first = runs[label].angles
    assert opened == [["paper/fig11"]]
    np.testing.assert_array_equal(runs[label].angles, first)
    assert [run.status for run in runs["paper/fig11"].values()] == ["ok"] * 8
    assert [groups for groups in opened if groups] == [["paper/fig11"]]
    # Another file in its place is seen.
    Path(shutil.copy(files["one"], tmp_path / "other.h5")).replace(path)
    with pytest.raises(
        rm.StoreError, match=f"has no {label} any more: another file has taken its place"
    ):
        _ = runs[label]


def test_tables_of_a_file_are_kept_by_the_path_as_it_is_given(
    files: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A message has the path that was asked for, and what one caller adds or removes is not
    another's."""
    path = Path(shutil.copy(files["one"], tmp_path / "one.h5"))
    os.utime(path, (1e9, 1e9))  # long ago
    first = table.opened_tables(path)
    monkeypatch.chdir(tmp_path)
    assert {stored.path for stored in table.opened_tables(Path("one.h5")).tables.values()} == {
        Path("one.h5")
    }
    first.tables.clear()
    assert {stored.path for stored in table.opened_tables(path).tables.values()} == {path}


def test_a_sweep_has_no_scene_of_a_label(files: dict[str, Path]) -> None:
    with pytest.raises(KeyError, match=r"'paper/fig08'; available: 0, 1"):
        _ = rm.open(files["sweep"])["paper/fig08"]


def test_the_short_table_of_a_scene_is_of_its_own_runs(
    files: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where it has so many that it is one of methods."""
    monkeypatch.setattr("rotor_mbs.api.results.MOST_ROWS", 1)
    runs = rm.open(files["many"])
    assert f"{METHOD}  " in repr(runs)
    assert "6 of 6 ok" in repr(runs)
    assert "1 of 1 ok" in repr(runs["paper/fig11"])
    assert "6 of 6" not in repr(runs["paper/fig11"])


def test_each_command_that_reads_a_file_prepares_it(
    files: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process that reads is started before the command's own code is loaded; a scene needs
    none."""
    prepared: list[str] = []
    monkeypatch.setattr(untrusted, "prepare_reading", lambda: prepared.append("once"))
    for words, count in (
        (["show", files["one"]], 1),
        (["check", files["one"]], 2),
        (["show", "paper/fig08"], 2),
    ):
        assert rotor_mbs(*words).status == 0
        assert len(prepared) == count


def test_check_reads_the_scenes_of_a_file_once(
    files: dict[str, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[Path | None] = []
    scenes_checked = check.scenes_checked

    def noted(path: Path | None) -> dict[str, rm.Scene]:
        read.append(path)
        return scenes_checked(path)

    monkeypatch.setattr(check, "scenes_checked", noted)
    path = files["one"]
    assert rotor_mbs("check", path, "--against", path).status == 0
    assert read == [path, path]


def test_without_standard_error_a_progress_shows_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """As under pythonw on Windows, also where it is asked for."""
    monkeypatch.setattr(sys, "stderr", None)
    for asked in (None, True, False):
        with progress.progress_of_call(asked) as line:
            line.stage("pages", 1, 2)


def test_several_modes_and_comparisons_of_a_file_are_a_dict(tmp_path: Path) -> None:
    for name in ("paper/fig03", "paper/fig08"):
        rm.modes(name).save(tmp_path / "modes.h5")
    assert sorted(rm.open(tmp_path / "modes.h5")) == ["paper/fig03", "paper/fig08"]
    assert rm.open(tmp_path / "modes.h5")["paper/fig03"].scene == "paper/fig03"


def test_reprs_fit_a_screen_and_have_units(scene: rm.Scene, files: dict[str, Path]) -> None:
    blades = [
        {"mass": 10.0 + i, "centre_of_mass": [0.1, 0.0, 5.0], "tip": [0.0, 0.0, 9.0]}
        for i in range(9)
    ]
    large = rm.scene("paper/fig08").replace(
        blades=9, blade=blades, torque={"rotor": [[float(i), i + 0.5] for i in range(500)]},
        initial={"angles": [0.0] * 10, "rates": [0.0] * 10},
    )  # fmt: skip
    for shown in (scene, large):
        assert fits(repr(shown))
        assert "gravity, m/s^2" in repr(shown)
        assert "<td>m/s^2</td>" in shown._repr_html_()
    assert "... 494 more]" in repr(large)
    run = rm.open(files["one"])[METHOD]
    assert fits(repr(run))
    assert "angles (26, 4) rad, rates (26, 4) rad/s, tip (26, 3, 3) m" in " ".join(
        repr(run).split()
    )
    assert "rotor_angle_max 0 rad" in repr(run)
    assert "largest magnitude of a pitch angle" not in repr(run)
    assert " rad</td>" in run._repr_html_()
    for name in files:
        assert fits(repr(rm.open(files[name]))), name
    assert len(rm.open(files["many"])) == 48
    assert len(repr(rm.open(files["many"])).splitlines()) == 9  # a row for each method
    assert "damped (Hz)" in repr(rm.open(files["modes"]))


def test_plots_in_a_notebook_have_legends(files: dict[str, Path]) -> None:
    runs, modes, comparison = (rm.open(files[name]) for name in ("one", "modes", "comparison"))
    run = runs[METHOD]
    plots: list[tuple[Callable[[], rm.report.canvas.Panels], str]] = [
        (run.plot, "pitch 3"),
        (run.plot.energy, "kinetic"),
        (run.plot.tips, "blade 1"),
        (run.plot.error, "closed form"),
        (runs.plot, "closed form"),
        (runs.plot.rotor, "closed form"),
        (modes.plot, "collective pitch"),
        (modes.plot.damping, "sine pitch"),
        *([(modes.plot.multipliers, "largest")] if is_available() else []),
        (comparison.plot, "rotor"),
    ]
    for plot, label in plots:
        legend = plot().axes[0].get_legend()
        assert any(label in text.get_text() for text in legend.get_texts()), (plot, label)


# Progress


class Screen(io.StringIO):
    def isatty(self) -> bool:
        return True


CALLS: dict[str, Callable[[rm.Scene, bool | None], object]] = {
    "run": lambda scene, shown: rm.run(scene, [METHOD], progress=shown),
    "sweep": lambda scene, shown: rm.sweep(
        scene, {"gravity": [9.7, 9.8]}, methods=METHOD, samples=3, progress=shown
    ),
    "compare": lambda scene, shown: rm.compare(
        {"time": [0.0, 0.1, 0.2], "rotor": np.zeros(3)},
        scene,
        columns={"omit": ["pitch_1", "pitch_2", "pitch_3"]},
        progress=shown,
    ),
}
SEEN = {
    "run": f"[2/2] paper/fig08 {METHOD} ok",
    "sweep": "runs 2/2",
    "compare": "interval defects 1/4",
}


@pytest.mark.parametrize("name", CALLS)
def test_long_calls_show_their_progress_on_a_terminal_unless_silenced(
    name: str, scene: rm.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    for stream, asked, is_shown in (
        (Screen(), None, True), (Screen(), False, False), (io.StringIO(), None, False), (io.StringIO(), True, True),
    ):  # fmt: skip
        monkeypatch.setattr(sys, "stderr", stream)
        CALLS[name](scene, asked)
        assert (SEEN[name] in stream.getvalue()) == is_shown
        assert bool(stream.getvalue()) == is_shown


def test_a_notebook_shows_a_line_that_is_renewed(monkeypatch: pytest.MonkeyPatch) -> None:
    """By what IPython displays, without a kernel."""
    shown: list[str] = []

    class Handle:
        def update(self, data: dict[str, str], *, raw: bool) -> None:
            assert raw
            shown.append(data["text/plain"])

    def display(data: dict[str, str], *, raw: bool, display_id: bool) -> Handle:
        assert raw
        assert display_id
        shown.append(data["text/plain"])
        return Handle()

    module = types.ModuleType("IPython.display")
    module.display = display  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", types.ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", module)
    stream = type("OutStream", (io.StringIO,), {"__module__": "ipykernel.iostream"})()
    monkeypatch.setattr(sys, "stdout", stream)
    with progress.progress_of_call(None) as line:
        line(1, 4, RunOutcome("paper/fig05 a/b", "a/b", "ok", share=0.25))
        line(2, 4, RunOutcome("paper/fig05 a/c", "a/c", "diverged", "not finite", share=0.5))
        line.stage("pages", 1, 2)
    assert shown[0].startswith("starting")
    assert " 25%, about " in shown[1]
    assert shown[-1].startswith("done in ")
    assert stream.getvalue() == "[2/4] paper/fig05 a/c diverged: not finite\n"  # stays
    count = len(shown)
    with progress.progress_of_call(False) as line:
        line.stage("pages", 1, 2)
    assert len(shown) == count


def test_a_changed_scene_says_so_wherever_its_name_stands(tmp_path: Path) -> None:
    """In `show FILE`, in the tables of runs, in a sweep, in modes, in a comparison; each as it was
    stored."""
    label = "paper/fig08, changed: gravity"
    scene = rm.scene("paper/fig08").replace(gravity=9.0, samples=11)
    curve = rotor(np.sin, np.cos, np.sin, np.cos)
    other = Made(paper("fig11", samples=3), METHOD, curve)
    one = rm.open(store(tmp_path / "one.h5", [Made(scene, METHOD, curve)]))
    two = rm.open(store(tmp_path / "two.h5", [Made(scene, METHOD, curve), other]))
    assert repr(one).startswith(f"{label}; 1 run: ")
    assert repr(one[METHOD]).startswith(f"{label}: ")
    assert label in repr(two)
    sweep = tmp_path / "sweep.h5"
    rm.sweep(
        scene.replace(duration=0.1),
        {"bearing.stiffness": [0.0, 10.0]},
        methods=METHOD,
        samples=5,
        output=sweep,
    )
    modes = rm.modes(scene)
    modes.save(tmp_path / "modes.h5")
    assert repr(modes) == repr(rm.open(tmp_path / "modes.h5"))
    assert repr(modes).startswith(f"{label}: ")
    data = {"time": np.linspace(0.0, 0.5, 26), "rotor": np.zeros(26)}
    omitted = {"omit": ["pitch_1", "pitch_2", "pitch_3"]}
    rm.compare(data, scene, columns=omitted).save(tmp_path / "comparison.h5")
    assert f"26 rows against {label}" in repr(rm.open(tmp_path / "comparison.h5"))
    for path in tmp_path.glob("*.h5"):
        shown = rotor_mbs("show", path)
        assert "paper/fig08, changed: " in shown.out, path
