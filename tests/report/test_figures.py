"""`figures`: files for a manuscript, from a results file alone; what it and `animate` do with bad input."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from support.scenes import paper
from support.stored import Made, rotor, store

from rotor_mbs.cli import main
from rotor_mbs.report.pages.figures import available, composed
from rotor_mbs.runs.read import open_results

RIGHT = rotor(lambda t: 0.5 + 0.1 * t, np.sin, np.cos)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    runs = []
    for name in ("fig11", "fig08", "fig09", "fig15-1kNm", "fig15-100kNm"):
        scene = paper(name, samples=101)
        runs += [Made(scene, method, RIGHT) for method in ("reference", "printed/ode45", "exudyn_tree/rk67")]
    return store(tmp_path_factory.mktemp("figures") / "r.h5", runs)


def test_every_figure_the_file_has_is_written(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["figures", str(results), "-o", str(tmp_path), "--format", "svg"]) == 0
    names = [f"fig{number:02d}.svg" for number in (8, 9, 10, 11, 13, 15, 16)]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
    assert capsys.readouterr().out.split() == [str(tmp_path / name) for name in names]
    head = (tmp_path / "fig11.svg").read_text(encoding="utf-8")[:2000]
    width = re.search(r'width="([\d.]+)pt"', head)
    assert width is not None
    assert float(width[1]) / 72 * 25.4 == pytest.approx(174.0, abs=0.01)  # two columns of a journal


@pytest.mark.parametrize(("kind", "start"), [("pdf", b"%PDF"), ("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_formats(results: Path, tmp_path: Path, kind: str, start: bytes) -> None:
    command = ["figures", str(results), "--format", kind, "--figure", "11", "-o"]
    assert main([*command, str(tmp_path / "a")]) == 0
    assert main([*command, str(tmp_path / "b")]) == 0
    content = (tmp_path / "a" / f"fig11.{kind}").read_bytes()
    assert content.startswith(start)
    assert content == (tmp_path / "b" / f"fig11.{kind}").read_bytes()
    assert [path.name for path in (tmp_path / "a").iterdir()] == [f"fig11.{kind}"]


def test_a_figure_shows_each_model_in_a_column_as_it_was_stored(results: Path) -> None:
    with open_results(results) as opened:
        figure = next(one for one in available(opened.scenes) if one.number == "11")
        panels = composed(figure, opened.scenes)
        run = opened.scenes["paper/fig11"].runs["printed/ode45"]
        time, angles, rates = run.array("time"), run.array("angles"), run.array("rates")
    assert len(panels.axes) == 6
    assert [axes.texts[0].get_text() for axes in panels.axes[:3]] == ["As printed", "Corrected model", "Exudyn"]
    for axes, values in ((panels.axes[0], angles), (panels.axes[3], rates)):
        for column in range(4):
            np.testing.assert_array_equal(
                axes.get_lines()[column].get_xydata(), np.column_stack([time, values[:, column]])
            )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["figures", "--figure", "2", "-o", "out"], "figure 2: not in it; allowed: 8, 9"),
        (["figures", "--figure", "../11", "-o", "out"], "figure ../11: not in it"),
        (["figures", "--results", "none.h5", "-o", "out"], "none.h5: no such file"),
        (["animate", "paper/fig12", "-o", "a.webp"], "'paper/fig12': no such scene in it; allowed: paper/fig08"),
        (["animate", "folder/mine.toml", "-o", "a.webp"], "'mine': no such scene in it"),  # stored by its stem
        (["animate", "../fig11", "-o", "a.webp"], "no such scene"),
        (["animate", "paper/fig11", "-o", "a.avi"], "unknown kind of file .avi; allowed: .webp, .gif, .mp4"),
        (["animate", "paper/fig11", "-o", "a.webp", "--results", "none.h5"], "no such file"),
    ],
)
def test_bad_input_is_one_line_and_status_2(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    arguments: list[str], message: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main([arguments[0], "--results", str(results), *arguments[1:]]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", [["figures"], ["animate", "paper/fig11"], ["report"]])
@pytest.mark.parametrize("fault", ["truncated", "foreign", "no HDF5"])
def test_a_damaged_or_foreign_file_is_refused_and_nothing_is_written(
    results: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: list[str], fault: str
) -> None:
    path, output = tmp_path / "bad.h5", tmp_path / "out.webp"
    if fault == "truncated":
        path.write_bytes(results.read_bytes()[: results.stat().st_size // 2])
    elif fault == "foreign":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            file["data"] = np.arange(3.0)
    else:
        path.write_text("<script>alert(1)</script>")
    assert main([*command, str(path), "-o", str(output)]) == 2
    error = capsys.readouterr().err
    assert str(path) in error
    assert error.count("\n") == 1
    assert sorted(tmp_path.iterdir()) == [path]
