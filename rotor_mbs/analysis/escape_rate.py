"""How fast a pitch may leave zero in a scene: from its stored text. Knows no run."""

from __future__ import annotations

import math
import tomllib

from rotor_mbs.scenario.expression import ExpressionError, evaluate
from rotor_mbs.store.read import StoredScene


def escape_rate(scene: StoredScene) -> float | None:
    """1/s: sqrt(g/c) of the fastest blade, a pendulum about its pitch axis that stands upside down (below the shaft).

    A point mass at distance c from the pitch axis under gravity g; a spring changes it. None for blades with inertia
    of their own, for springs, and where nothing makes the pitch unstable.
    """
    try:
        tables = tomllib.loads(scene.attributes["scene_toml"])
        blades = tables["blade"] if isinstance(tables["blade"], list) else [tables["blade"]]
        gravity = _number(tables["gravity"])
        arms = [math.hypot(*(_number(x) for x in blade["centre_of_mass"][:2])) for blade in blades]
        rigid = any(_number(x) != 0.0 for blade in blades for x in blade.get("inertia", ()))
    except (KeyError, TypeError, ValueError, ExpressionError):
        return None  # a text of another make: the rate is an extra, the page goes without
    if rigid or "bearing" in tables or gravity <= 0.0 or not any(arms):
        return None
    return math.sqrt(gravity / min(arm for arm in arms if arm > 0.0))


def _number(value: object) -> float:
    return evaluate(value) if isinstance(value, str) else float(value)  # type: ignore[arg-type]
