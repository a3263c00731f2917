"""Write pages as files: choose their names, make their HTML by a template, and write them."""

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
_MARK = f'<meta name="generator" content="{GENERATOR}">'.encode()  # of every page
INDEX = "index.html"
_TEMPLATES = Path(__file__).resolve().parent / "templates"
_LONGEST = 100  # characters; file systems allow 255 bytes
_OTHERS = "data--"  # how names of pages of comparisons begin
# The pages that are not scenes, by their name.
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
_SCRIPTS = {  # by file: a text that is in a page that needs the script
    "plots": 'class="plot"',
    "tables": "aria-sort=",
    "viewer": 'class="viewer"',
    "map": 'id="sweep"',
}
MAX_NUMBERS = 150_000  # in a page's curves: 800 kB, so that a page has at most 1 MB
_PLACE_OF_SCRIPTS = "<!-- scripts -->"
Pairs = Sequence[tuple[str, str]]
# Control characters but those of lines and tabs, and halves of surrogate pairs: names and messages
# come from any file.
_UNPRINTABLE = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\ud800-\udfff]")


def page_names(scenes: Iterable[str]) -> dict[str, str]:
    """Choose a file name for each scene: "paper-fig05.html" for "paper/fig05".

    All names are different, also where case is ignored.

    Parameters
    ----------
    scenes : names of scenes.

    Raises
    ------
    StoreError
        For a name with a part ".." or ".": no file of this program has one.
    """
    names: dict[str, str] = {}
    taken = {f"{name}.html" for name in MAIN_PAGES}
    for scene in scenes:
        if {"..", "."} & set(re.split(r"[/\\]", scene)):
            raise StoreError(
                f"scene name {scene!r} cannot be made a file name; allowed: no part .. or ."
            )
        # Only characters that every file system allows and that stay as they are in an address.
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", scene)[:_LONGEST].strip(".-") or "scene"
        stem = f"scene-{stem}" if stem.lower().startswith(_OTHERS) else stem
        name, number = f"{stem}.html", 2
        while name.lower() in taken:
            name, number = f"{stem}-{number}.html", number + 1
        taken.add(name.lower())
        names[scene] = name
    return names


def write_pages(folder: Path, pages: Mapping[str, str]) -> None:
    """Write each page whole or not at all; then remove pages of an earlier report.

    Parameters
    ----------
    folder : where they are written; it is made where it does not exist.
    pages : HTML by file name. Pages in the folder that a report wrote and that are not among them
        are removed.

    Raises
    ------
    StoreError
        Where the folder cannot be written.
    InputError
        Where it has a file of one of these names that no report wrote.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name in pages:  # all of them before the first is written
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
    """Return the HTML of a page: text, numbers of its plots, and the scripts that it needs.

    Where the plots have more than MAX_NUMBERS numbers, the page is rendered again with fewer
    samples.

    Parameters
    ----------
    page : its content.
    made : what made the results, see `runs.versions.made_with`.
    links : (file, label) of the main pages.
    here : the file of this page.
    """
    shown = []
    if any(file != here for file, _ in links):
        shown = [(file, label, file == here) for file, label in links]
    # Rendering fills the store: how many numbers a page has is known only then.
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
    folder : where it is written.
    page : its content.
    attributes : of the file that it shows, with what made that.

    Raises
    ------
    StoreError
        Where the page cannot be written.
    """
    write_pages(Path(folder), {INDEX: render(page, made_with(attributes))})
    return Path(folder) / INDEX


def script_json(data: object) -> Markup:
    """Return JSON in which no character can end a script element or begin a comment."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)


@cache
def _script(name: str) -> str:
    """Return a script without indentation and without lines that are comments."""
    lines = (
        line.strip()
        for line in (_TEMPLATES / f"{name}.js").read_text(encoding="utf-8").splitlines()
    )
    return "\n".join(line for line in lines if line and not line.startswith("//"))


@cache
def _environment() -> jinja2.Environment:
    """Build the environment of the pages' templates: filters, and what every page has."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    # The policy allows these scripts and no others: nothing that a file's text might bring is run.
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
    """Return a name that a browser may break after a slash or an underscore.

    A text with spaces is a sentence, and is typeset instead.
    """
    if " " in text:
        return escape(numbers.typeset(text))
    return Markup(re.sub("([/_])", r"\1<wbr>", str(escape(text))))
