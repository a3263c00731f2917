"""Open any file that the program wrote: `rm.open`."""

from __future__ import annotations

import os
from typing import Any

from rotor_mbs.runs.design import RUNS
from rotor_mbs.runs.table import TableFile
from rotor_mbs.runs.trailer import COMPARISON, MODES, RESULTS, read_trailer
from rotor_mbs.scenario.toml_file import file_path


def open(path: str | os.PathLike[str]) -> Any:
    """Open a file that this program wrote.

    Parameters
    ----------
    path : path of the file.

    Returns
    -------
    Results
        For a results file or a sweep. The labels of a file with one scene are method names.
    Modes
        For a file of modes; a dict by scene name if the file has several scenes.
    DataComparison
        For a file of a comparison; a dict by "scene/name" if the file has several comparisons.
    BenchCurves
        For a results file with the curves of `rotor-mbs bench`, but without runs.

    Raises
    ------
    StoreError
        For any other file, and for a damaged file.
    TypeError
        If `path` is neither text nor a path.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> runs = rm.open("rotor-mbs-out/results.h5")            # doctest: +SKIP
    >>> runs["paper/fig11"].table()                           # doctest: +SKIP
    >>> runs["paper/fig11/lagrange/taylor"].angles.shape      # doctest: +SKIP
    (1001, 4)
    """
    file = file_path(path)
    kind = read_trailer(file).kind
    # A module is imported only for its kind of file: modes need SciPy, and runs do not.
    if kind == MODES:
        from rotor_mbs.api.modes import open_modes

        return open_modes(file)
    if kind == COMPARISON:
        from rotor_mbs.api.comparisons import open_comparisons

        return open_comparisons(file)
    groups = TableFile(file, ()).groups
    if kind == RESULTS and RUNS not in groups and "bench" in groups:
        from rotor_mbs.api.benches import BenchCurves

        return BenchCurves(file)
    from rotor_mbs.api.results import Results

    runs = Results(file)
    return Results(file, runs.scenes[0]) if kind == RESULTS and len(runs.scenes) == 1 else runs
