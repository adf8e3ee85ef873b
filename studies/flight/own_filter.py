"""Whether the safety filter would let an own command pass."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.control.cascade import Cascade
from fsw.autopilot.control.safety_filter import FilterProbes, filtered
from fsw.autopilot.geometry.vectors import add_scaled
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.rotors import motion_state
from fsw.autopilot.signals import ActuatorCommand
from fsw.autopilot.tick_record import Tick
from fsw.compiled import kernel


def passes(cascade: Cascade, r: Tick, zones: NDArray[np.float64], command: ActuatorCommand) -> bool:
    """Whether what a ``command`` gives the vehicle of a record keeps it off the ``zones``.

    ``zones`` (zones, k) [SI] are those of the safety filter, which may be switched off.
    """
    if not len(zones) or not cascade.law.filter.tuning.enabled > 0:
        return True
    thrust = sum(command.rotor_thrust)
    return bool(_passes(cascade.packed, r.array, zones, cascade.probes, thrust))


@kernel
def _passes(
    laws: NDArray[Any],
    ticks: NDArray[Any],
    zones: NDArray[np.float64],
    probes: FilterProbes,
    thrust: float,
) -> bool:
    """The filter's answer to the acceleration of a total ``thrust`` [N], as the vehicle leans."""
    law, r = laws[0], ticks[0]
    R, estimate = r.estimate.R_WB, r.estimate
    motion = motion_state(law.airframe, r, r.rotors, r.sent.joint_torque)
    f = thrust / r.mass
    wanted = -f * R[2], -f * R[5], GRAVITY - f * R[8]
    a = add_scaled(motion.a, r.observed.d, 1.0)
    bodies, v = law.airframe.bodies, r.observed.v
    _, changed, _ = filtered(law.filter, bodies, probes, zones, estimate, v, a, wanted)
    return not changed
