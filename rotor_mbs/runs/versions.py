"""What the results depend on besides scene and method: versions, machine, and the text of our own numerics."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import platform
from pathlib import Path

import rotor_mbs
from rotor_mbs.methods.catalogue import methods
from rotor_mbs.runs import cores

_OWN = ("numpy", "h5py")
NUMERICS = ("scenario", "solution", "methods", "models")  # sources that decide a run's numbers


def versions() -> dict[str, str]:
    """Versions of this package, of the engines and libraries ("not installed" where one is missing), and of Python."""
    return versions_with(*(name for method in methods() for name in method.distributions))


@functools.cache
def versions_with(*distributions: str) -> dict[str, str]:
    """Versions of this package, of Python, of the libraries that every method uses, and of `distributions`."""
    found = {"rotor_mbs": rotor_mbs.__version__, "python": platform.python_version()}
    for name in dict.fromkeys((*distributions, *_OWN)):
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


@functools.cache
def machine() -> dict[str, str]:
    """Operating system and processor, as the system reports them; the cores that this process may use."""
    return {"platform": platform.platform(), "cpu": f"{_processor()}, {cores()} cores"}


def _processor() -> str:
    information = Path("/proc/cpuinfo")
    if information.is_file():
        for line in information.read_text(errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


@functools.cache
def fingerprint(*parts: str) -> str:
    """sha256 over every file of this package in `parts`, which are folders or files: a changed model makes stored runs
    stale.

    Without what Python keeps of them: a process that compiles them has files of passing names there.
    """
    package = Path(rotor_mbs.__file__).parent
    digest = hashlib.sha256()
    for part in parts:
        for path in sorted({package / part, *(package / part).rglob("*")}):
            if path.parent.name != "__pycache__" and path.is_file():
                digest.update(str(path.relative_to(package)).encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()
