"""Values of arguments that nothing can have: one line, status 2, and nothing is written."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.commands import refusal

NUL, LONG, DIGITS, MANY_DIGITS = "a\0b", "x" * 10_000, "9" * 400, "9" * 5000
QUICK = ("run", "paper/fig03", "-m", "lagrange/taylor")
COMMANDS = [
    (*QUICK, "--set", f"tolerance={DIGITS}"),
    (*QUICK, "--set", f"tolerance={MANY_DIGITS}"),
    (*QUICK, "--timeout", DIGITS),
    (*QUICK, "-j", MANY_DIGITS),
    (*QUICK, "-o", NUL),
    (*QUICK, "-o", LONG),
    ("run", f"{NUL}.toml"),
    ("run", f"{LONG}.toml"),
    ("run", "a\ud800b.toml"),
    ("run", LONG),
    ("run", "paper/fig03", "-m", LONG),
    ("run", "paper/fig03", "-m", f"{NUL}.py"),
    ("run", "paper/fig03", "-m", f"{LONG}.py"),
    ("sweep", NUL),
    ("sweep", LONG),
    ("sweep", "sweeps/learning", "--part", f"{DIGITS}/{DIGITS}", "--dry-run"),
    ("sweep", "sweeps/learning", "--part", f"{MANY_DIGITS}/{MANY_DIGITS}", "--dry-run"),
    ("modes", "paper/fig03", "--speeds", "0:1e-320:3"),
    ("modes", "paper/fig03", "--speeds", f"0:1:{MANY_DIGITS}"),
    ("bench", "paper/fig03", "--repeats", MANY_DIGITS),
    ("compare", "data.csv", "--scene", NUL),
    ("compare", NUL, "--scene", "paper/fig03"),
    ("compare", LONG, "--scene", "paper/fig03"),
    ("compare", "data.csv", "--scene", "paper/fig03", "--columns", NUL),
    ("report", NUL),
    ("check", LONG),
    ("check", "--bounds", LONG, "x.h5"),
    ("figures", NUL),
    ("animate", LONG, "x.h5"),
    ("export", "paper/fig03", "--to", "mjcf", "-o", LONG),
    ("new", NUL),
    ("reproduce", "-o", NUL),
    (LONG,),
]


@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: " ".join(word[:20] for word in words))
def test_a_value_that_nothing_can_have_is_a_line(words: tuple[str, ...], folder: Path) -> None:
    assert len(refusal(*words)) < 1000
    assert list(folder.iterdir()) == []


@pytest.mark.usefixtures("folder")
def test_limits_of_speeds_are_in_the_unit_that_is_given() -> None:
    """A rad/s is 30/π = 9.549 rpm."""
    assert "1e-25 to 1e+25 rad/s; see" in refusal("modes", "paper/fig03", "--speeds", "0:1e30:3")
    in_rpm = refusal("modes", "paper/fig03", "--rpm", "0:1e30:3")
    assert "1e-25 to 1e+25 rad/s (9.55e-25 to 9.55e+25 rpm)" in in_rpm


@pytest.mark.usefixtures("folder")
def test_list_says_what_shows_a_file() -> None:
    assert "allowed: none, or rotor-mbs show my.h5 (a file, scene" in refusal("list", "my.h5")


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    "words",
    [
        ("modes", "paper/fig03", "--speeds", "-1:3"),
        ("compare", "data.csv", "--scene", "paper/fig03", "--tolerance", "-1e-6"),
        ("run", "paper/fig03", "--timeout", "-.5e1"),
    ],
)
def test_a_negative_number_is_a_value_and_no_option(words: tuple[str, ...]) -> None:
    assert f"{words[-2]}: '{words[-1]}' given, allowed: " in refusal(*words)


@pytest.mark.parametrize("path", ["/", "..", "", "sweeps"])
def test_a_path_that_is_no_sweep_is_a_line(path: str, folder: Path) -> None:
    """Their workers are started before the file is read."""
    assert "allowed: " in refusal("sweep", path, "--dry-run", "-j", "1")
    assert list(folder.iterdir()) == []
