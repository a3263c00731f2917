"""The closed form's methods by name. Importing this loads neither heyoka nor SciPy."""

from __future__ import annotations

from functools import partial

from rotor_mbs.models.base import Method
from rotor_mbs.models.lagrange import reference, taylor
from rotor_mbs.models.lagrange.integrators import ode45_integrator, scipy_integrator
from rotor_mbs.models.lagrange.plain import PlainMethod

METHODS: dict[str, Method] = {
    "lagrange/taylor": taylor,
    "lagrange/ode45": PlainMethod(ode45_integrator, 1e-6, 1e-9),
    "lagrange/dop853": PlainMethod(partial(scipy_integrator, "DOP853"), 3e-14, 1e-16),
    "lagrange/radau": PlainMethod(partial(scipy_integrator, "Radau"), 1e-8, 1e-11),
    "reference": reference,
}
