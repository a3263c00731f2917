"""Commands of these tests work in a folder of their own, and leave no methods of files to later tests."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from rotor_mbs.methods import catalogue


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    catalogue._files.clear()
    catalogue._of_files.clear()
