"""What is to be done for a sweep: its runs by method, cut into chunks, and the layout of its dataset."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from rotor_mbs.errors import InputError
from rotor_mbs.execution.environment import machine, numerics_fingerprint, versions
from rotor_mbs.methods.catalogue import check_names, find_method
from rotor_mbs.scenario.scene import scene_hash
from rotor_mbs.scenario.sweep import Sweep
from rotor_mbs.scenario.variants import Variants
from rotor_mbs.store.sweep_layout import SweepLayout
from rotor_mbs.studies.sweep_work import ENSEMBLE_METHOD, Chunk

# Runs handed to a worker at once by the fast path: an eighth of a second of work, fewer towards the end, so that all
# workers end together. The least is a full batch on any processor.
ENSEMBLE_RUNS = 128
_LEAST_RUNS = 8
_CHUNK_BYTES = 1 << 23

_FORMAT = 3  # of rows and columns: a sweep begun by another version is not continued


@dataclass(frozen=True)
class SweepPlan:
    """The runs of a sweep, or of one part of several, by its methods.

    first, last   of its runs; run r is row r mod rows of the design, by method r div rows
    """

    sweep: Sweep
    methods: tuple[str, ...]
    first: int
    last: int
    time_limit_s: float

    @property
    def rows(self) -> int:
        return self.sweep.design.count

    @property
    def layout(self) -> SweepLayout:
        return SweepLayout(self._identity(), self._attributes(), self.sweep, self.methods, self.first, self.last)

    def chunks(self, gaps: Sequence[tuple[int, int]], workers: int = 1) -> Iterator[Chunk]:
        """The runs of `gaps`, cut into what one of `workers` does at once."""
        variants, row = self.sweep.variants(), self.layout.row
        for first, _ in gaps[:1]:
            variants.scene(self.sweep.design.rows(first, first + 1)[0].tolist())
        left = sum(last - first for first, last in gaps)
        for gap in gaps:
            for first, last in self._by_method(*gap):
                method = self.methods[first // self.rows]
                while first < last:
                    end = min(first + self._chunk_size(method, row.itemsize, left // (2 * workers)), last)
                    yield self._chunk(variants, method, row, first, end)
                    first, left = end, left - (end - first)

    def _chunk(self, variants: Variants, method: str, row: np.dtype[np.void], start: int, end: int) -> Chunk:
        known = find_method(method).defaults
        settings = {key: value for key, value in self.sweep.table.settings.items() if key in known}
        return Chunk(variants, method, settings, row, start, self.sweep.design.rows(start, end), self.time_limit_s)

    @staticmethod
    def _chunk_size(method: str, row_bytes: int, share: int) -> int:
        if method != ENSEMBLE_METHOD:
            return 1
        return max(min(_CHUNK_BYTES // row_bytes, share, ENSEMBLE_RUNS) // _LEAST_RUNS, 1) * _LEAST_RUNS

    def _by_method(self, first: int, last: int) -> Iterator[tuple[int, int]]:
        """Spans of runs cut where the method changes."""
        while first < last:
            end = min(last, (first // self.rows + 1) * self.rows)
            yield first, end
            first = end

    def _identity(self) -> str:
        sweep, table = self.sweep, self.sweep.table
        content = [
            _FORMAT,
            scene_hash(sweep.base),
            sweep.keys,
            table.combine,
            [axis.is_drawn for axis in sweep.design.axes],
            self.methods,
            table.settings,
            sweep.outputs,
            table.precision,
            [table.validation, table.test],
            table.seed,
            [self.first, self.last],
            versions(),
            numerics_fingerprint(),
        ]
        digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
        for values in sweep.design.values:
            digest.update(values.tobytes())
        return digest.hexdigest()

    def _attributes(self) -> dict[str, object]:
        sweep, table = self.sweep, self.sweep.table
        return {
            "title": table.title,
            "sweep_toml": sweep.text,
            "base_scene": sweep.base.name,
            "scene_toml": sweep.base.text,
            "scene_hash": scene_hash(sweep.base),
            "combine": table.combine,
            "shape": json.dumps(sweep.design.shape),
            "seed": table.seed,
            "validation_share": table.validation,
            "test_share": table.test,
            "settings": json.dumps(table.settings, sort_keys=True),
            "runs_of_all_parts": self.rows * len(self.methods),
            **versions(),
            **machine(),
        }


def _chosen(sweep: Sweep, methods: Sequence[str]) -> tuple[str, ...]:
    """Those of the command line, else those of the file. Raises InputError."""
    if methods:
        return check_names(methods)
    try:
        return check_names(sweep.table.methods)
    except InputError as exc:
        raise InputError([sweep.problem(("methods",), f"methods: {words}") for words in exc.problems]) from exc


def plan_sweep(sweep: Sweep, methods: Sequence[str], part: tuple[int, int], time_limit_s: float) -> SweepPlan:
    """The runs of part k of n (1, 1 for all). Raises InputError, MethodRefusal where a method cannot do them."""
    chosen = _chosen(sweep, methods)
    known = {key for method in chosen for key in find_method(method).defaults}
    unknown = [key for key in sweep.table.settings if key not in known]
    if unknown:
        words = f"is no setting of {', '.join(chosen)}; allowed: {', '.join(sorted(known)) or 'none'}"
        raise InputError([sweep.problem(("settings", key), f"settings.{key}: {words}") for key in unknown])
    for method in chosen:
        # The fast path's engine refuses nothing, where it is there: this process need not load it.
        if method != ENSEMBLE_METHOD or find_spec("heyoka") is None:
            find_method(method).items(sweep.base)
    total = sweep.design.count * len(chosen)
    number, parts = part
    return SweepPlan(sweep, chosen, (number - 1) * total // parts, number * total // parts, time_limit_s)
