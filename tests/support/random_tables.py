"""Tables of one motion as people write them: random names, formats, numbers, units and orders of
rows."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import scipy.io
import xarray as xr

Array = Any

FILES = ("csv", "txt", "json", "jsonl", "npz", "mat", "nc", "h5")
TABLES = (*FILES, "mapping", "DataFrame", "Dataset")
PRECISIONS = ("float64", "float32", "9 digits")
# By kind of channel, spellings of units and what the SI unit is of them.
UNITS = {
    "time": [("s", 1.0), ("sec", 1.0), ("ms", 1e3), ("milliseconds", 1e3), ("min", 1.0 / 60.0)],
    "angle": [
        ("rad", 1.0),
        ("radian", 1.0),
        ("deg", 180.0 / np.pi),
        ("degrees", 180.0 / np.pi),
        ("turns", 0.5 / np.pi),
    ],
    "rate": [
        ("rad/s", 1.0),
        ("rad s^-1", 1.0),
        ("radian/second", 1.0),
        ("deg/s", 180.0 / np.pi),
        ("rpm", 30.0 / np.pi),
        ("1/s", 1.0),
    ],
}
# Names of the time, the rotor, a pitch with its number, and their rates.
WORDS = [
    ("time", "rotor", "pitch {}", "rotor rate", "pitch {} rate"),
    ("t", "azimuth", "theta{}", "omega", "theta{}_dot"),
    ("Time", "psi", "beta_{}", "psi_dot", "beta_{}_dot"),
    ("ZEIT", "Rotor_Angle", "Blade_Pitch_{}", "Rotor_Speed", "Blade_Pitch_{}_Vel"),
    ("time", "phi", "theta[{}]", "der(phi)", "der(theta[{}])"),
]
# Names of columns of an array, and the number of the first.
ARRAYS = [
    ("q[{}]", "qd[{}]", 0),
    ("q[{}]", "qd[{}]", 1),
    ("q[{}]", "der(q[{}])", 1),
    ("qpos_{}", "qvel_{}", 0),
    ("angles[{}]", "rates[{}]", 1),
    ("q({})", "qdot({})", 1),
    ("q[{},1]", "qd[{},1]", 1),
]
MATRICES = [("angles", "rates"), ("q", "qd"), ("qpos", "qvel"), ("Coordinates", "Coordinates_t")]


@dataclass(frozen=True)
class RandomTable:
    """A table and what it is.

    data : a file, or a table in memory. text : what it is, for messages. others : names that no
        channel has.
    """

    data: Any
    text: str
    others: tuple[str, ...]


def random_table(
    folder: Path, seed: int, time: Array, angles: Array, rates: Array | None
) -> RandomTable:
    """Write a motion, (n,) s, (n, 4) rad and rad/s, as `seed` has it."""
    rng = np.random.default_rng(seed)

    def choice(options: Any) -> Any:
        return options[int(rng.integers(len(options)))]

    kind, precision = choice(TABLES), choice(PRECISIONS)
    has_arrays = kind in ("npz", "mat", "nc", "h5", "json", "mapping", "Dataset")
    # A variable of MATLAB has a plain name, without marks and unit.
    is_matrix = has_arrays and (rng.random() < 0.4 or kind == "mat")
    units = {
        channel: spellings[0] if kind == "mat" else choice(spellings)
        for channel, spellings in UNITS.items()
    }
    order = choice(["as it is", "as it is", "reversed", "shuffled", "twice", "before 0"])
    rows = np.arange(len(time))
    if order == "reversed":
        rows = rows[::-1]
    elif order == "shuffled":
        rows = rng.permutation(rows)
    elif order == "twice":
        rows = np.insert(rows, 7, 6)
    elif order == "before 0":
        rows = np.insert(rows, 0, [0, 0])
    times = time[rows]
    if order == "before 0":
        times = np.concatenate([[-0.3, -0.1], time])

    columns: dict[str, tuple[str, Array]] = {}  # by name: kind and numbers
    names = choice(WORDS)
    columns[names[0]] = ("time", times)
    if is_matrix:
        of_angles, of_rates = choice(MATRICES)
        columns[of_angles] = ("angle", angles[rows])
        if rates is not None:
            columns[of_rates] = ("rate", rates[rows])
    elif rng.random() < 0.5:
        of_angles, of_rates, first = choice(ARRAYS)
        for i in range(4):
            columns[of_angles.format(first + i)] = ("angle", angles[rows, i])
            if rates is not None:
                columns[of_rates.format(first + i)] = ("rate", rates[rows, i])
    else:
        for i in range(4):
            columns[names[2].format(i) if i else names[1]] = ("angle", angles[rows, i])
            if rates is not None:
                columns[names[4].format(i) if i else names[3]] = ("rate", rates[rows, i])
    others = []
    for number in range(int(rng.integers(3))):
        name = choice(["wind_{}", "GenTq_{}", "x_{}", "acc_{}", "noise{}"]).format(number + 1)
        others.append(name)
        columns[name] = ("", rng.normal(size=len(rows)))
    named = list(columns.items())
    # Columns of one array keep their order, as everywhere.
    if not is_matrix and rng.random() < 0.5:
        named.sort(key=lambda item: item[1][0])
    in_attributes = kind in ("nc", "h5", "Dataset")
    arrays, attributes = {}, {}
    for name, (channel, numbers) in named:
        unit, factor = units.get(channel, ("", 1.0))
        written = numbers * factor
        if precision == "float32":
            written = written.astype(np.float32)
        elif precision == "9 digits":
            written = np.vectorize(lambda number: float(f"{number:.8e}"))(written)
        label = name
        if unit and not in_attributes and kind != "mat":
            label = choice([f"{name} [{unit}]", f"{name} ({unit})", f"{name} in {unit}"])
        attributes[label] = {"units": unit} if unit else {}
        arrays[label] = written
    text = f"{seed}: {kind}, {precision}, {order}, {list(arrays)}"
    return RandomTable(write_table(folder, kind, arrays, attributes), text, tuple(others))


def write_table(
    folder: Path,
    kind: str,
    arrays: dict[str, Array],
    attributes: dict[str, dict[str, str]] | None = None,
) -> Any:
    """Return a table in memory, or the file that is written; arrays (n,) or (n, k), attributes by
    name."""
    attributes = attributes or {name: {} for name in arrays}
    if kind in ("csv", "txt", "jsonl", "DataFrame"):
        # Which have columns alone.
        columns = {}
        for name, values in arrays.items():
            if values.ndim == 1:
                columns[name] = values
            else:
                columns |= {f"{name}[{i}]": values[:, i] for i in range(values.shape[1])}
        arrays = columns
    if kind == "mapping":
        return arrays
    if kind == "DataFrame":
        return pd.DataFrame(arrays)
    if kind == "Dataset":
        variables = {}
        for name, values in arrays.items():
            variables[name] = (("row", f"of {name}")[: values.ndim], values, attributes[name])
        return xr.Dataset(variables)
    path = folder / f"table.{kind}"
    if kind == "csv":
        pd.DataFrame(arrays).to_csv(path, index=False)
    elif kind == "txt":
        pd.DataFrame(arrays).to_csv(path, index=False, sep="\t")
    elif kind == "json":
        path.write_text(
            json.dumps({name: values.astype(float).tolist() for name, values in arrays.items()})
        )
    elif kind == "jsonl":
        rows = pd.DataFrame(
            {name: values.astype(float) for name, values in arrays.items()}
        ).to_dict("records")
        path.write_text("\n".join(json.dumps(row) for row in rows))
    elif kind == "npz":
        np.savez(path, **arrays)
    elif kind == "mat":
        scipy.io.savemat(path, arrays)
    else:
        with h5py.File(path, "w") as file:
            for name, values in arrays.items():
                stored = file.create_dataset(name, data=values)
                stored.attrs.update(attributes[name])
    return path
