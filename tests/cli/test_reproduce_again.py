"""`reproduce` does nothing where all that decides its outcome is as its last call left it, and only there."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import pytest
from support.commands import rotor_mbs

from rotor_mbs.cli import runs
from rotor_mbs.studies import reproduce


@pytest.fixture
def call(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., bool]:
    """Calls `reproduce`, with work that writes a results file and an index; returns whether the work was done."""
    done: list[Path] = []

    def work(_arguments: argparse.Namespace, results: Path, pages: Path) -> tuple[int, str]:
        done.append(results)
        pages.mkdir(parents=True, exist_ok=True)
        (pages / "index.html").touch()
        if not results.exists():
            results.write_bytes(bytes(1000))
        return int(Path("fails").exists()), "result as printed: what came out\n"

    def called(*options: str) -> bool:
        done.clear()
        ended = rotor_mbs("reproduce", "-o", folder, *options)
        assert ended.status == int(bool(done) and Path("fails").exists())
        assert "result as printed: what came out" in ended.out
        assert ("nothing to do" in ended.out) == (not done)
        return bool(done)

    monkeypatch.setattr(runs, "_reproduce", work)
    return called


CHANGES: dict[str, Callable[[], object]] = {
    "nothing": lambda: None,
    "a bit of the results": lambda: Path("results.h5").write_bytes(bytes(999) + b"\x01"),
    "no results": Path("results.h5").unlink,
    "no index": Path("report/index.html").unlink,
    "unfinished work": Path(".results.h5.lock").touch,
    "a call that failed": Path("fails").touch,
}


@pytest.mark.parametrize("change", CHANGES)
def test_only_what_changed_is_looked_into(call: Callable[..., bool], change: str) -> None:
    if change == "a call that failed":
        CHANGES[change]()
        assert call()
    else:
        assert call()
        CHANGES[change]()
    assert call() == (change != "nothing")


def test_another_time_limit_or_other_code_is_looked_into(
    call: Callable[..., bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call()
    assert call("--timeout", "5")
    monkeypatch.setattr(reproduce, "versions", lambda: {"rotor_mbs": "other code"})
    assert call("--timeout", "5")
