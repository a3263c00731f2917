"""README, CONTRIBUTING and CHANGELOG as pages, and links that work both in the repository and in
the pages.

A page `{include}`s a file of the repository's root; links to these files lead to its page, links to
`reports/` to a copy of that folder.
"""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
REPORTS = "reports"


def _include(app: Sphinx, docname: str, source: list[str]) -> None:
    here = Path(app.srcdir, docname).parent

    def included(match: re.Match[str]) -> str:
        return _with_links((here / match[1]).resolve().read_text(encoding="utf-8"), ROOT, here)

    own = _with_links(source[0], here, here)
    source[0] = re.sub(r"```\{include\} (\S+)\n```", included, own)


def _with_links(text: str, base: Path, page: Path) -> str:
    """The text with links that are relative to `base` written for a page in the folder `page`."""

    def link(match: re.Match[str]) -> str:
        label, target, anchor = match.groups(default="")
        path = (base / target).resolve()
        if not path.exists():
            return match[0]
        if path.is_relative_to(ROOT / REPORTS):
            return f'<a href="{path.relative_to(ROOT).as_posix()}">{label.strip("`")}</a>'
        if path.name in PAGES and path.parent == ROOT:
            path = ROOT / "docs" / PAGES[path.name]
        return f"[{label}]({Path(os.path.relpath(path, page)).as_posix()}{anchor})"

    return re.sub(r"\[([^\]]*)\]\((?!https?:|#)([^)#\s]+)(#[^)]*)?\)", link, text)


def _copy_reports(app: Sphinx, exception: Exception | None) -> None:
    if exception is None and app.builder.format == "html":
        shutil.copytree(ROOT / REPORTS, Path(app.outdir) / REPORTS, dirs_exist_ok=True)


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", _include)
    app.connect("build-finished", _copy_reports)
    return {"parallel_read_safe": True}
