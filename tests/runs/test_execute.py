"""The executor: what is stored is skipped, what ended is kept, what was lost is tried again; one process per output."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from rotor_mbs.runs.case import Case
from support.scenes import paper

from rotor_mbs.errors import InputError
from rotor_mbs.runs.runner import Job, Outcome, Result, execute, in_pool

SCENE = paper("fig08")
METHOD = "lagrange/dop853"


@dataclass(frozen=True)
class TextStore:
    """Keys and texts of records in a JSON file."""

    path: Path

    def read(self) -> dict[str, str]:
        found: dict[str, str] = json.loads(self.path.read_text()) if self.path.exists() else {}
        return found

    def stored_keys(self) -> set[str]:
        return set(self.read())

    def merge(self, parts: Sequence[Path], without: Collection[str] = ()) -> None:
        assert not without
        self.path.write_text(json.dumps(self.read() | {part.stem: part.read_text() for part in parts}))


def case(number: int, reference: str = "") -> Case:
    return Case(SCENE, METHOD, study="test", options={"number": number}, reference=reference)


def number_of(job: Job) -> int:
    return int(str(job.case.options["number"]))


def perform(job: Job) -> Result:
    """Writes the number of a case; of one that has a reference, whether that is there. Case 13 kills its process."""
    if number_of(job) == 13 and not (job.part.parents[1] / "survives").exists():
        os.kill(os.getpid(), signal.SIGKILL)
    there = job.reference is not None and job.case.reference in (job.reference.stem, *_keys(job.reference))
    job.part.write_text(f"{number_of(job)} {there}")
    return Result("ok", seconds=float(number_of(job)))


def _keys(path: Path) -> list[str]:
    return list(json.loads(path.read_text())) if path.suffix == ".json" else []


def in_this_process(cases: Sequence[Case], store: TextStore) -> list[Outcome]:
    return execute(cases, in_pool(perform, 0, 10.0), store)


def test_what_is_stored_is_skipped_and_the_rest_is_merged(tmp_path: Path) -> None:
    store = TextStore(tmp_path / "out.json")
    assert [made.share for made in in_this_process([case(1), case(2)], store)] == [0.5, 1.0]  # of equal work
    (made,) = in_this_process([case(1), case(2), case(3)], store)
    assert made.case.options == {"number": 3}
    assert store.read() == {case(n).key: f"{n} False" for n in (1, 2, 3)}
    assert [path.name for path in tmp_path.iterdir()] == ["out.json"]


def test_references_come_first_and_are_found_where_they_are(tmp_path: Path) -> None:
    """In the folder of parts during the call that computes them, in the output after that."""
    store = TextStore(tmp_path / "out.json")
    reference = case(0)
    made = in_this_process([case(1, reference.key), reference], store)
    assert [one.case.options["number"] for one in made] == [0, 1]
    in_this_process([case(2, reference.key), reference], store)
    assert [store.read()[case(n, reference.key).key] for n in (1, 2)] == ["1 True", "2 True"]


def tell_process(job: Job) -> Result:
    job.part.touch()
    return Result("ok", str(os.getpid()))


def test_a_worker_goes_on_with_what_needs_the_references(tmp_path: Path) -> None:
    """A new process for the cases that have a reference would load everything anew."""
    store = TextStore(tmp_path / "out.json")
    made = execute([case(0), case(1, case(0).key)], in_pool(tell_process, 1, 60.0), store)
    assert len({one.result.message for one in made}) == 1
    assert made[0].result.message != str(os.getpid())


def test_a_case_whose_reference_was_not_computed_is_not_computed(tmp_path: Path) -> None:
    store = TextStore(tmp_path / "out.json")
    (made,) = in_this_process([case(1, case(0).key)], store)
    assert not made.is_computed
    assert store.read() == {}


def test_a_process_that_dies_leaves_no_record_and_the_same_call_tries_again(tmp_path: Path) -> None:
    store = TextStore(tmp_path / "out.json")
    cases = [case(1), case(13), case(2, case(13).key)]
    made = {one.case.key: one for one in execute(cases, in_pool(perform, 2, 60.0), store)}
    assert made[case(13).key].result.status == "worker_died"
    assert made[cases[2].key].result.status == "no_reference"
    assert set(store.read()) == {case(1).key}
    parts = tmp_path / "out.json.parts"
    parts.mkdir()
    (tmp_path / "survives").touch()
    assert all(one.is_computed for one in execute(cases, in_pool(perform, 2, 60.0), store))
    assert set(store.read()) == {one.key for one in cases}


def test_an_interrupted_call_goes_on_where_it_stopped(tmp_path: Path) -> None:
    store = TextStore(tmp_path / "out.json")

    def interrupt(done: int, total: int, _outcome: Outcome) -> None:
        assert (done, total) == (1, 3)
        raise KeyboardInterrupt

    cases = [case(1), case(2), case(3)]
    with pytest.raises(KeyboardInterrupt):
        execute(cases, in_pool(perform, 0, 10.0), store, interrupt)
    assert not store.path.exists()
    assert len(in_this_process(cases, store)) == 2
    assert set(store.read()) == {one.key for one in cases}


def test_two_processes_do_not_write_one_output(tmp_path: Path) -> None:
    store = TextStore(tmp_path / "out.json")

    def start_another(_done: int, _total: int, _outcome: Outcome) -> None:
        with ThreadPoolExecutor(1) as other:  # what this thread has locked it may enter again
            other.submit(in_this_process, [case(2)], TextStore(tmp_path / "out.json")).result()

    with pytest.raises(InputError, match=rf"another process is writing it now \(process {os.getpid()} on "):
        execute([case(1)], in_pool(perform, 0, 10.0), store, start_another)
    in_this_process([case(2)], store)
    assert set(store.read()) == {case(1).key, case(2).key}


def test_a_key_stands_for_all_that_decides_a_record() -> None:
    one = case(1)
    others = [
        replace(one, scene=replace(SCENE, gravity=9.0)),
        replace(one, scene=replace(SCENE, name="other")),
        replace(one, method="lagrange/radau"),
        replace(one, settings={"relative_tolerance": 1e-3}),
        replace(one, study="other"),
        replace(one, options={"number": 2}),
        replace(one, reference="x"),
        replace(one, sources=("studies/run.py",)),
    ]
    assert len({one.key, *(other.key for other in others)}) == 1 + len(others)
    same = replace(one, scene=replace(SCENE, title="other words", text="# a comment"))
    assert same.key == one.key
