"""Commands of these tests work in a folder of their own, and leave no methods of files to later
tests."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from support.packages import forget_method_files


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    forget_method_files()
