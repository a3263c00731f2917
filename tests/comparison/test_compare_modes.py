"""Tables of frequencies over rotor speed: right ones are ok, wrong units and missing stiffening are
named."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.commands import rotor_mbs

import rotor_mbs as rm
from rotor_mbs.api.comparisons import DataComparison
from rotor_mbs.studies.modes import compute_modes

Array = Any
pytestmark = pytest.mark.usefixtures("files_read_here")

SPEEDS = np.linspace(0.0, 3.0, 5)
DAMPED, SPRUNG, UNEQUAL = "stiff/nrel-5mw-damped", "stiff/nrel-5mw", "check/general"


@functools.cache
def tables(name: str) -> tuple[Array, Array]:
    """(speeds, modes) damped and undamped frequencies by Exudyn's linearization of its own model,
    rad/s."""
    scene = rm.scene(name).replace(gravity=0.0)
    modes = compute_modes(scene, SPEEDS, models=("exudyn_tree",)).rotation["exudyn_tree"]
    return modes.damped_frequencies, modes.undamped_frequencies


def compare(
    name: str, frequencies: Array, speeds: Array = SPEEDS, key: str = "frequencies"
) -> DataComparison:
    return rm.compare({"speed": speeds, key: frequencies}, name)


@pytest.mark.parametrize("name", [SPRUNG, DAMPED, UNEQUAL])
def test_right_frequencies_of_another_engine_are_ok(name: str) -> None:
    damped, undamped = tables(name)
    order = np.argsort(damped[:, 1:], axis=1)  # by size, without the rotor's own zero
    for found in (
        compare(name, damped), compare(name, np.take_along_axis(damped[:, 1:], order, 1)),
        compare(name, undamped, key="undamped_frequencies"),
    ):  # fmt: skip
        assert (found.status, found.message, found.likely) == ("ok", "", ())
    # Exudyn's difference quotients; a hundredth of a percent is seen.
    assert max(channel.defect or 0.0 for channel in compare(name, damped).verdict.channels) < 1e-8
    assert compare(name, damped * 1.0001).status == "inaccurate"


MISTAKES: dict[str, tuple[str, Callable[[Array, Array], tuple[Array, Array]], str]] = {
    "Hz": (SPRUNG, lambda f, _: (SPEEDS, f / (2.0 * math.pi)), "frequencies in Hz taken as rad/s"),
    "per minute": (
        SPRUNG,
        lambda f, _: (SPEEDS, f * 30.0 / math.pi),
        "frequencies in rpm taken as rad/s",
    ),
    "rpm": (UNEQUAL, lambda f, _: (SPEEDS * 30.0 / math.pi, f), "speeds in rpm taken as rad/s"),
    "rpm and Hz": (
        UNEQUAL,
        lambda f, _: (SPEEDS * 30.0 / math.pi, f / (2.0 * math.pi)),
        "frequencies in Hz taken as rad/s; and speeds in rpm taken as rad/s",
    ),
    "undamped": (DAMPED, lambda _, u: (SPEEDS, u), "undamped frequencies"),
    "whirl": (
        UNEQUAL,
        lambda f, _: (SPEEDS, np.abs(f[:, 1:] - SPEEDS[:, None])),
        (
            "frequencies in the fixed frame (whirl), the rotor's speed below or above those in the "
            "rotor's frame"
        ),
    ),
    "unequal blades, softened": (
        UNEQUAL,
        lambda _, u: (SPEEDS, np.sqrt(u[:1, 1:] ** 2 - 0.4 * SPEEDS[:, None] ** 2)),
        "centrifugal stiffening is missing: f² = f0² - α Ω², α = 0.4",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_named(mistake: str) -> None:
    name, change, text = MISTAKES[mistake]
    speeds, frequencies = change(*tables(name))
    found = compare(name, frequencies, speeds)
    assert found.status == "inaccurate"
    assert found.likely[0].startswith(text), found.likely
    assert len(found.likely) == 1


def test_what_nothing_explains_has_no_cause() -> None:
    damped, _ = tables(UNEQUAL)
    for wrong in (1.01 * damped, damped * np.linspace(1.0, 1.01, len(SPEEDS))[:, None]):
        assert compare(UNEQUAL, wrong).likely == ()


def test_the_command_reads_a_table_in_rpm_and_hz_and_few_digits(tmp_path: Path) -> None:
    """Rows in any order; a mapping with omit."""
    damped, _ = tables(UNEQUAL)
    rows = np.column_stack([SPEEDS * 30.0 / math.pi, damped[:, 1:] / (2.0 * math.pi)])[::-1]
    page, data = tmp_path / "page" / "index.html", tmp_path / "modes.csv"
    call = ["compare", data, "--scene", UNEQUAL, "-o", page.parent]
    decimals = ["%.17g", "%.4f", "%.4f", "%.4f"]
    for digits, factor, status in ((decimals, 1.0, 0), ("%.17g", 1.001, 1)):
        head = "speed [rpm],f1 [Hz],f2 [Hz],freq_3_Hz"
        np.savetxt(data, rows * [1.0, factor, 1.0, 1.0], digits, ",", header=head, comments="")
        ended, shown, _ = rotor_mbs(*call)
        assert ended == status
        assert "frequency 3 = 'freq_3_Hz' [hz]" in shown
        assert "horizon" not in shown
        assert ("rounding error" in shown) == (digits == decimals)
        assert ("inaccurate" in page.read_text()) == (status == 1)
    (tmp_path / "map.toml").write_text('omit = ["frequency_1"]\n')
    assert '"axis": "speed"' in rotor_mbs(*call, "--columns", tmp_path / "map.toml", "--json").out


def test_the_programs_own_file_of_modes_is_data_too(tmp_path: Path) -> None:
    scene = rm.scene(UNEQUAL).replace(gravity=0.0)
    rm.modes(scene, speeds=SPEEDS).save(tmp_path / "modes.h5")
    mapping = {"group": "exudyn_tree/rotation", "omit": ["undamped_frequency"]}
    found = rm.compare(tmp_path / "modes.h5", scene, columns=mapping)
    assert (found.status, len(found.verdict.channels)) == ("ok", 4)


def test_a_single_speed_and_rest() -> None:
    damped, _ = tables(UNEQUAL)
    assert compare(UNEQUAL, damped[-1:], SPEEDS[-1:]).status == "ok"
    rest = compute_modes(rm.scene(UNEQUAL), models=("exudyn_tree",)).rest["exudyn_tree"]
    assert compare(UNEQUAL, rest.damped_frequencies, np.zeros(1)).status == "ok"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"speed": [0.0, 1.0, 1.0], "f1": [1.0, 2.0, 3.0]}, "one that repeats"),
        ({"speed": [-1.0, 1.0], "f1": [1.0, 2.0]}, "a speed below 0"),
        ({"speed": [0.0, 1.0], "f1": [1.0, np.nan]}, "'f1' is nan in row 2"),
        ({"speed": [0.0, 1.0], "other": [1.0, 2.0]}, "no column for the time"),
        ({"speed": [0.0, 1.0], **{f"f{i}": [1.0, 2.0] for i in range(1, 5)}, "undamped frequency 1": [1.0, 2.0]},
         "damped and undamped frequencies in one table"),
        ({"speed [kg]": [0.0, 1.0], "f1": [1.0, 2.0]}, "'kg'; allowed: rad/s"),
    ],
)  # fmt: skip
def test_wrong_tables_are_refused(data: dict[str, Array], message: str) -> None:
    with pytest.raises(rm.InputError, match=message):
        rm.compare(data, UNEQUAL)
