"""Modes as records of a results file, and back.

/modes/<scene>/<model>/rest        equilibrium under gravity, one row of `speed`
/modes/<scene>/<model>/rotation    steady rotation without gravity: the Campbell diagram
/modes/<scene>/lagrange/floquet    multipliers of a turn under gravity
/modes/<scene>/lagrange/chart      the largest of them over speed and bearing stiffness
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rotor_mbs.analysis.campbell import (
    CHART,
    FLOQUET,
    REST,
    ROTATION,
    FloquetTable,
    LinearModes,
    SceneModes,
    StabilityChart,
)
from rotor_mbs.analysis.modes import Complex, multiblade
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.runs.files import Column
from rotor_mbs.runs.records import Record, read_records

# By name: values, and what they are.
Datasets: TypeAlias = Mapping[str, tuple[NDArray[Any], Column]]
_SPEED = Column(("speed",), "rad/s", "rotor speed")
_LARGEST = "largest modulus of a multiplier, those that are always 1 left out"


def linear_dataset(sources: Mapping[str, LinearModes], xarray: Any) -> Any:
    """All sources of one state as an xarray.Dataset with the dimension `solver`; `xarray` is the module."""
    if not sources:
        raise InputError("no modes of this state; allowed: a state that was computed")
    sets = []
    for one in sources.values():
        record = _linear_record("", one, {})
        variables = {
            name: (
                column.dimensions,
                record.attributes.get(f"{name}_labels", record.arrays[name]),
                {"units": column.units, "long_name": column.long_name},
            )
            for name, column in record.columns.items()
        }
        coordinates = {name: value for name, value in variables.items() if value[0] == (name,)}
        data = {name: value for name, value in variables.items() if name not in coordinates}
        sets.append(xarray.Dataset(data, coords=coordinates))
    return xarray.concat(sets, xarray.Variable("solver", list(sources)), join="override", combine_attrs="override")


def to_records(modes: SceneModes, attributes: Mapping[str, Any]) -> list[Record]:
    """The records of a results file; attributes: of every one of them, its key among them."""
    common = {
        "title": modes.title,
        "blades": modes.blades,
        "gravity": modes.gravity,
        "notes": "\n".join(modes.notes),
        **attributes,
    }
    records = [
        _linear_record(modes.scene, one, common) for kind in (modes.rest, modes.rotation) for one in kind.values()
    ]
    if modes.floquet is not None:
        facts = {**common, "messages": list(modes.floquet.messages)}
        records.append(_record(modes.scene, f"lagrange/{FLOQUET}", facts, _floquet_datasets(modes.floquet)))
    if modes.chart is not None:
        records.append(_record(modes.scene, f"lagrange/{CHART}", common, _chart_datasets(modes.chart)))
    return records


def _record(scene: str, name: str, attributes: Mapping[str, Any], datasets: Datasets) -> Record:
    arrays = {dataset: values for dataset, (values, _) in datasets.items()}
    return Record("modes", scene, name, attributes, arrays, {dataset: what for dataset, (_, what) in datasets.items()})


def _linear_record(scene: str, one: LinearModes, common: Mapping[str, Any]) -> Record:
    attributes = {
        **common,
        "label": one.label,
        "mode_labels": list(one.names),
        "symmetric": "rotor" in one.names,
        "coordinate_labels": list(one.coordinates),
        "component_labels": ["rotor", *multiblade(one.blades)[0]],
        "messages": list(one.messages),
    }
    return _record(scene, f"{one.source}/{one.kind}", attributes, _linear_datasets(one))


def _linear_datasets(one: LinearModes) -> Datasets:
    mode, shape = partial(Column, ("speed", "mode")), one.multiblade_shapes
    n, (backward, forward) = np.arange(len(one.coordinates)), one.whirl
    entry, part = partial(Column, ("speed", "equation", "coordinate")), partial(Column, ("speed", "mode", "component"))
    root, place = partial(Column, ("speed", "mode", "root")), partial(Column, ("speed", "mode", "coordinate"))
    return {
        "speed": (one.speeds, _SPEED),
        "mode": (n, Column(("mode",), "1", "number of the mode, names in the attribute labels")),
        "coordinate": (n, Column(("coordinate",), "1", "coordinate that moves, names in the attribute labels")),
        "component": (
            np.arange(shape.shape[2]),
            Column(("component",), "1", "rotor and multiblade coordinate, names in the attribute labels"),
        ),
        "equation": (n, Column(("equation",), "1", "equation of motion, of the coordinate with the same number")),
        "root": (np.arange(2), Column(("root",), "1", "both eigenvalues of a mode")),
        "steady_angle": (one.angles, Column(("speed", "coordinate"), "rad", "angle at the steady state")),
        "undamped_frequency": (one.undamped_frequencies, mode("rad/s", "undamped frequency, in the rotor's frame")),
        "damped_frequency": (one.damped_frequencies, mode("rad/s", "damped frequency, in the rotor's frame")),
        "damping_ratio": (one.damping_ratios, mode("1", "share of critical damping")),
        "growth_rate": (one.growth_rates, mode("1/s", "largest real part of the mode's eigenvalues")),
        "backward_whirl_frequency": (backward, mode("rad/s", "damped frequency less speed, in the base frame")),
        "forward_whirl_frequency": (forward, mode("rad/s", "damped frequency plus speed, in the base frame")),
        "eigenvalue_real": (one.eigenvalues.real, root("1/s", "eigenvalue, real part")),
        "eigenvalue_imag": (one.eigenvalues.imag, root("1/s", "eigenvalue, imaginary part")),
        "shape_real": (one.shapes.real, place("1", "mode shape, real part, largest entry 1")),
        "shape_imag": (one.shapes.imag, place("1", "mode shape, imaginary part")),
        "multiblade_shape_real": (shape.real, part("1", "multiblade mode shape, real part")),
        "multiblade_shape_imag": (shape.imag, part("1", "multiblade mode shape, imaginary part")),
        "stiffness": (one.stiffness, entry("1/s^2", "stiffness, mass matrix divided out")),
        "damping": (one.damping, entry("1/s", "damping and gyroscopic terms, mass divided out")),
    }


def _floquet_datasets(table: FloquetTable) -> Datasets:
    at, each = partial(Column, ("speed",)), partial(Column, ("speed", "multiplier"))
    count = Column(("multiplier",), "1", "number of the multiplier, the largest first")
    return {
        "speed": (table.speeds, _SPEED),
        "multiplier": (np.arange(table.multipliers.shape[1]), count),
        "multiplier_real": (table.multipliers.real, each("1", "Floquet multiplier, real part")),
        "multiplier_imag": (table.multipliers.imag, each("1", "Floquet multiplier, imaginary part")),
        "largest_multiplier": (table.largest, at("1", "largest modulus, multipliers that are always 1 left out")),
        "growth_rate": (table.growth_rates, at("1/s", "its logarithm over the time of a turn")),
        "stable": (table.stable, at("1", "1 where no multiplier is above 1, 0 where one is, -1 where not known")),
        "product_error": (
            table.product_error, at("1", "logarithm of the product of the multipliers less the integrated trace")
        ),
        "torque": (table.torque, at("N m", "torque on the rotor that keeps its mean speed")),
        "mismatch": (table.mismatch, at("rad", "what the periodic motion misses after a turn")),
    }  # fmt: skip


def _chart_datasets(chart: StabilityChart) -> Datasets:
    stiffness = Column(("bearing_stiffness",), "N m/rad", "stiffness of every pitch bearing")
    return {
        "bearing_stiffness": (chart.stiffnesses, stiffness),
        "speed": (chart.speeds, _SPEED),
        "largest_multiplier": (chart.largest, Column(("bearing_stiffness", "speed"), "1", _LARGEST)),
    }


def read_modes(path: Path) -> dict[str, SceneModes]:
    """By scene, all modes in a results file. Raises StoreError where the file cannot be read or has none."""
    found: dict[str, list[Record]] = {}
    for record in read_records(path, "modes"):
        found.setdefault(record.scene, []).append(record)
    if not found:
        raise StoreError(f"{path}: no modes in it; allowed: a file that rotor-mbs modes has written")
    return {scene: _from_records(scene, records) for scene, records in found.items()}


def _from_records(scene: str, records: Sequence[Record]) -> SceneModes:
    kinds = {record.name: record for record in records}
    linear = [_linear(record) for name, record in kinds.items() if name.endswith((f"/{REST}", f"/{ROTATION}"))]
    linear.sort(key=lambda one: one.source != "lagrange")
    first = records[0].attributes
    chart = kinds.get(f"lagrange/{CHART}")
    floquet = kinds.get(f"lagrange/{FLOQUET}")
    return SceneModes(
        scene,
        str(first["title"]),
        int(first["blades"]),
        float(first["gravity"]),
        {one.source: one for one in linear if one.kind == REST},
        {one.source: one for one in linear if one.kind == ROTATION},
        None if floquet is None else _floquet_table(floquet),
        None
        if chart is None
        else StabilityChart(*(chart.arrays[key] for key in ("speed", "bearing_stiffness", "largest_multiplier"))),
        tuple(str(first["notes"]).splitlines()),
    )


def _complex(record: Record, name: str) -> Complex:
    return np.asarray(record.arrays[f"{name}_real"] + 1j * record.arrays[f"{name}_imag"])


def _linear(record: Record) -> LinearModes:
    facts, arrays = record.attributes, record.arrays
    source, _, kind = record.name.partition("/")
    return LinearModes(
        eigenvalues=_complex(record, "eigenvalue"),
        shapes=_complex(record, "shape"),
        names=tuple(map(str, facts["mode_labels"])),
        source=source,
        label=str(facts["label"]),
        kind=kind,
        blades=int(facts["blades"]),
        speeds=arrays["speed"],
        coordinates=tuple(map(str, facts["coordinate_labels"])),
        angles=arrays["steady_angle"],
        stiffness=arrays["stiffness"],
        damping=arrays["damping"],
        messages=tuple(map(str, facts["messages"])),
    )


def _floquet_table(record: Record) -> FloquetTable:
    arrays = record.arrays
    return FloquetTable(
        speeds=arrays["speed"],
        multipliers=_complex(record, "multiplier"),
        largest=arrays["largest_multiplier"],
        stable=arrays["stable"],
        product_error=arrays["product_error"],
        torque=arrays["torque"],
        mismatch=arrays["mismatch"],
        messages=tuple(map(str, record.attributes["messages"])),
    )
