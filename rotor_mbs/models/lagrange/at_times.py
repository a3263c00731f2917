"""The closed form in double precision at chosen times, as it is or with some of its terms left out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from rotor_mbs.models.lagrange import samples
from rotor_mbs.models.lagrange.closed_form import accelerations
from rotor_mbs.models.lagrange.heyoka_adapter import is_available
from rotor_mbs.models.lagrange.ode_solvers import OdeSolver, scipy_integrator
from rotor_mbs.models.lagrange.parameters import Number
from rotor_mbs.models.lagrange.system import Propagation, build_system
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Trajectory

_TAYLOR = 2.0**-52
_DOP853 = (1e-12, 1e-14)


def motion_at(scene: Scene, times: Array) -> Trajectory:
    """The motion at `times`, (n,) s, increasing from 0 up to the duration at most; fewer rows where it ends early."""
    if not is_available():
        return _by_scipy(scene, times, accelerations)
    # Compact: a scene of another structure is compiled anew, and is mostly run a few times.
    run = Propagation(scene, build_system(scene), times=times, tol=_TAYLOR, compact_mode=True, high_accuracy=True)
    run.run()
    return samples.trajectory(scene, times, run.states)


def motion_without(scene: Scene, times: Array, terms: str) -> Trajectory:
    """As `motion_at`, by equations without the terms of that name in `LEFT_OUT`."""
    return _by_scipy(scene, times, LEFT_OUT[terms])


def _by_scipy(scene: Scene, times: Array, equations: Callable[..., list[Number]]) -> Trajectory:
    solver = OdeSolver(scene, scipy_integrator("DOP853", *_DOP853), times, equations)
    solver.integrate()
    return solver.observe()


# The accelerations are linear in the dampers' moments and quadratic in the rates otherwise; with one kind of rate at a
# time, and with rates reversed, each kind of product is taken out without another text of the equations.


def _spin(rates: Sequence[Number]) -> list[Number]:
    return [rates[0], *(0.0 for _ in rates[1:])]


def _still(rates: Sequence[Number]) -> list[Number]:
    return [0.0 for _ in rates]


def _reversed(rates: Sequence[Number]) -> list[Number]:
    return [-rate for rate in rates]


def _without_coriolis(angles: Sequence[Number], rates: Sequence[Number], *rest: Any) -> list[Number]:
    spin, pitches, still = (
        np.array(accelerations(angles, chosen, *rest)) for chosen in (_spin(rates), [0.0, *rates[1:]], _still(rates))
    )
    return (spin + pitches - still).tolist()  # type: ignore[no-any-return]


def _without_centrifugal(angles: Sequence[Number], rates: Sequence[Number], *rest: Any) -> list[Number]:
    spin = _spin(rates)
    whole, forth, back, still = (
        np.array(accelerations(angles, chosen, *rest)) for chosen in (rates, spin, _reversed(spin), _still(rates))
    )
    return (whole - 0.5 * (forth + back) + still).tolist()  # type: ignore[no-any-return]


def _without_products(angles: Sequence[Number], rates: Sequence[Number], *rest: Any) -> list[Number]:
    forth, back, still = (
        np.array(accelerations(angles, chosen, *rest)) for chosen in (rates, _reversed(rates), _still(rates))
    )
    return (0.5 * (forth - back) + still).tolist()  # type: ignore[no-any-return]


LEFT_OUT: Mapping[str, Callable[..., list[Number]]] = {
    "Coriolis terms (products of rotor rate and pitch rate)": _without_coriolis,
    "centrifugal terms (square of the rotor rate)": _without_centrifugal,
    "terms with products of rates": _without_products,
}
