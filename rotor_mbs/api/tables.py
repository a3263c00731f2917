"""Return tables as pandas DataFrames with units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rotor_mbs.runs.hdf5 import Column


def data_frame(values: Mapping[str, Any], about: Mapping[str, Column], index: Any = None) -> Any:
    """Return a pandas DataFrame whose `attrs` have the units of its columns.

    Parameters
    ----------
    values : columns by name.
    about : descriptions by name of a column; `attrs[NAME]` has the column's `units` and
        `long_name`.
    index : labels of the rows; by default the rows are numbered.
    """
    import pandas as pd  # not at the top: it takes 0.3 s

    table = pd.DataFrame(dict(values), index=index)
    for name in values:
        if name in about:
            table.attrs[name] = {"units": about[name].units, "long_name": about[name].long_name}
    return table
