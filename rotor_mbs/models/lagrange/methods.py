"""The closed form on plain floats, by method. Importing this does not load SciPy."""

from __future__ import annotations

from functools import partial

from rotor_mbs.methods.base import Method
from rotor_mbs.models.lagrange.integrators import ode45_integrator, scipy_integrator
from rotor_mbs.models.lagrange.ode_solvers import PlainMethod

METHODS: dict[str, Method] = {
    "lagrange/ode45": PlainMethod(ode45_integrator, 1e-6, 1e-9),
    "lagrange/dop853": PlainMethod(partial(scipy_integrator, "DOP853"), 3e-14, 1e-16),
    "lagrange/radau": PlainMethod(partial(scipy_integrator, "Radau"), 1e-8, 1e-11),
}
