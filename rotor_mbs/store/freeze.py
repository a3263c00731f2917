"""A file of references cut down to what cannot be computed again cheaply: the files under `reference/`."""

from __future__ import annotations

from pathlib import Path

from rotor_mbs.solution.quantities import BUILT_IN
from rotor_mbs.store import hdf5, layout
from rotor_mbs.store.digests import write_digests
from rotor_mbs.store.read import open_results
from rotor_mbs.store.write import put_datasets

# What cannot be computed again from angles and rates, and the scales.
_KEPT = ("time", "coordinate", "angles", "rates", "work", "angle_uncertainty", "error_growth")


def freeze(source: Path, target: Path, date: str) -> None:
    """Angles, rates, uncertainty and growth of every reference in `source` into `target`, atomically; digests too.

    Tip and energies follow from angles and rates. The work is kept only where it does not. Raises StoreError.
    """
    with open_results(source) as results, hdf5.new_file(target) as file:
        for scene in results.scenes.values():
            reference = scene.reference
            if reference is None:
                continue
            hdf5.put_attributes(hdf5.new_group(file, scene.name), scene.attributes)
            group = hdf5.new_group(file, f"{scene.name}/{layout.REFERENCE}")
            arrays = {name: reference.array(name) for name in _KEPT if name in reference}
            put_datasets(group, arrays, BUILT_IN, reference.labels)
            kept = ("settings", "steps", "time_reached", "setup_time_s", "run_time_s", "output_time_s", "status")
            facts = {name: reference.attributes[name] for name in kept}
            made = f"heyoka {results.attributes['heyoka']}, {date}"
            hdf5.put_attributes(group, {**facts, "frozen_with": made})
    write_digests(target)
