"""Sweep files: the rows of a design, and errors with file, line, key and what is allowed."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rotor_mbs.errors import InputError, PlausibilityWarning
from rotor_mbs.scenario.catalogue import SWEEPS, find_scenes, list_scenes
from rotor_mbs.scenario.sweep import Axis, Design, Range, Sweep, load_sweep, split_rows, sweep_of

_HEAD = 'title = "t"\nscene = "paper/fig11"\n'


def _load(folder: Path, text: str) -> Sweep:
    path = folder / "s.toml"
    path.write_text(_HEAD + text)
    return load_sweep(path)


def _design(axes: tuple[Axis, ...], **options: Any) -> Design:
    return Design(title="t", scene="paper/fig11", settings={}, change={}, axes=axes, **options)


def test_a_grid_runs_through_its_axes_the_last_one_fastest_and_zip_through_all_at_once() -> None:
    axes = (
        Axis("a", (1.0, 2.0)),
        Axis("b", linear=Range(0.0, 1.0, 3)),
        Axis("c", log=Range(1.0, 100.0, 3)),
    )
    design = _design(axes)
    expected = list(itertools.product([1.0, 2.0], [0.0, 0.5, 1.0], [1.0, 10.0, 100.0]))
    assert design.count == 18
    # log goes through a power: equal to round-off
    np.testing.assert_allclose(design.rows(0, 18), expected, rtol=1e-15)
    np.testing.assert_array_equal(design.rows(7, 11), design.rows(0, 18)[7:11])
    zipped = _design((Axis("a", (1.0, 2.0)), Axis("b", (3.0, 4.0))), combine="zip")
    np.testing.assert_array_equal(zipped.rows(0, 2), [[1.0, 3.0], [2.0, 4.0]])


def test_random_axes_are_drawn_together_by_their_seed_and_combined_with_the_others() -> None:
    axes = (Axis("a", (1.0, 2.0)), Axis("b", normal=(0.0, 1.0)), Axis("c", sobol=(5.0, 6.0)))
    rows = _design(axes, seed=7, draws=4).rows(0, 8)
    assert rows[:, 0].tolist() == [1.0] * 4 + [2.0] * 4
    np.testing.assert_array_equal(rows[:4, 1:], rows[4:, 1:])
    assert len(np.unique(rows[:4, 1])) == 4
    np.testing.assert_array_equal(rows, _design(axes, seed=7, draws=4).rows(0, 8))
    assert not np.isin(rows[:, 1:], _design(axes, seed=8, draws=4).rows(0, 8)).any()


def test_draws_have_the_distribution_that_was_asked_for() -> None:
    axes = (
        Axis("u", uniform=(2.0, 3.0)),
        Axis("n", normal=(2.0, 3.0)),
        Axis("s", sobol=(2.0, 3.0)),
    )
    uniform, normal, sobol = _design(axes, draws=4096).rows(0, 4096).T
    for values in (uniform, sobol):
        assert 2.0 <= values.min() < 2.01 < 2.99 < values.max() < 3.0
    # five standard errors of a mean of 4096 draws
    assert abs(uniform.mean() - 2.5) < 5.0 / math.sqrt(12.0 * 4096)
    assert abs(normal.mean() - 2.0) < 5.0 * 3.0 / 64.0
    assert abs(normal.std() - 3.0) < 5.0 * 3.0 / math.sqrt(2.0 * 4096)
    # a power of two of a Sobol sequence has exactly one point in each of as many equal intervals
    assert np.histogram(sobol, 4096, (2.0, 3.0))[0].tolist() == [1] * 4096


def test_the_shares_for_validation_and_test_are_exact_and_drawn() -> None:
    codes = split_rows(1000, 0.2, 0.1, 3)
    assert np.bincount(codes).tolist() == [700, 200, 100]
    assert len(set(codes[:200].tolist())) == 3
    assert (codes != split_rows(1000, 0.2, 0.1, 4)).any()
    np.testing.assert_array_equal(codes == 1, split_rows(1000, 0.2, 0.0, 3) == 1)


def test_no_draw_stands_in_two_splits() -> None:
    """Forty random starts at three stiffnesses; without the other axis every row is a draw."""
    random, other = "initial.angles[1]", "bearing.stiffness"
    scene = find_scenes(["paper/fig11"])[0]
    for order in ((random, other), (other, random)):
        axes = {random: {"uniform": [0.0, 1.0]}, other: [0.0, 1e3, 1e4]}
        design = sweep_of(
            scene, {key: axes[key] for key in order}, draws=40, validation=0.2, test=0.1
        ).design
        codes, starts = design.splits(), design.rows(0, design.count)[:, order.index(random)]
        assert np.bincount(codes).tolist() == [84, 24, 12]
        for start in np.unique(starts):
            assert len(set(codes[starts == start].tolist())) == 1
    alone = sweep_of(scene, {random: {"uniform": [0.0, 1.0]}}, draws=40, validation=0.2).design
    np.testing.assert_array_equal(alone.splits(), split_rows(40, 0.2, 0.0, 0))


def test_a_sweep_without_a_file_is_that_of_its_text(tmp_path: Path) -> None:
    scene = find_scenes(["paper/fig11"])[0]
    axes = {
        "gravity": [9.0, 10.0],
        "initial.angles[1]": {"linear": {"start": 0, "end": 1, "count": 3}},
    }
    made = sweep_of(scene, axes, samples=21, outputs=["angles"], validation=0.5)
    (tmp_path / "s.toml").write_text(made.file.text)
    read = load_sweep(tmp_path / "s.toml")
    assert (made.base, made.design, made.file.text) == (read.base, read.design, read.file.text)
    with pytest.raises(InputError, match=r"sweep:.*values"):
        sweep_of(scene, {"gravity": [float("nan")]})


def test_a_row_is_the_scene_with_its_numbers_in_place(tmp_path: Path) -> None:
    sweep = _load(
        tmp_path,
        'outputs = ["angles"]\nsamples = 11\nchange = {"gravity" = 1.5}\n'
        '[[axis]]\nkey = "bearing.stiffness"\nvalues = ["2*pi", 3]\n[[axis]]\n'
        'key = "initial.rates[0]"\nvalues = [0.5]\n'
        '[[axis]]\nkey = "blade[1].mass"\nvalues = [7]\n',
    )
    scene = sweep.variants().scene(sweep.design.rows(0, 1)[0].tolist())
    assert scene.bearing_stiffness == (2 * math.pi,) * 3
    assert (scene.initial_rates[0], scene.blades[1].mass, scene.blades[0].mass) == (
        0.5,
        7.0,
        15000.0,
    )
    assert (scene.gravity, scene.samples, sweep.base.gravity) == (1.5, 11, 1.5)
    assert scene.initial_angles == sweep.base.initial_angles
    assert sweep.units == ("N m/rad", "rad/s", "kg")


HUB = """title = "a hub"
scene = "paper/fig06"
outputs = {outputs}
[[axis]]
key = "hub.mass"
values = [0, 1e3]
"""


def test_a_key_of_the_loads_without_loads_is_doubted(tmp_path: Path) -> None:
    """The hub's weight is in the shaft's loads alone."""
    (tmp_path / "hub.toml").write_text(HUB.format(outputs='["angles"]'))
    with pytest.warns(PlausibilityWarning, match=r"hub\.mass: changes no run: it enters the loads"):
        load_sweep(tmp_path / "hub.toml")
    (tmp_path / "hub.toml").write_text(HUB.format(outputs='["angles", "loads"]'))
    load_sweep(tmp_path / "hub.toml")  # without a warning, which would be an error here


def test_a_scene_is_no_sweep(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(find_scenes(["paper/fig11"])[0].text)
    with pytest.raises(
        InputError,
        match=(
            r"scene\.toml: is a scene; allowed: a sweep, or: rotor-mbs run "
            r"\S+scene\.toml$"
        ),
    ):
        load_sweep(tmp_path / "scene.toml")


_BAD = {
    "no rows for training": (
        'validation = 0.5\ntest = 0.5\n[[axis]]\nkey = "gravity"\nvalues = [1, 2]',
        4,
        "test: .*no runs left for training; allowed: a number",
    ),
    "an unknown key of two values, reported once": (
        '[[axis]]\nkey = "initial.angels[1]"\nvalues = [1, 2]',
        4,
        r"^[^\n]*: initial\.angels: unknown key[^\n]*$",
    ),
    "no path": (
        '[[axis]]\nkey = "initial..x"\nvalues = [1]',
        4,
        "is not the path of a key; allowed",
    ),
    "another shape": (
        '[[axis]]\nkey = "blades"\nvalues = [1, 2]',
        4,
        "have the same blades; allowed",
    ),
    "random without draws": ('[[axis]]\nkey = "gravity"\nuniform = [1, 2]', 3, "draws is missing"),
    "a range upside down": (
        'draws = 3\n[[axis]]\nkey = "gravity"\nuniform = [2, 1]',
        6,
        "not below the second",
    ),
    "log to zero": (
        '[[axis]]\nkey = "gravity"\nlog = {start = 0, end = 1, count = 3}',
        5,
        "reaches 0 or less",
    ),
    "a key twice": (
        '[[axis]]\nkey = "gravity"\nvalues = [1]\n[[axis]]\nkey = "gravity"\nvalues = [1]',
        3,
        "more than one",
    ),
    "a value out of range": (
        '[[axis]]\nkey = "blade.mass"\nlinear = {start = 9, end = -9, count = 5}',
        5,
        r"axis\[0\]\.linear: .*above 0",
    ),
    "a value out of range in a list": (
        '[[axis]]\nkey = "blade.mass"\nvalues = [\n  9,\n  -9,\n]',
        7,
        r"axis\[0\]\.values\[1\]: .*above 0",
    ),
    "an unknown key beside a centre of mass, which is right": (
        '[[axis]]\nkey = "initial.angels[1]"\nvalues = [1, 2]\n'
        '[[axis]]\nkey = "blade.centre_of_mass[2]"\nvalues = [10, 11]',
        4,
        r"^[^\n]*axis\[0\]\.key: initial\.angels: unknown key[^\n]*$",
    ),
    "a value out of range beside a centre of mass, which is right": (
        '[[axis]]\nkey = "gravity"\nvalues = [1, -2]\n'
        '[[axis]]\nkey = "blade.centre_of_mass[2]"\nvalues = [10, 11]',
        5,
        r"^[^\n]*axis\[0\]\.values\[1\]: gravity = -2: [^\n]*$",
    ),
    "unequal lists zipped": (
        (
            'combine = "zip"\n[[axis]]\nkey = "gravity"\nvalues = [1]\n[[axis]]\nkey = '
            '"hub.inertia"\nvalues = [1, 2]'
        ),
        3,
        "gravity has 1, hub.inertia has 2; allowed: with zip",
    ),
    "1e12 runs": (
        '[[axis]]\nkey = "gravity"\nlinear = {start = 0, end = 1, count = 1000000000000}',
        3,
        "1,000,000,000,000 runs; allowed: at most",
    ),
}


@pytest.mark.parametrize(("text", "line", "message"), _BAD.values(), ids=list(_BAD))
def test_errors_name_file_line_key_and_what_is_allowed(
    tmp_path: Path, text: str, line: int, message: str
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        _load(tmp_path, text)
    for problem in caught.value.problems:
        assert problem.startswith(f"{tmp_path / 's.toml'}:")
        assert "\n" not in problem
        assert "allowed" in problem
    assert (
        int(caught.value.problems[0].removeprefix(f"{tmp_path / 's.toml'}:").split(":")[0]) == line
    )


@pytest.mark.parametrize("path", sorted(SWEEPS.glob("*.toml")), ids=lambda path: path.stem)
def test_shipped_sweeps_load_and_are_no_scenes(path: Path) -> None:
    assert load_sweep(Path("sweeps") / path.stem).design.count >= 100
    assert f"sweeps/{path.stem}" not in dict(list_scenes())
