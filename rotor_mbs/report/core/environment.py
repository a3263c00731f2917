"""The template environment of the pages. Text from a file is escaped."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import jinja2
from markupsafe import Markup

from rotor_mbs.report.core import numbers
from rotor_mbs.report.core.files import GENERATOR

_TEMPLATES = Path(__file__).resolve().parents[1] / "templates"


def render(template: str, page: Mapping[str, object]) -> str:
    """The HTML of `page` by templates/`template`.html.j2, which says what `page` must have."""
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
    scripts = {path.stem: _script(path) for path in sorted(_TEMPLATES.glob("*.js"))}
    hashes = {name: _hash(text) for name, text in scripts.items()}
    environment.globals.update(generator=GENERATOR, style=Markup(style), scripts=scripts, hashes=hashes)
    environment.filters.update(number=numbers.number, quantity=numbers.quantity)
    return environment


def _script(path: Path) -> Markup:
    """The script without indentation and without lines that are comments."""
    lines = (line.strip() for line in path.read_text(encoding="utf-8").splitlines())
    return Markup("\n".join(line for line in lines if line and not line.startswith("//")))


def _hash(script: str) -> str:
    """For the content security policy of the page, which allows this script alone."""
    return base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
