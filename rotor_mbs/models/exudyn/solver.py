"""A built system with one integration scheme: runs it as often as wanted, then reads it out.

Loads the engine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from rotor_mbs.models.exudyn.adapter import System
from rotor_mbs.models.exudyn.blueprint import Part
from rotor_mbs.models.exudyn.schemes import Scheme
from rotor_mbs.models.exudyn.timetable import IntegrationInterval, RotorTorque, TorqueSegment, integration_intervals
from rotor_mbs.scenario.scene import Scene
from rotor_mbs.solution.record import Array, Integration, Trajectory

Reading = Callable[[Scene, Sequence[TorqueSegment], Callable[[str], Array]], Trajectory]


class MultibodySolver:
    """See `rotor_mbs.methods.base.Solver`. rows_between: the reading needs rows between samples too."""

    def __init__(
        self,
        scene: Scene,
        parts: Sequence[Part],
        torque: RotorTorque,
        scheme: Scheme,
        reading: Reading,
        rows_between: bool,
    ) -> None:
        self._scene, self._torque, self._scheme, self._reading = scene, torque, scheme, reading
        self._rows_between = rows_between
        self._intervals = integration_intervals(scene, torque.segments, every_sample=scheme.step is None)
        self.system = System(parts)

    def integrate(self) -> Integration:
        """From the initial state, every time; bit for bit the same."""
        return self.system.integrate(self._scheme, self._intervals, self._rows_between, self._set_torque)

    def _set_torque(self, interval: IntegrationInterval) -> None:
        self._torque.segment = interval.segment

    def observe(self) -> Trajectory:
        # A diverging state may overflow in its energies; the rows are cut where they stop being finite.
        with np.errstate(over="ignore", invalid="ignore"):
            return self._reading(self._scene, self._torque.segments, self.system.rows)
