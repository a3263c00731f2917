"""Output in any encoding, and to nobody: every command prints to the end and does all its work."""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from support.commands import PROGRAM

import rotor_mbs as rm
from rotor_mbs.cli import main

ENCODINGS = ("ascii", "cp1252", "latin-1")
COMMANDS = (
    "list",
    "list --json",
    "show exudyn_tree/generalized_alpha",
    "show lagrange/dop853 --json",
    "show paper/fig11 --build",
    "show paper/fig11 --json",
    "check {results} --verbose",
    "run paper/fig99",
    "new {folder}/a.txt",
    pytest.param("report {results} -o {folder}/pages", marks=pytest.mark.full),
    pytest.param("modes check/general -o {folder}/m.h5 -j 1", marks=pytest.mark.full),
    pytest.param(
        "stability extreme/passage-1e-3 -m mujoco/rk4 -o {folder}/s.h5 -j 1", marks=pytest.mark.full
    ),
    pytest.param("compare {data} --scene paper/fig08 -o {folder}/c", marks=pytest.mark.full),
    pytest.param("compare {data} --scene paper/fig08 --json -o {folder}/c", marks=pytest.mark.full),
)


def printed(words: list[str], encoding: str) -> tuple[int, str, str]:
    """Exit status, standard output and standard error of a command whose streams have an
    encoding."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding=encoding, newline="\n") for _ in range(2))
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main(words)
    texts = []
    for stream in (out, err):
        assert stream.errors == "strict"  # as it was
        stream.flush()
        texts.append(stream.buffer.getvalue().decode(encoding))  # type: ignore[attr-defined]
    return status, texts[0], texts[1]


@pytest.fixture
def data(results: Path, folder: Path) -> Path:
    """A run of a results file whose pitches are in degrees, two of them wrong."""
    angles = rm.open(results)["paper/fig08/lagrange/dop853"].angles
    degrees = np.degrees(angles)
    degrees[:, 1:] += 1.0
    time = np.linspace(0.0, rm.scene("paper/fig08").duration, len(degrees))
    path = folder / "data.csv"
    names = ["time (s)", "rotor (°)", *(f"pitch {i} (°)" for i in range(1, degrees.shape[1]))]
    np.savetxt(
        path,
        np.column_stack([time, degrees]),
        delimiter=",",
        header=",".join(names),
        comments="",
        encoding="utf-8",
    )
    return path


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_prints_to_the_end_in_any_encoding(
    command: str, results: Path, data: Path, folder: Path
) -> None:
    words = command.format(results=results, data=data, folder=folder).split()
    status, out, err = printed(words, "utf-8")
    is_quick = words[0] in ("list", "show", "check", "new")
    for encoding in ENCODINGS if is_quick else ENCODINGS[:1]:  # the one that lacks most
        ended = printed(words, encoding)
        assert ended[0] == status
        if "--json" in words:
            assert json.loads(ended[1]) == json.loads(out)
        elif is_quick:  # others print times
            for text, expected in zip(ended[1:], (out, err), strict=True):
                assert text == expected.encode(encoding, "backslashreplace").decode(encoding)
        else:
            assert len(ended[1].splitlines()) == len(out.splitlines())


def test_what_an_encoding_lacks_is_printed_as_its_escape() -> None:
    status, out, _ = printed(["show", "exudyn_tree/generalized_alpha"], "ascii")
    assert status == 0
    assert r"generalized-\u03b1" in out


@pytest.mark.full
def test_a_command_whose_reader_has_gone_does_all_its_work(folder: Path) -> None:
    """Its table is printed before its pages are written."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [*PROGRAM, "modes", "check/general", "-o", "m.h5", "-j", "1"]
    try:
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        ended = subprocess.run(
            command, stdout=writing, stderr=subprocess.PIPE, text=True, env=environment
        )
    finally:
        os.close(writing)
    assert ended.returncode == 1, ended.stderr
    assert "Traceback" not in ended.stderr
    assert (folder / "m-report" / "index.html").exists()
