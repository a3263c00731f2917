"""SVG text made small and fit for standing inside a page: no style of its own, no names that could clash, few digits.

A pure text transformation of what matplotlib writes. Knows no figure.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from itertools import count

_NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")
_TAG = re.compile(r"<[^>]*>")
_PATH = re.compile(r' d="([^"]*)"')
_SEGMENT = re.compile(r"([MLCQz])([^MLCQz]*)")
_USES = re.compile(r"(?:\s*<use [^>]*/>)+")
_USE = re.compile(r'<use xlink:href="(#[^"]+)" x="([^"]+)" y="([^"]+)" style="([^"]*)"\s*/>')
_LONG_NAME = re.compile(r"(?<=[\"#])[a-z][0-9a-f]{10}(?=[\")])")
_NO_LINE = re.compile(r'<path d="M[^l"]*"[^>]*stroke-width[^>]*/>')  # a mark that stands alone comes with one
_DROPPED = (
    re.compile(r"^.*?(?=<svg)", re.S),
    re.compile(r"<!--.*?-->", re.S),
    re.compile(r"<metadata>.*?</metadata>", re.S),
    re.compile(r'<style type="text/css">.*?</style>', re.S),
    re.compile(r"<defs>\s*</defs>"),
    re.compile(r'(?<=<g) id="[^"]*"'),
)


def embedded(svg: str, name: str, title: str, description: str) -> str:
    """`svg` for the inside of a page: `name` makes its inner names unique there, title and description are for those
    who cannot see it."""
    for pattern in _DROPPED:
        svg = pattern.sub("", svg)
    svg = _named_briefly(svg)
    numbers = count()
    svg = _USES.sub(lambda found: _marked(found[0], numbers), svg)
    svg = _PATH.sub(lambda found: f' d="{_path(found[1])}"', svg)
    svg = _TAG.sub(lambda found: _lean(found[0]), svg)
    svg = svg.replace("xlink:href=", "href=")
    svg = re.sub(r'(\bid="|href="#|url\(#)', rf"\g<1>{name}-", svg)
    svg = _NO_LINE.sub("", svg)
    svg = re.sub(r">\s+<", "><", re.sub(r"<g>\s*</g>", "", svg))
    head = re.search(r"<svg[^>]*>", svg)
    assert head is not None  # matplotlib wrote it
    box = re.search(r'viewBox="[^"]*"', head[0])
    assert box is not None
    start = (
        f'<svg {box[0]} role="img" aria-labelledby="{name}-t {name}-d">'
        f'<title id="{name}-t">{escape(title)}</title><desc id="{name}-d">{escape(description)}</desc>'
    )
    return svg[: head.start()] + start + svg[head.end() :].strip()


def _lean(tag: str) -> str:
    """A tag without white space, digits and defaults that say nothing; texts get their font from the style sheet."""
    tag = re.sub(r"font: ([\d.]+)px [^;\"]*", r"font-size: \1px", tag)
    tag = re.sub(r"font-family: [^;\"]*(?:; )?", "", tag)
    tag = re.sub(r' transform="rotate\(-?0 [^"]*"', "", tag)
    tag = re.sub(r"(?:; )?stroke-linecap: (?:square|butt)", "", tag)
    tag = re.sub(r"#(.)\1(.)\2(.)\3(?![0-9a-f])", r"#\1\2\3", tag)
    tag = tag.replace('style="; ', 'style="').replace(' style=""', "").replace(": ", ":").replace("; ", ";")
    return _NUMBER.sub(lambda found: _short(float(found[0]), 2), tag)


def _named_briefly(svg: str) -> str:
    """Inner names of a letter and a number in place of matplotlib's long ones."""
    names: dict[str, str] = {}
    return _LONG_NAME.sub(lambda found: names.setdefault(found[0], f"{found[0][0]}{len(names)}"), svg)


def _marked(uses: str, numbers: Iterator[int]) -> str:
    """Many marks of one style as one invisible line that has the mark at every corner."""
    found = _USE.findall(uses)
    if len({(mark, style) for mark, _, _, style in found}) > 1 or len(found) < 3:
        return uses
    mark, style = found[0][0], found[0][3]
    name = f"k{next(numbers)}"
    corners = " ".join(f"{'L' if i else 'M'} {x} {y}" for i, (_, x, y, _) in enumerate(found))
    everywhere = ";".join(f"marker-{place}:url(#{name})" for place in ("start", "mid", "end"))
    return (
        f'<marker id="{name}" overflow="visible" markerUnits="userSpaceOnUse">'
        f'<use xlink:href="{mark}" style="{style}"/></marker>'
        f'<path d="{corners}" style="fill:none;stroke:none;{everywhere}"/>'
    )


def _path(d: str) -> str:
    """Lines in steps of a tenth of a unit, relative: less than half the text. Errors do not add up."""
    segments = _SEGMENT.findall(d)
    if any(command in "CQ" for command, _ in segments):
        return _NUMBER.sub(lambda found: _short(float(found[0]), 2), " ".join(d.split()))
    pieces: list[str] = []
    here, previous = (0, 0), ""
    for command, numbers in segments:
        if command == "z":
            pieces.append("z")
        else:
            x, y = (round(10.0 * float(n)) for n in numbers.split())
            if command == "L" and (x, y) == here:
                continue
            step = (x, y) if command == "M" else (x - here[0], y - here[1])
            text = _tenths(step[0]) + _joined(_tenths(step[1]))
            # A further step of the same command needs no letter.
            pieces.append(_joined(text) if command == previous == "L" else {"M": "M", "L": "l"}[command] + text)
            here = (x, y)
        previous = command
    return "".join(pieces)


def _joined(number: str) -> str:
    """A number after another: a sign or nothing parts them."""
    return number if number.startswith("-") else f" {number}"


def _tenths(value: int) -> str:
    """17 as "1.7", -3 as "-.3", 20 as "2"."""
    whole, tenth = divmod(abs(value), 10)
    text = f"{whole or ''}.{tenth}" if tenth else str(whole)
    return f"-{text}" if value < 0 else text


def _short(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    text = re.sub(r"^(-?)0\.", r"\1.", text)
    return "0" if text in ("-0", "", "-") else text
