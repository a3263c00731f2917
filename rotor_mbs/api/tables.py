"""Return tables as pandas DataFrames with units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rotor_mbs.runs.hdf5 import Column


def data_frame(values: Mapping[str, Any], about: Mapping[str, Column], index: Any = None) -> Any:
    """Return a pandas DataFrame whose `attrs` have the unit of each column.

    Parameters
    ----------
    values : columns by name.
    about : what they are, by name; `attrs[NAME]` has `units` and `long_name` of each.
    index : labels of the rows; by default they are numbered.
    """
    import pandas as pd  # late: 0.3 s

    table = pd.DataFrame(dict(values), index=index)
    for name in values:
        if name in about:
            table.attrs[name] = {"units": about[name].units, "long_name": about[name].long_name}
    return table
