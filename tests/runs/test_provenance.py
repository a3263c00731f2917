"""What a stored result depends on: the text of the sources, and not what a running Python keeps beside them."""

from __future__ import annotations

from pathlib import Path

import pytest

import rotor_mbs
from rotor_mbs.runs.versions import fingerprint


def test_a_process_that_compiles_the_sources_changes_no_fingerprint(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else a run stored a moment ago is computed again while another process loads this package for the first time."""
    monkeypatch.setattr(rotor_mbs, "__file__", str(tmp_path / "__init__.py"))
    source, cache = tmp_path / "models" / "one.py", tmp_path / "models" / "__pycache__"
    cache.mkdir(parents=True)
    source.write_text("x = 1\n")
    before = fingerprint.__wrapped__("models")
    for name in ("one.cpython-311.pyc", "one.cpython-311.pyc.139712345678912"):  # written, and while it is written
        (cache / name).write_bytes(b"code")
        assert fingerprint.__wrapped__("models") == before
    source.write_text("x = 2\n")
    assert fingerprint.__wrapped__("models") != before
