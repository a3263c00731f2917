"""Pages as files: their names, their HTML by a template (text is escaped), and their writing."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from os import PathLike
from pathlib import Path

import jinja2
from markupsafe import Markup, escape

from rotor_mbs.errors import StoreError
from rotor_mbs.report import numbers
from rotor_mbs.report.looks import palette_css
from rotor_mbs.runs.output_files import refuse_foreign, replace_file

GENERATOR = "rotor_mbs report"
_MARK = f'<meta name="generator" content="{GENERATOR}">'.encode()  # of every page
INDEX = "index.html"
_TEMPLATES = Path(__file__).resolve().parent / "templates"
_LONGEST = 100  # characters; file systems allow 255 bytes
_OTHERS = "data--"  # the beginning of the names of other pages than those of scenes
_CONTENTS = "<!-- contents -->"  # its place in a template
_SECTION = re.compile(r'<section id="([^"]+)"[^>]*>\s*(?:<details><summary>)?<h2>(.*?)</h2>')
_MANY_SECTIONS = 3
Pairs = Sequence[tuple[str, str]]
# Attributes of a results file that say what made it.
_VERSIONS = ("rotor_mbs", "python", "exudyn", "heyoka", "mujoco", "numpy", "scipy", "h5py", "platform", "cpu")
# Control characters but those of lines and tabs, and halves of surrogate pairs: names and messages come from any file.
_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff]")


def made_with(attributes: Mapping[str, object]) -> list[tuple[str, str]]:
    """(what, version) of the programs and the computer that made a file, and when."""
    made = [(name, str(attributes[name])) for name in _VERSIONS if attributes.get(name)]
    created = str(attributes.get("created", ""))
    return [*made, ("created", f"{created[:16].replace('T', numbers.SPACE)}{numbers.SPACE}UTC")] if created else made


def page_names(scenes: Iterable[str]) -> dict[str, str]:
    """A file name for each scene: "paper-fig05.html" for "paper/fig05"; all different, also where case is ignored.

    Raises StoreError for a name with a part ".." or ".": no file of this program has one.
    """
    names: dict[str, str] = {}
    taken = {path.stem for path in _TEMPLATES.glob("*.html.j2")}  # other pages are named like their templates
    for scene in scenes:
        if {"..", "."} & set(re.split(r"[/\\]", scene)):
            raise StoreError(f"scene name {scene!r} cannot be made a file name; allowed: no part .. or .")
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", scene)[:_LONGEST].strip(".-") or "scene"
        stem = f"scene-{stem}" if stem.lower().startswith(_OTHERS) else stem
        name, number = f"{stem}.html", 2
        while name.lower() in taken:
            name, number = f"{stem}-{number}.html", number + 1
        taken.add(name.lower())
        names[scene] = name
    return names


def write_pages(folder: Path, pages: Mapping[str, str]) -> None:
    """Each page whole or not at all; then removes pages of an earlier report that are no longer made.

    Raises StoreError where the folder cannot be written, InputError where it has other pages of these names.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in pages:  # all of them before the first is written
            refuse_foreign(folder / name, _MARK)
        for name, text in pages.items():
            content = _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", text).encode("utf-8")
            replace_file(folder / name, content, _MARK)
        for old in folder.glob("*.html"):
            if old.name not in pages and old.is_file() and re.search(_MARK, old.read_bytes()[:2000]):
                old.unlink()
    except OSError as exc:
        raise StoreError(f"{folder}: the report cannot be written: {exc.strerror or exc}") from exc


def render(
    template: str, page: Mapping[str, object], made: Pairs = (), links: Pairs = (), here: str = ""
) -> str:  # fmt: skip
    """The HTML of `page` by templates/`template`.html.j2, with a table of contents where it has many sections.

    made: what made the results, see `made_with`. links: (file, label) of the main pages; here: the file of this one.
    """
    shown = [] if all(file == here for file, _ in links) else [(file, label, file == here) for file, label in links]
    html = _environment().get_template(f"{template}.html.j2").render(page=page, links=shown, versions=made)
    sections = _SECTION.findall(html)
    contents = ""
    if len(sections) >= _MANY_SECTIONS:
        entries = "".join(f'<a href="#{name}">{heading}</a>' for name, heading in sections)
        contents = f'<nav class="contents" aria-label="Contents">{entries}</nav>'
    return html.replace(_CONTENTS, contents, 1)


def write_page(
    folder: str | PathLike[str], template: str, page: Mapping[str, object], attributes: Mapping[str, object]
) -> Path:
    """One page as the index of a folder; its path. attributes: of what it shows, with what made it. Raises StoreError
    where it cannot be written."""
    write_pages(Path(folder), {INDEX: render(template, page, made_with(attributes))})
    return Path(folder) / INDEX


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
    style = (_TEMPLATES / "style.css").read_text(encoding="utf-8")
    # Without indentation and without lines that are comments.
    lines = (line.strip() for line in (_TEMPLATES / "viewer.js").read_text(encoding="utf-8").splitlines())
    script = "\n".join(line for line in lines if line and not line.startswith("//"))
    environment.globals.update(
        generator=GENERATOR,
        style=Markup(palette_css() + style),
        script=Markup(script),
        # For the content security policy of a page, which allows its script alone.
        script_digest=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii"),
    )
    environment.filters.update(
        number=numbers.number,
        with_unit=numbers.with_unit,
        typeset=numbers.typeset,
        formula=numbers.formula,
        breakable=_breakable,
    )
    return environment


def _breakable(text: str) -> Markup:
    """A name such as exudyn_tree/rk67 may be broken after a slash or an underscore; a sentence is typeset."""
    if " " in text:
        return escape(numbers.typeset(text))
    return Markup(re.sub("([/_])", r"\1<wbr>", str(escape(text))))
