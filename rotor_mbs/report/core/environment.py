"""Pages as HTML text: templates filled with what other modules made. Everything from a file is escaped."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import jinja2
from markupsafe import Markup

from rotor_mbs.analysis.published import Erratum
from rotor_mbs.report import texts
from rotor_mbs.report.core.elements import Picture, Sample, Section, Table
from rotor_mbs.report.core.files import GENERATOR
from rotor_mbs.report.pages import stability_texts

_TEMPLATES = Path(__file__).resolve().parents[1] / "templates"


@dataclass(frozen=True)
class ScenePage:
    """A scene. previous, next: file names or ""; source: where the scene comes from; toml: its file's text."""

    name: str
    title: str
    figures: str
    lead: Sequence[str]
    failures: Sequence[str]
    source: str
    sections: Sequence[Section]
    toml: str
    has_errata: bool = False
    previous: str = ""
    next: str = ""

    @property
    def has_viewer(self) -> bool:
        return any(section.viewer for section in self.sections)


@dataclass(frozen=True)
class IndexPage:
    """All scenes. machine: (what, version); is_paper: whether scenes of the paper are among them."""

    finding: Sequence[str]
    sections: Sequence[Section]
    machine: Sequence[tuple[str, str]]
    has_errata: bool
    is_paper: bool
    has_walk: bool = False


@dataclass(frozen=True)
class ErrataPage:
    """The errata. agreeing: the checked entries that are right, None where no check is stored."""

    errata: Sequence[Erratum]
    sections: Sequence[Section]
    agreeing: Table | None
    agreeing_summary: str


@dataclass(frozen=True)
class Row:
    """A panel: its letter, its scene's page and conditions, a picture a model, and what they show."""

    letter: str
    scene: str
    href: str
    conditions: str
    pictures: Sequence[Picture]
    same: str
    different: str


@dataclass(frozen=True)
class Entry:
    """A figure of the paper. numbers: what the paper prints about it, a line each; notes: what is not known."""

    number: str
    heading: str
    legend: Sequence[Sample]
    rows: Sequence[Row]
    numbers: Sequence[str]
    notes: Sequence[str]


@dataclass(frozen=True)
class WalkPage:
    """The walk through the paper's figures."""

    entries: Sequence[Entry]
    has_errata: bool


def render(template: str, page: object) -> str:
    """The page by `template` ("scene", "index", "errata", "walk", "bench"); each knows its own kind of page."""
    return _environment().get_template(f"{template}.html.j2").render(page=page)


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    style = (_TEMPLATES / "style.css").read_text(encoding="utf-8").strip()
    environment.globals.update(t=texts, w=stability_texts, generator=GENERATOR, style=Markup(style))
    scripts = {path.stem: _script(path) for path in sorted(_TEMPLATES.glob("*.js"))}
    environment.globals.update(scripts=scripts, hashes={name: _hash(text) for name, text in scripts.items()})
    return environment


def _script(path: Path) -> Markup:
    """Our own code without indentation and without lines that are comments."""
    lines = (line.strip() for line in path.read_text(encoding="utf-8").splitlines())
    return Markup("\n".join(line for line in lines if line and not line.startswith("//")))


def _hash(script: str) -> str:
    """By which the page's own policy knows its script from any other."""
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
