"""Where the tool is to press: the reference meets the surface where the tool has found it.

A surface is where it is felt, not where it was announced. Along its normal the targets of a tool in
contact are moved to where the tool is, and the plan counts on what the surface pushes back.
"""

from __future__ import annotations

from fsw.autopilot.geometry.vectors import add_scaled, clamp_magnitude, dot, subtract
from fsw.autopilot.signals import EndEffectorTarget, Vec3
from fsw.autopilot.tick_record import Tick
from fsw.frozen import replace

_MOST = 0.1  # m, that a surface may be from where it was announced
_NOTHING: Vec3 = (0.0, 0.0, 0.0)

Pressed = tuple[tuple[EndEffectorTarget, ...], tuple[Vec3, ...]]
"""Targets at the nodes, and the push in each step [m/s^2, NED]; none where nothing is pressed."""


def pressed_reference(
    targets: tuple[EndEffectorTarget, ...], r: Tick, p_WE: Vec3, rise: float
) -> Pressed:
    """The targets of a horizon for a tool at ``p_WE`` [m, NED], and what they push the base by.

    The force that is given now rises by no more than ``rise`` [N/s].
    """
    if not any(target.force > 0.0 for target in targets):
        return targets, ()
    k = r.pressing
    if not k.contact:
        return targets, (_NOTHING,) * (len(targets) - 1)
    n = (float(k.normal[0]), float(k.normal[1]), float(k.normal[2]))
    moved, pushes = [], []
    for target in targets:
        if target.force > 0.0:
            off = clamp_magnitude(dot(n, subtract(p_WE, target.p_WE)), _MOST)
            target = replace(target, p_WE=add_scaled(target.p_WE, n, off))
        moved.append(target)
        most = k.ramped + 1e-6 * (target.t_us - targets[0].t_us) * rise
        pushes.append(add_scaled(_NOTHING, n, min(target.force, most) / r.mass))
    return tuple(moved), tuple(pushes[:-1])
