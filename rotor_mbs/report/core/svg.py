"""A figure as SVG inside a page: inner names that are unique there, no style of its own, numbers of one decimal."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import escape

from markupsafe import Markup

from rotor_mbs.report.core.canvas import Panels, svg_text
from rotor_mbs.report.core.elements import Picture

_DROPPED = re.compile(
    r'^.*?(?=<svg)|<!--.*?-->|<metadata>.*?</metadata>|<style type=.*?</style>|<g id="[^"]*"/>|(?<=<g) id="[^"]*"', re.S
)
_DEFAULT = re.compile(r'font-family:[^;]*; ?|font-size: 9.5px; ?|stroke-dashoffset: 0; ?| transform="rotate\(-0 [^"]*"')
_TAG = re.compile(r"<[^>]*>")
_NUMBER = re.compile(r"-?\d+\.\d+")


def picture(panels: Panels, name: str, caption: str, description: str, notes: Iterable[str] = ()) -> Picture:
    """The figure for a page. `name` is unique on the page; `description` says what the figure shows."""
    text = embedded(svg_text(panels.figure, name), name, caption, description)
    return Picture(Markup(text), caption, [note for note in notes if note])


def embedded(svg: str, name: str, title: str, description: str) -> str:
    """`svg` as an element of a page, with title and description as its alternative text."""
    svg = _TAG.sub(_shortened, _DROPPED.sub("", svg)).replace("xlink:href=", "href=")
    svg = re.sub(r">\s+<", "><", svg).strip()
    head = re.match(r'<svg[^>]*(viewBox="[^"]*")[^>]*>', svg)
    assert head is not None  # matplotlib writes one
    return (
        f'<svg {head[1]} role="img" aria-labelledby="{name}-t {name}-d">'
        f'<title id="{name}-t">{escape(title)}</title><desc id="{name}-d">{escape(description)}</desc>'
    ) + svg[head.end() :]


def _shortened(tag: re.Match[str]) -> str:
    """Numbers of one decimal, a fifth of a pixel; the font and its usual size come from the page's style sheet."""
    text = re.sub(r'font: ([\d.]+px)[^;"]*', r"font-size: \1", " ".join(tag[0].split()))
    text = re.sub(
        r'font-family:[^;]*; ?|font-size: 9.5px; ?|stroke-dashoffset: 0; ?| transform="rotate\(-0 [^"]*"', "", text
    )
    return _NUMBER.sub(lambda number: f"{float(number[0]):.1f}".removesuffix(".0"), text)
