"""Check accuracy in Python: `rm.check`, `rm.test_method`, and what they return."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any, overload

from rotor_mbs.analysis.checks import Check
from rotor_mbs.analysis.text_tables import TextTable
from rotor_mbs.api.runs import texts
from rotor_mbs.api.tables import data_frame
from rotor_mbs.methods.catalogue import check_names
from rotor_mbs.methods.time_limit import valid_seconds
from rotor_mbs.scenario.accuracy_bounds import read_bounds, shipped_bounds
from rotor_mbs.scenario.keys import counted
from rotor_mbs.scenario.toml_file import file_path

_COLUMNS = (
    "check",
    "scene",
    "method",
    "channel",
    "passed",
    "value",
    "allowed",
    "unit",
    "reason",
)


class Checks(Sequence[Check]):
    """A sequence of checks, each of which compares a number with a bound.

    It prints as a table of the failed checks, and the numbers of passed and failed checks.

    Attributes
    ----------
    passed : whether all checks passed.
    failures : the checks that failed.
    """

    def __init__(self, checks: Iterable[Check]) -> None:
        self._checks = tuple(checks)

    @property
    def passed(self) -> bool:
        """Return whether all checks passed."""
        return not self.failures

    @property
    def failures(self) -> tuple[Check, ...]:
        """Return the checks that failed."""
        return tuple(check for check in self._checks if not check.passed)

    @overload
    def __getitem__(self, place: int) -> Check: ...
    @overload
    def __getitem__(self, place: slice) -> Checks: ...
    def __getitem__(self, place: int | slice) -> Check | Checks:
        return Checks(self._checks[place]) if isinstance(place, slice) else self._checks[place]

    def __len__(self) -> int:
        return len(self._checks)

    def table(self) -> Any:
        """Return a pandas DataFrame with a row per check.

        The columns are the name of the check, scene, method and channel, whether the check passed,
        value and bound with their unit, and the probable reason of a failure.
        """
        values: dict[str, list[Any]] = {name: [] for name in _COLUMNS}
        for check in self._checks:
            reason = "" if check.passed else check.hint
            row = check.name, *check.where, check.passed, check.value, check.bound, check.unit
            for name, value in zip(_COLUMNS, (*row, reason), strict=True):
                values[name].append(value)
        return data_frame(values, {})

    def __repr__(self) -> str:
        text = (
            f"{counted(len(self) - len(self.failures), 'check')} passed, {len(self.failures)} "
            "failed"
        )
        return f"{_failures(self.failures)}\n{text}" if self.failures else text

    def _repr_html_(self) -> str:
        return f"<pre>{escape(repr(self))}</pre>"


def _failures(checks: Iterable[Check]) -> TextTable:
    """Return a table of checks that failed, for a screen."""
    rows: list[tuple[str, ...]] = []
    for check in checks:
        numbers = (f"{check.value:.1e}", f"{check.bound:.1e}", check.unit)
        rows.append((check.name, *check.where, *numbers, check.hint))
    return TextTable(
        ("check", "scene", "method", "channel", "value", "allowed", "unit", "reason"), rows
    )


def check(
    path: str | os.PathLike[str],
    *,
    bounds: str | os.PathLike[str] | None = None,
    require: str | Iterable[str] = (),
) -> Checks:
    """Check the accuracy of the runs in a results file or a sweep.

    Parameters
    ----------
    path : the results file or the file of a sweep.
    bounds : TOML file of bounds that are added to the shipped bounds.
    require : names of methods; a check fails if a scene has no run of such a method.

    Raises
    ------
    InputError
        If the file has no runs to check, or `bounds` is not a valid file of bounds.
    StoreError
        If the results file cannot be read or is not of this program.
    TypeError
        For an argument of a wrong type.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> scene = rm.scene("paper/fig03").replace(duration=0.5, samples=51)
    >>> path = rm.run(scene, ["exudyn_tree/rk67"]).save("fig03.h5")      # doctest: +SKIP
    >>> rm.check("fig03.h5").passed                                      # doctest: +SKIP
    True
    """
    from rotor_mbs.studies.check import check_file  # not at the top: it loads the models

    known = shipped_bounds()
    if bounds is not None:
        known = known.with_entries(read_bounds(file_path(bounds)))
    return Checks(
        check_file(
            file_path(path), known, [require] if isinstance(require, str) else texts(require)
        )
    )


def test_method(name: str | os.PathLike[str], *, timeout: float = 60.0) -> Checks:  # noqa: PT028  (no test)
    """Test a method: order, symmetry, energies, loads and refusals, with the causes of faults.

    Parameters
    ----------
    name : name of a method, or path of a Python file with your own methods (docs/your-engine.md).
    timeout : time limit of each run (s).

    Raises
    ------
    InputError
        For an unknown method, or a Python file without a method.
    TypeError
        For an argument of a wrong type.

    Examples
    --------
    >>> import rotor_mbs as rm
    >>> rm.test_method("lagrange/dop853").passed                         # doctest: +SKIP
    True
    """
    from rotor_mbs.studies.method_test import examine  # not at the top: it loads the models

    seconds = valid_seconds(timeout)
    return Checks(
        made for method in check_names(os.fspath(name)) for made in examine(method, seconds)
    )


test_method.__test__ = False  # type: ignore[attr-defined]  # pytest must not collect it
