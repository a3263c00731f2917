"""Docstrings of the package as reStructuredText: a heading becomes a rubric, an entry `names :
text` an item of a definition list.

In place of napoleon, which takes the first line of such a text for a type, and that of a property
up to its colon.
"""

from __future__ import annotations

import re

from sphinx.application import Sphinx

_ENTRY = re.compile(r"([*\w]+(?:, [*\w]+)*)(?: : (.*))?$")
_TYPE = re.compile(r"[\w.\[\]]+(?: (?:or|of) [\w.\[\]]+)*$")


def _process(
    _app: Sphinx, _what: str, _name: str, _item: object, _options: object, lines: list[str]
) -> None:
    """Rewrites the lines of a docstring in place."""
    written: list[str] = []
    section = ""
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        if line and below and not below.strip("-") and line[0] != " ":
            section = line
            written += [f".. rubric:: {section}", ""]
        elif line and not line.strip("-"):
            continue
        elif section in ("Parameters", "Attributes", "Returns", "Raises") and (
            entry := _ENTRY.match(line)
        ):
            names, text = ", ".join(f"``{name}``" for name in entry[1].split(", ")), entry[2] or ""
            is_type = bool(text) and bool(_TYPE.match(text)) and below.startswith("    ")
            written += ["", f"{names} : {text}" if is_type else names]
            written += [f"    {text}"] if text and not is_type else []
        else:
            written.append(line)
    lines[:] = written


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", _process)
    return {"parallel_read_safe": True}
