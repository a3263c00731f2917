"""Return the versions, machine and code digests on which results depend."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import platform
import re
from collections.abc import Mapping
from pathlib import Path

import rotor_mbs
from rotor_mbs.methods.base import Method
from rotor_mbs.methods.catalogue import methods
from rotor_mbs.processes import cores

_LIBRARIES = ("numpy", "h5py")
# Folders of the package whose code decides the numbers of a run.
NUMERICS = ("scenario", "solution", "methods", "models")
# Pattern of docstrings and comments, which have no effect on a run. It also matches other strings,
# as group 1, which are kept: a # in a string begins no comment.
_WITHOUT_EFFECT = re.compile(
    r'^[ \t]*[rR]?"""(?:[^\\]|\\.)*?"""[ \t]*$'
    r'|("""(?:[^\\]|\\.)*?"""|"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)*\')'
    r"|[ \t]*#[^\n]*",
    re.DOTALL | re.MULTILINE,
)


def versions() -> dict[str, str]:
    """Return the versions of this package, of engines and libraries, and of Python.

    An engine or library that is missing has the version "not installed".
    """
    return versions_with(*(name for method in methods() for name in method.distributions))


@functools.cache
def versions_with(*distributions: str) -> dict[str, str]:
    """Return the versions of this package, of Python, of common libraries and of `distributions`.

    The common libraries are those that every run uses. A library that is missing has the version
    "not installed".
    """
    known = {"rotor_mbs": rotor_mbs.__version__, "python": platform.python_version()}
    for name in dict.fromkeys((*distributions, *_LIBRARIES)):
        try:
            known[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            known[name] = "not installed"
    return known


def row_versions(method: Method) -> dict[str, str]:
    """Return the versions that a row stores for a run by a method, with digests of the code.

    There is a digest of this package's numerics and, for a method of another package or file, one
    of its own code.
    """
    own = {"plug-in": code_digest(tuple(method.sources))} if method.sources else {}
    return {**versions_with(*method.distributions), "code": numerics_digest(), **own}


@functools.cache
def machine() -> dict[str, str]:
    """Return the operating system, and the processor with the number of cores of this process."""
    processor, information = platform.processor() or platform.machine(), Path("/proc/cpuinfo")
    if information.is_file():
        named = re.search(
            r"^model name\s*:\s*(.*?)\s*$", information.read_text(errors="replace"), re.MULTILINE
        )
        processor = named[1] if named else processor
    count = cores()
    return {
        "platform": platform.platform(),
        "cpu": f"{processor}, {count} {'core' if count == 1 else 'cores'}",
    }


# Attributes of a file that name the programs and the machine that made it, in the order of display.
_MADE_WITH = (
    "rotor_mbs",
    "python",
    "exudyn",
    "heyoka",
    "mujoco",
    "numpy",
    "scipy",
    "h5py",
    "platform",
    "cpu",
)


def made_with(attributes: Mapping[str, object]) -> list[tuple[str, str]]:
    """Return pairs (name, text) for the programs and the machine that made a file, and its date."""
    made = [(name, str(attributes[name])) for name in _MADE_WITH if attributes.get(name)]
    created = str(attributes.get("created", ""))
    if created:
        made.append(("created", f"{created[:16].replace('T', ' ')} UTC"))
    return made


@functools.cache
def numerics_digest() -> str:
    """Return a digest of the part of this package that decides a run's numbers."""
    package = Path(rotor_mbs.__file__).parent
    return code_digest(
        tuple(path for part in NUMERICS for path in sorted((package / part).rglob("*.py")))
    )


@functools.cache
def code_digest(sources: tuple[Path | str, ...]) -> str:
    """Return a digest of source code without comments, docstrings and empty lines.

    Parameters
    ----------
    sources : paths of source files, or texts.

    Returns
    -------
    str
        Twelve hexadecimal digits of a SHA-256.
    """
    digest = hashlib.sha256()
    for source in sources:
        code = (
            source
            if isinstance(source, str)
            else source.read_text(encoding="utf-8", errors="replace")
        )
        text = _WITHOUT_EFFECT.sub(lambda match: match[1] or "", code)
        digest.update(
            "\n".join(line.rstrip() for line in text.splitlines() if line.strip()).encode()
        )
    return digest.hexdigest()[:12]
