r"""What the gripper holds, weighed by what the joints carry of it.

Rotors show the mass of vehicle and payload together, and a lasting push of 0.8 m/s^2 along the
vertical is to them 8 % of all of it: as much as the payload. A push on the base does not load the
joints, whose field g - a is measured. With the levers :math:`l_k` of the joints k about which the
end-effector turns, a payload m at it gives the torques

.. math:: \hat\tau_k = m\,\varphi_k, \qquad \varphi_k = (u_k \times l_k) \cdot (g - a)

and what the observer of joints (T3b) still finds beside the model is put down to it,

.. math:: \dot m = \frac{1}{T} \frac{\varphi \cdot \hat\tau}{\varphi \cdot \varphi + \epsilon}.

The joints' friction makes of this an error of :math:`\tau_c |\varphi|_1 / |\varphi|^2`; an arm that
hangs straight down shows nothing, and the estimate stays as it was.

Source: docs/equations.md T9.
"""

from __future__ import annotations

from typing import Final

from fsw.autopilot.geometry.vectors import clamp, dot
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.multibody import lever_of, place_of_tip
from fsw.autopilot.signals import Vec3
from fsw.autopilot.tick_record import Tick
from fsw.compiled import compilable

WEIGHING_TIME: Final = 0.4  # s, T
HEAVIEST: Final = 0.2  # of the vehicle's mass, that may be carried
_BELIEVED: Final = 1.25 * HEAVIEST  # more is not put down to a payload
_LOST: Final = 0.5  # share of it, that is missed at once where it has fallen
# s, T then: with a payload that is not there the joints' loops are too hard.
_LOSING_TIME: Final = 0.04
_HANGING: Final = 0.25  # m^4/s^4: levers of 50 mm, below which little is believed


@compilable
def let_go(r: Tick) -> None:
    """Forget what an open gripper held. Writes payload, mass, bodies.carried."""
    p = r.payload
    if p.mass > 0.0 and not p.gripped > 0.0:
        r.mass -= p.mass
        p.mass = 0.0
    r.bodies.carried = p.mass


@compilable
def weigh_payload(r: Tick, airframe: Airframe, field: Vec3, dt: float) -> None:
    """What a closed gripper holds, ``dt`` [s] later.

    The ``field`` [m/s^2, B] is gravity less the base's acceleration. Nothing is weighed near a
    surface that may be touched. Reads bodies, joints; writes payload, mass.
    """
    p, m, b = r.payload, r.bodies, airframe.bodies
    if not p.gripped > 0.0 or r.pressing.near > 0:
        return
    tip, found, all_levers = place_of_tip(m, b), 0.0, _HANGING
    for i in range(int(b.joints)):
        each = dot(lever_of(m, i, tip), field)
        found += each * r.joints.disturbance[i]
        all_levers += each * each
    missing = found / all_levers
    takes = _LOSING_TIME if missing < -_LOST * p.mass else WEIGHING_TIME
    more = p.mass + dt / takes * missing
    more = clamp(more, 0.0, _BELIEVED * airframe.mass)
    r.mass += more - p.mass
    p.mass = more
