"""Choose the file names of a report's pages, make their HTML from a template, and write them."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from os import PathLike
from pathlib import Path

import jinja2
from markupsafe import Markup, escape

from rotor_mbs.errors import StoreError
from rotor_mbs.report import numbers
from rotor_mbs.report.curves import CurveStore
from rotor_mbs.report.elements import PageContent
from rotor_mbs.report.looks import palette_css
from rotor_mbs.report.stills import still
from rotor_mbs.runs.output_files import refuse_foreign, replace_file
from rotor_mbs.runs.versions import made_with

GENERATOR = "rotor_mbs report"
# Every page has this tag, by which files that a report wrote are recognized.
_MARK = f'<meta name="generator" content="{GENERATOR}">'.encode()
INDEX = "index.html"
_TEMPLATES = Path(__file__).resolve().parent / "templates"
# Largest number of characters of a scene's name in a file name. File systems allow 255 bytes.
_LONGEST = 100
_OTHERS = "data--"  # beginning of the file names of pages of comparisons
# Names of the pages that are not pages of scenes.
MAIN_PAGES = (
    "index",
    "claims",
    "figures",
    "errata",
    "bench",
    "modes",
    "stability",
    "sweep",
    "comparison",
)
# For each script a text that is in the HTML of every page that needs the script.
_SCRIPTS = {
    "plots": 'class="plot"',
    "tables": "aria-sort=",
    "viewer": 'class="viewer"',
    "map": 'id="sweep"',
}
# Largest number of numbers in the curves of a page. They take 800 kB, so that a page has at most
# 1 MB.
MAX_NUMBERS = 150_000
_PLACE_OF_SCRIPTS = "<!-- scripts -->"  # comment in the template that the scripts replace
Pairs = Sequence[tuple[str, str]]
# Characters that are not allowed in a page: control characters except line breaks and tabs, and
# halves of surrogate pairs. A name or a message from a file may have them.
_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff]")


def page_names(scenes: Iterable[str]) -> dict[str, str]:
    """Choose a file name for the page of each scene, such as "paper-fig05.html" for "paper/fig05".

    All file names are different, also if upper and lower case are not distinguished.

    Parameters
    ----------
    scenes : names of scenes.

    Raises
    ------
    StoreError
        If a name has a part ".." or "."; this program writes no such name.
    """
    names: dict[str, str] = {}
    taken = {f"{name}.html" for name in MAIN_PAGES}
    for scene in scenes:
        if {"..", "."} & set(re.split(r"[/\\]", scene)):
            raise StoreError(
                f"scene name {scene!r} cannot be made a file name; allowed: no part .. or ."
            )
        # Keep only characters that every file system allows and that need no encoding in a URL.
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", scene)[:_LONGEST].strip(".-") or "scene"
        stem = f"scene-{stem}" if stem.lower().startswith(_OTHERS) else stem
        name, number = f"{stem}.html", 2
        while name.lower() in taken:
            name, number = f"{stem}-{number}.html", number + 1
        taken.add(name.lower())
        names[scene] = name
    return names


def write_pages(folder: Path, pages: Mapping[str, str]) -> None:
    """Write pages into a folder, each whole or not at all; then remove pages of earlier reports.

    Parameters
    ----------
    folder : the folder, which is created if it does not exist.
    pages : HTML of the pages by file name. Other pages in the folder that a report wrote are
        removed.

    Raises
    ------
    StoreError
        If the folder cannot be written.
    InputError
        If a file in the folder has the name of a page, but was not written by a report.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in pages:  # all names are checked before the first page is written
            refuse_foreign(folder / name, _MARK)
        for name, text in pages.items():
            content = _UNPRINTABLE.sub("\N{REPLACEMENT CHARACTER}", text).encode("utf-8")
            replace_file(folder / name, content, _MARK)
        for old in folder.glob("*.html"):
            if (
                old.name not in pages
                and old.is_file()
                and re.search(_MARK, old.read_bytes()[:2000])
            ):
                old.unlink()
    except OSError as exc:
        raise StoreError(f"{folder}: the report cannot be written: {exc.strerror or exc}") from exc


def render(page: PageContent, made: Pairs = (), links: Pairs = (), here: str = "") -> str:
    """Return the HTML of a page: its text, the numbers of its plots, and the scripts that it needs.

    If the plots have more than MAX_NUMBERS numbers, the page is rendered again with fewer samples.

    Parameters
    ----------
    page : content of the page.
    made : programs and machine that made the results, see `runs.versions.made_with`.
    links : (file, label) of each page in the navigation.
    here : file name of this page.
    """
    shown = []
    if any(file != here for file, _ in links):
        shown = [(file, label, file == here) for file, label in links]
    # Rendering adds the curves to the store. Only then the number of numbers in them is known.
    template, store = _environment().get_template("page.html.j2"), CurveStore()
    known = {"page": page, "links": shown, "versions": made}
    html = template.render(known, store=store)
    if store.size > MAX_NUMBERS:
        store = CurveStore(every=-(-store.size // MAX_NUMBERS))
        html = template.render(known, store=store)
    scripts = "".join(
        f"<script>{_script(name)}</script>\n" for name, sign in _SCRIPTS.items() if sign in html
    )
    return html.replace(_PLACE_OF_SCRIPTS, scripts, 1)


def write_page(
    folder: str | PathLike[str], page: PageContent, attributes: Mapping[str, object]
) -> Path:
    """Write one page as the index of a folder, and return its path.

    Parameters
    ----------
    folder : the folder.
    page : content of the page.
    attributes : attributes of the file that the page shows; they name the programs that made it.

    Raises
    ------
    StoreError
        If the page cannot be written.
    """
    write_pages(Path(folder), {INDEX: render(page, made_with(attributes))})
    return Path(folder) / INDEX


def script_json(data: object) -> Markup:
    """Return data as JSON without characters that could end a script element or begin a comment."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)


@cache
def _script(name: str) -> str:
    """Return the text of a script, without indentation, empty lines and lines of comments."""
    lines = (
        line.strip()
        for line in (_TEMPLATES / f"{name}.js").read_text(encoding="utf-8").splitlines()
    )
    return "\n".join(line for line in lines if line and not line.startswith("//"))


@cache
def _environment() -> jinja2.Environment:
    """Return the environment of the page template: filters, and values that every page uses."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    # The content security policy allows only these scripts, by their digests. A browser does not
    # run a script that the text of a file might contain.
    digests = []
    for name in _SCRIPTS:
        digest = hashlib.sha256(_script(name).encode()).digest()
        digests.append(f"'sha256-{base64.b64encode(digest).decode('ascii')}'")
    environment.globals.update(
        generator=GENERATOR,
        style=Markup(palette_css() + (_TEMPLATES / "style.css").read_text(encoding="utf-8")),
        policy=Markup(" ".join(digests)),
    )
    environment.filters.update(
        typeset=numbers.typeset,
        breakable=_breakable,
        still=still,
        as_json=script_json,
        as_text=partial(json.dumps, separators=(",", ":"), ensure_ascii=False, allow_nan=False),
    )
    return environment


def _breakable(text: str) -> Markup:
    """Return the HTML of a name, which a browser may break after a slash or an underscore.

    A text with spaces is taken for a sentence, and is typeset instead.
    """
    if " " in text:
        return escape(numbers.typeset(text))
    return Markup(re.sub("([/_])", r"\1<wbr>", str(escape(text))))
