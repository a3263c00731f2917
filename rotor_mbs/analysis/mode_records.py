"""Modes as records of a results file, and back.

/modes/<scene>/<model>/rest        equilibrium under gravity, one row of `speed`
/modes/<scene>/<model>/rotation    steady rotation without gravity: the Campbell diagram
/modes/<scene>/lagrange/floquet    multipliers of a turn under gravity
/modes/<scene>/lagrange/chart      the largest of them over speed and bearing stiffness
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

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
from rotor_mbs.analysis.modes import Complex, ModeSet, multiblade
from rotor_mbs.errors import InputError, StoreError
from rotor_mbs.store.layout import Column
from rotor_mbs.store.records import Record, read_records

_SPEED = Column(("speed",), "rad/s", "rotor speed")
_LINEAR = {
    "speed": _SPEED,
    "mode": Column(("mode",), "1", "number of the mode, names in the attribute labels"),
    "coordinate": Column(("coordinate",), "1", "coordinate that moves, names in the attribute labels"),
    "component": Column(("component",), "1", "rotor and multiblade coordinate, names in the attribute labels"),
    "equation": Column(("equation",), "1", "equation of motion, of the coordinate with the same number"),
    "root": Column(("root",), "1", "both eigenvalues of a mode"),
    "steady_angle": Column(("speed", "coordinate"), "rad", "angle at the steady state"),
    "undamped_frequency": Column(("speed", "mode"), "rad/s", "undamped frequency, in the rotor's frame"),
    "damped_frequency": Column(("speed", "mode"), "rad/s", "damped frequency, in the rotor's frame"),
    "damping_ratio": Column(("speed", "mode"), "1", "share of critical damping"),
    "growth_rate": Column(("speed", "mode"), "1/s", "largest real part of the mode's eigenvalues"),
    "backward_whirl_frequency": Column(("speed", "mode"), "rad/s", "damped frequency less speed, in the base frame"),
    "forward_whirl_frequency": Column(("speed", "mode"), "rad/s", "damped frequency plus speed, in the base frame"),
    "eigenvalue_real": Column(("speed", "mode", "root"), "1/s", "eigenvalue, real part"),
    "eigenvalue_imag": Column(("speed", "mode", "root"), "1/s", "eigenvalue, imaginary part"),
    "shape_real": Column(("speed", "mode", "coordinate"), "1", "mode shape, real part, largest entry 1"),
    "shape_imag": Column(("speed", "mode", "coordinate"), "1", "mode shape, imaginary part"),
    "multiblade_shape_real": Column(("speed", "mode", "component"), "1", "multiblade mode shape, real part"),
    "multiblade_shape_imag": Column(("speed", "mode", "component"), "1", "multiblade mode shape, imaginary part"),
    "stiffness": Column(("speed", "equation", "coordinate"), "1/s^2", "stiffness, mass matrix divided out"),
    "damping": Column(("speed", "equation", "coordinate"), "1/s", "damping and gyroscopic terms, mass divided out"),
}
_FLOQUET = {
    "speed": _SPEED,
    "multiplier": Column(("multiplier",), "1", "number of the multiplier, the largest first"),
    "multiplier_real": Column(("speed", "multiplier"), "1", "Floquet multiplier, real part"),
    "multiplier_imag": Column(("speed", "multiplier"), "1", "Floquet multiplier, imaginary part"),
    "largest_multiplier": Column(("speed",), "1", "largest modulus, multipliers that are always 1 left out"),
    "growth_rate": Column(("speed",), "1/s", "its logarithm over the time of a turn"),
    "stable": Column(("speed",), "1", "1 where no multiplier is above 1, 0 where one is, -1 where not known"),
    "product_error": Column(("speed",), "1", "logarithm of the product of the multipliers less the integrated trace"),
    "torque": Column(("speed",), "N m", "torque on the rotor that keeps its mean speed"),
    "mismatch": Column(("speed",), "rad", "what the periodic motion misses after a turn"),
}
_CHART = {
    "bearing_stiffness": Column(("bearing_stiffness",), "N m/rad", "stiffness of every pitch bearing"),
    "speed": _SPEED,
    "largest_multiplier": Column(
        ("bearing_stiffness", "speed"), "1", "largest modulus of a multiplier, those that are always 1 left out"
    ),
}


def linear_dataset(sources: Mapping[str, LinearModes], xarray: Any) -> Any:
    """All sources of one state as an xarray.Dataset with the dimension `solver`; `xarray` is the module."""
    if not sources:
        raise InputError("no modes of this state; allowed: a state that was computed")
    sets = []
    for one in sources.values():
        record = _linear_record("", one, {})
        labels = {name: record.attributes.get(f"{name}_labels") for name in _LINEAR}
        variables = {
            name: (column.dimensions, labels[name] or values, {"units": column.units, "long_name": column.long_name})
            for name, column in _LINEAR.items()
            for values in (record.arrays[name],)
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
        records.append(_floquet_record(modes.scene, modes.floquet, common))
    if modes.chart is not None:
        chart = modes.chart
        arrays = {
            "bearing_stiffness": chart.stiffnesses,
            "speed": chart.speeds,
            "largest_multiplier": chart.largest,
        }
        records.append(Record("modes", modes.scene, f"lagrange/{CHART}", common, arrays, _CHART))
    return records


def _linear_record(scene: str, one: LinearModes, common: Mapping[str, Any]) -> Record:
    components = ("rotor", *multiblade(one.blades)[0])
    backward, forward = one.whirl
    n = np.arange(len(one.coordinates))
    arrays: dict[str, NDArray[Any]] = {
        "speed": one.speeds,
        "mode": n,
        "coordinate": n,
        "component": np.arange(len(components)),
        "equation": n,
        "root": np.arange(2),
        "steady_angle": one.angles,
        "undamped_frequency": one.over_speed("undamped_frequencies"),
        "damped_frequency": one.over_speed("damped_frequencies"),
        "damping_ratio": one.over_speed("damping_ratios"),
        "growth_rate": one.over_speed("growth_rates"),
        "backward_whirl_frequency": backward,
        "forward_whirl_frequency": forward,
        "stiffness": one.stiffness,
        "damping": one.damping,
    }
    for name, values in (
        ("eigenvalue", one.eigenvalues),
        ("shape", one.shapes),
        ("multiblade_shape", one.multiblade_shapes),
    ):
        arrays[f"{name}_real"], arrays[f"{name}_imag"] = values.real, values.imag
    attributes = {
        **common,
        "label": one.label,
        "mode_labels": list(one.names),
        "symmetric": bool(one.sets[0].names),
        "coordinate_labels": list(one.coordinates),
        "component_labels": list(components),
        "messages": list(one.messages),
    }
    return Record("modes", scene, f"{one.source}/{one.kind}", attributes, arrays, _LINEAR)


def _floquet_record(scene: str, table: FloquetTable, common: Mapping[str, Any]) -> Record:
    arrays: dict[str, NDArray[Any]] = {
        "speed": table.speeds,
        "multiplier": np.arange(table.multipliers.shape[1]),
        "multiplier_real": table.multipliers.real,
        "multiplier_imag": table.multipliers.imag,
        "largest_multiplier": table.largest,
        "growth_rate": table.growth_rates,
        "stable": table.stable,
        "product_error": table.product_error,
        "torque": table.torque,
        "mismatch": table.mismatch,
    }
    return Record("modes", scene, f"lagrange/{FLOQUET}", {**common, "messages": list(table.messages)}, arrays, _FLOQUET)


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
    names = ("rotor", *multiblade(int(facts["blades"]))[0]) if facts["symmetric"] else ()
    values, shapes = _complex(record, "eigenvalue"), _complex(record, "shape")
    source, _, kind = record.name.partition("/")
    return LinearModes(
        source=source,
        label=str(facts["label"]),
        kind=kind,
        blades=int(facts["blades"]),
        speeds=arrays["speed"],
        coordinates=tuple(map(str, facts["coordinate_labels"])),
        angles=arrays["steady_angle"],
        stiffness=arrays["stiffness"],
        damping=arrays["damping"],
        sets=tuple(ModeSet(value, shape, names) for value, shape in zip(values, shapes, strict=True)),
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
