"""Verdicts of one results file against those of an earlier one: what still passes, but by less."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from rotor_mbs.analysis.verdicts import Verdict

# A value below a few units in the last place of a double is rounding: its change says nothing.
_ROUNDING = 2.0**-50


def regressions(new: Sequence[Verdict], old: Sequence[Verdict], factor: float) -> list[Verdict]:
    """One verdict for every earlier one: how many times its margin has shrunk, against `factor`.

    Parameters
    ----------
    new, old : verdicts of the same checks, made with the same bounds.
    factor : allowed ratio of the earlier margin to the present one, at least 1.

    Returns
    -------
    list of Verdict
        Check "against", in the order of `old`. The value is NaN, which fails, where `new` lacks the verdict, and
        infinite where a verdict that passed fails. A verdict that failed before and fails now is no regression.

    Examples
    --------
    >>> was = Verdict("energy", "paper/fig08", "exudyn_tree/rk67", "balance", 1e-12, 1e-9, "of scale", "")
    >>> [found] = regressions([replace(was, value=6.4e-11)], [was], factor=10.0)
    >>> round(found.value), found.passed
    (64, False)
    """
    present = {_key(verdict): verdict for verdict in new}
    return [_compared(present.get(_key(verdict)), verdict, factor) for verdict in old]


def _key(verdict: Verdict) -> tuple[str, str, str, str]:
    return verdict.check, verdict.scene, verdict.method, verdict.channel


def _compared(new: Verdict | None, old: Verdict, factor: float) -> Verdict:
    if new is None:
        value, look = math.nan, "was judged in the earlier file and is not in this one"
    else:
        value = _shrinkage(new, old)
        look = f"{old.value:.2e} before, {new.value:.2e} now, bound {new.bound:.2e} {new.unit}; {new.look_at}"
    channel = f"{old.check}: {old.channel}"
    return replace(
        old, check="against", channel=channel, value=value, bound=factor, unit="times the margin", look_at=look
    )


def _shrinkage(new: Verdict, old: Verdict) -> float:
    if not new.passed:
        return math.inf if old.passed else 1.0
    if not old.passed:
        return 0.0
    before, now = max(old.value, _ROUNDING), max(new.value, _ROUNDING)
    return (now / before) * (old.bound / new.bound if new.bound and old.bound else 1.0)
