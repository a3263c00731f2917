"""The closed form's methods by name. Importing this loads neither heyoka nor SciPy."""

from __future__ import annotations

from rotor_mbs.models.base import Method
from rotor_mbs.models.lagrange import reference, taylor
from rotor_mbs.models.lagrange.scipy_run import dop853, radau

METHODS: dict[str, Method] = {
    "lagrange/taylor": taylor,
    "lagrange/dop853": dop853,
    "lagrange/radau": radau,
    "reference": reference,
}
