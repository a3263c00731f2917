"""`reproduce` does nothing where all that decides its outcome is as its last call left it, and only there."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import pytest

from rotor_mbs.cli import main, runs
from rotor_mbs.studies import reproduce


@pytest.fixture
def call(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., bool]:
    """Whether a call did the work, which here is to write a results file and an index once; and its exit status."""
    done: list[int] = []

    def work(_arguments: argparse.Namespace, results: Path, pages: Path) -> tuple[int, str]:
        done.append(1)
        pages.mkdir(parents=True, exist_ok=True)
        (pages / "index.html").touch()
        if not results.exists():
            results.write_bytes(bytes(1000))
        return int((tmp_path / "fails").exists()), "what came out\n"

    monkeypatch.setattr(runs, "_reproduce", work)

    def called(*options: str) -> bool:
        done.clear()
        assert main(["reproduce", "-o", str(tmp_path), *options]) == int(bool(done) and (tmp_path / "fails").exists())
        return bool(done)

    return called


def test_nothing_is_done_twice_and_the_summary_is_shown_again(
    call: Callable[..., bool], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call()
    first = capsys.readouterr().out
    assert not call()
    again = capsys.readouterr().out
    assert "nothing to do" in again
    assert "what came out" in first
    assert "what came out" in again


CHANGES: dict[str, Callable[[Path], object]] = {
    "a bit of the results": lambda folder: (folder / "results.h5").write_bytes(bytes(999) + b"\x01"),
    "no results": lambda folder: (folder / "results.h5").unlink(),
    "no index": lambda folder: (folder / "report" / "index.html").unlink(),
    "unfinished work": lambda folder: (folder / "results.h5.parts").mkdir(),
}


@pytest.mark.parametrize("change", CHANGES)
def test_whatever_changed_is_looked_into(call: Callable[..., bool], tmp_path: Path, change: str) -> None:
    assert call()
    CHANGES[change](tmp_path)
    assert call()


def test_another_time_limit_or_other_code_is_looked_into(
    call: Callable[..., bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call()
    assert call("--timeout", "5")
    monkeypatch.setattr(reproduce, "fingerprint", lambda *_: "other code")
    assert call("--timeout", "5")


def test_a_call_that_failed_is_tried_again(call: Callable[..., bool], tmp_path: Path) -> None:
    (tmp_path / "fails").touch()
    assert call()
    assert call()
