"""A tab of a headless Chromium for all tests of this folder."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.devtools import Page


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    opened = Page()
    yield opened
    opened.close()
