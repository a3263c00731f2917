"""Single bits that flip, and files that are cut off: each command ends, and nothing changed passes
as unchanged.

The long form (nightly) runs in a process of its own, which a bit that hangs HDF5 cannot keep from
being ended.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.commands import rotor_mbs

from rotor_mbs.errors import RotorError, StoreError
from rotor_mbs.report.build import write_report
from rotor_mbs.runs.read import open_results, read_records
from rotor_mbs.runs.sweeps import StoredSweep
from rotor_mbs.runs.trailer import read_trailer

SCENE = "check/held"
KINDS = ("results", "s", "modes", "comparison")
FLIPS, CUTS = 2000, 300
_SIGNATURES = (
    b"\x89HDF",
    b"GCOL",
    b"HEAP",
    b"TREE",
    b"SNOD",
    b"OHDR",
    b"OCHK",
    b"FRHP",
    b"FHDB",
    b"BTHD",
    b"BTLF",
)
LIMIT_S = 10.0  # for a file, in the long form


def metadata(content: bytes, path: Path) -> list[int]:
    """Offsets in HDF5's heaps and headers: within 512 bytes behind a signature of theirs; rows left
    out."""
    rows = [region for columns in read_trailer(path).groups.values() for region in columns.values()]
    near = set[int]()
    for signature in _SIGNATURES:
        start = content.find(signature)
        while start >= 0:
            near.update(range(start, min(start + 512, len(content))))
            start = content.find(signature, start + 1)
    return sorted(
        place
        for place in near
        if not any(start <= place < start + length for start, length in rows)
    )


def damages(folder: Path, flips: int, cuts: int, seed: int) -> Iterator[tuple[str, str, bytes]]:
    """Kind, what was done, content: half of the flips in heaps and headers, half anywhere."""
    chance = random.Random(seed)
    whole = {kind: (folder / f"{kind}.h5").read_bytes() for kind in KINDS}
    inner = {kind: metadata(whole[kind], folder / f"{kind}.h5") for kind in KINDS}
    for number in range(flips):
        kind = KINDS[number % len(KINDS)]
        content = bytearray(whole[kind])
        is_inner = number // len(KINDS) % 2 == 0
        place = chance.choice(inner[kind]) if is_inner else chance.randrange(len(content))
        bit = chance.randrange(8)
        content[place] ^= 1 << bit
        yield kind, f"bit {bit} of byte {place}", bytes(content)
    for number in range(cuts):
        kind = KINDS[number % len(KINDS)]
        length = chance.randrange(len(whole[kind]))
        yield kind, f"cut after {length} bytes", whole[kind][:length]


def read_all(kind: str, path: Path) -> None:
    """Everything that the file holds. Raises StoreError where something of it has changed."""
    if kind == "results":
        with open_results(path) as results:
            for scene in results.scenes.values():
                for run in scene.runs.values():
                    _ = run.attributes, [run.array(name) for name in run.names]
            runs = [
                f"{scene.name}/{name}" for scene in results.scenes.values() for name in scene.runs
            ]
        if runs != [f"{SCENE}/reference", f"{SCENE}/lagrange/dop853"]:
            raise StoreError(f"{path}: a run is missing")
    elif kind == "s":
        sweep = StoredSweep(path)
        if (sweep.column("status") < 0).any():
            raise StoreError(f"{path}: a run is missing")
    else:
        read_records(path, kind)


def attempt(kind: str, content: bytes, folder: Path, command: str) -> str:
    """What becomes of a damaged file. Raises whatever is no refusal, AssertionError where a change
    is not seen."""
    path = folder / "damaged.h5"
    path.write_bytes(content)
    status = 0
    with pytest.raises(RotorError) as refusal:  # else the change is not seen
        read_all(kind, path)
    assert "\n" not in str(refusal.value)
    if command == "check":
        status = rotor_mbs("check", path).status
    else:
        try:
            write_report(path, folder / "pages")
        except RotorError:
            status = 2
    assert status in (0, 1, 2)
    return f"{command} {kind}: status {status}"


def try_all(folder: Path, out: Path, flips: int, cuts: int, seed: int) -> Counter[str]:
    outcomes = Counter[str]()
    for number, (kind, what, content) in enumerate(damages(folder, flips, cuts, seed)):
        try:
            outcomes[attempt(kind, content, out, "check" if number // 8 % 4 else "report")] += 1
        except Exception as exc:
            raise AssertionError(f"{kind}: {what}: {type(exc).__name__}: {exc}") from exc
    return outcomes


def test_a_flipped_bit_or_a_cut_is_found(files: Path, tmp_path: Path) -> None:
    """The short form: the digest is compared before HDF5 sees the file, so that it cannot hang this
    process."""
    outcomes = try_all(files, tmp_path, 96, 16, seed=1)
    assert sum(outcomes.values()) == 112


@pytest.mark.nightly
def test_two_thousand_flipped_bits_and_three_hundred_cuts_are_found(
    files: Path, tmp_path: Path
) -> None:
    process = subprocess.run(
        [sys.executable, __file__, str(files), str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        timeout=(FLIPS + CUTS) * LIMIT_S,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
    )
    assert process.returncode == 0, process.stderr
    print(process.stdout)


if __name__ == "__main__":
    for name, count in sorted(try_all(*map(Path, sys.argv[1:]), FLIPS, CUTS, seed=2).items()):
        print(count, name)
