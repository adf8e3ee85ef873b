"""Where the tool is to press: the reference meets the surface where the tool has found it.

A surface is where it is felt, not where it was announced. Along its normal the targets of a tool in
contact are moved to where the tool is, and the plan counts on what the surface pushes back.
"""

from __future__ import annotations

from fsw.autopilot.control.press import PressTuning
from fsw.autopilot.geometry.vectors import add_scaled, clamp, dot, subtract
from fsw.autopilot.signals import EndEffectorTarget, Vec3
from fsw.autopilot.tick_record import Tick
from fsw.frozen import replace

# m, that a surface is followed from where it was announced: one that comes as far as it does, one
# that goes not far, because the other parts keep clear of where it was announced
_BACK, _AFTER = 0.3, 0.03
_FASTEST = 0.15  # m/s, of one that comes
_NOTHING: Vec3 = (0.0, 0.0, 0.0)

Pressed = tuple[tuple[EndEffectorTarget, ...], tuple[Vec3, ...]]
"""Targets at the nodes, and the push in each step [m/s^2, NED]; none where nothing is pressed."""


def pressed_reference(
    targets: tuple[EndEffectorTarget, ...], r: Tick, p_WE: Vec3, tuning: PressTuning
) -> Pressed:
    """The targets of a horizon for a tool at ``p_WE`` [m, NED], and what they push the base by.

    The force that is given now rises and falls as the fast loop lets it.
    """
    k = r.pressing
    if not k.contact:
        if not any(target.force > 0.0 for target in targets):
            return targets, ()
        return targets, (_NOTHING,) * (len(targets) - 1)
    n = (float(k.normal[0]), float(k.normal[1]), float(k.normal[2]))
    moved, pushes = [], []
    speed = clamp(k.surface_speed - k.mean_speed, 0.0, _FASTEST)
    for target in targets:
        ahead_s = 1e-6 * (target.t_us - targets[0].t_us)
        if target.force > 0.0:
            off = clamp(dot(n, subtract(p_WE, target.p_WE)), -_AFTER, _BACK) + ahead_s * speed
            target = replace(
                target,
                p_WE=add_scaled(target.p_WE, n, off),
                v_WE=add_scaled(target.v_WE, n, speed),
            )
        moved.append(target)
        least, most = k.ramped - ahead_s * tuning.fall, k.ramped + ahead_s * tuning.rise
        force = max(clamp(target.force, least, most), 0.0)
        pushes.append(add_scaled(_NOTHING, n, force / r.mass))
    return tuple(moved), tuple(pushes[:-1])
