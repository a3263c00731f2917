"""What drives a scene, on its page: torque and power, pitches with their commands, the actuators' power."""

from __future__ import annotations

import re
from pathlib import Path

from support.checking import results_file

from rotor_mbs.report.build import write_report


def drive_of(folder: Path, scene: str) -> str:
    """The section of the page of a scene, of which the file has the reference alone; "" where there is none."""
    pages = write_report(results_file(folder / "r.h5", [scene], []), folder / "out").parent
    page = (pages / f"{scene.replace('/', '-')}.html").read_text(encoding="utf-8")
    found = re.search(r'<section id="drive">(.*?)</section>', page, re.S)
    return found[1] if found else ""


def test_the_page_of_a_turbine_scene_shows_power_pitch_and_command(tmp_path: Path) -> None:
    section = drive_of(tmp_path, "turbine/pitch-step")
    assert section.count("<figure>") == 2
    for piece in (
        "taken by the shaft&#39;s damper",
        "command",
        "power up to 5.3",
        "Pitches, their commands",
        "pitch 3",
    ):
        assert piece in section, piece
    # 5.297 MW over 6 s
    assert re.search(r"work 31\.8\sMJ", section)


def test_a_scene_that_nothing_drives_has_no_such_section(tmp_path: Path) -> None:
    assert drive_of(tmp_path, "paper/fig04b") == ""
