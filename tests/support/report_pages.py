"""A page's HTML taken apart: its plots with the numbers that they draw, its tables, its
sentences."""

from __future__ import annotations

import base64
import html
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.report.numbers import SPACE

Array = NDArray[np.float64]


def text_of(folder: Path, name: str = "index.html") -> str:
    """A page's HTML, with plain spaces and without the places at which a name may be broken."""
    return (folder / name).read_text(encoding="utf-8").replace(SPACE, " ").replace("<wbr>", "")


@dataclass
class DrawnPlot:
    """A plot as the script gets it; curves: (x, y) by name."""

    described: dict[str, Any]
    curves: dict[str, tuple[Array, Array]]


def plots_of(text: str, run: int = 0) -> dict[str, DrawnPlot]:
    """The plots of a page by name, with the columns that the script reads; run: of a sweep, which
    row of its tables."""
    stored = re.search(r'<script type="text/plain" id="curves">(.*?)</script>', text, re.S)
    numbers = np.frombuffer(base64.b64decode(stored[1]) if stored else b"", "<f4").astype(float)

    def column(place: dict[str, Any]) -> Array:
        first, count, *stride = place["at"]
        start = first + run * (stride[0] if stride else 0)
        return numbers[start : start + count] + place.get("from", 0.0)

    plots = {}
    for described in re.findall(r'<figure class="plot" data-plot="(.*?)">', text):
        plot = json.loads(html.unescape(described))
        curves = {
            curve["name"]: (column(curve["x"]), column(curve["y"])) for curve in plot["curves"]
        }
        plots.setdefault(plot["name"], DrawnPlot(plot, curves))
    return plots


def words_of(text: str) -> str:
    """A piece of HTML without markup."""
    return " ".join(html.unescape(re.sub(r"<[^>]*>", "", text)).split())


def answer_of(text: str) -> str:
    """The sentences at the top of a page."""
    found = re.search(r'<p class="answer">(.*?)</p>', text, re.S)
    return words_of(found[1]) if found else ""


def facts_of(text: str) -> dict[str, str]:
    """The numbers at the top of a page by what they are, with their notes behind."""
    found = re.search(r'<dl class="facts">(.*?)</dl>', text, re.S)
    pairs = re.findall(r"<dt>(.*?)</dt><dd[^>]*>(.*?)</dd>", found[1] if found else "", re.S)
    return {words_of(name): words_of(value.replace("<small>", " | ")) for name, value in pairs}


def sections_of(text: str) -> list[str]:
    return re.findall(r'<section id="([^"]*)"', text)


def section_of(text: str, name: str) -> str:
    found = re.search(rf'<section id="{name}".*?</section>', text, re.S)
    assert found is not None, name
    return found[0]


def rows_of(text: str) -> dict[str, list[str]]:
    """The cells of each row of the tables in a text, by the row's heading, without notes and
    markup."""
    rows = {}
    for heading, cells in re.findall(r'<tr><th scope="row"[^>]*>(.*?)</th>(.*?)</tr>', text, re.S):
        rows[words_of(heading.partition("<small")[0])] = [
            words_of(cell) for cell in re.findall(r"<td.*?>(.*?)</td>", cells, re.S)
        ]
    return rows
