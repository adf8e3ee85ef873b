r"""From torque and thrust to rotors of any layout: roll and pitch first, then thrust, yaw last.

With the rotors' effectiveness B (roll, pitch, yaw and thrust per newton of each), a wish is served
by the pseudoinverse of B. Where that asks for more than rotors have, yaw is given up first, then
thrust, as far as it takes and no further: with roll and pitch as they are, rotor i gives
:math:`c_i + a_i T + b_i y`, and which thrust T leaves room for some yaw y follows from each pair of
limits. Roll and pitch are cut only where no thrust and no yaw make room for them: each to
what is possible without the other, then both by one share.

Source: PX4's sequential desaturation, whose order of what is given up this is.
"""

from __future__ import annotations

from typing import Final

from fsw.autopilot.geometry.vectors import clamp, clamp_magnitude
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.multibody import factorise, solve
from fsw.autopilot.signals import Vec2, Vec3
from fsw.autopilot.tick_record import Mixer, Tick
from fsw.compiled import compilable
from fsw.record import JOINTS

ROLL, PITCH, THRUST, YAW = 0, 1, 2, 3  # of a rotor's share, in the order of what is kept
AXES: Final = 4
_NONE: Final = 1e-9  # N a unit; a rotor with less has no share
_FAR: Final = 1e9
_HALVINGS: Final = 40


@compilable
def allocate(
    r: Tick, airframe: Airframe, torque: Vec3, thrust: float, yaw_limit: float, known: float = 0.0
) -> None:
    """Thrust of each rotor, within what it can give. Reads health; writes wanted, mixer.

    Body ``torque`` [N m, FRD] about its origin and total ``thrust`` [N] along -z; no rotor spends
    more than ``yaw_limit`` [N] on yaw beside what balances a ``known`` part of it [N m], that of a
    surface. A rotor that is weak has less room; one that does not obey has none, and the others do
    without it what they can.
    """
    m, n = r.mixer, int(airframe.rotors)
    roll, pitch, lift, yaw = _left_to_others(r, airframe, torque, thrust)
    most = 0.0
    for i in range(n):
        most = max(most, abs(m.share[AXES * i + YAW]))
    yaw = clamp_magnitude(yaw - known, yaw_limit / max(most, _NONE)) + known
    low, high = _yaw_room(m, n, roll, pitch, lift)
    if not low <= high:
        roll *= _share_that_fits(m, n, roll, 0.0)
        pitch *= _share_that_fits(m, n, 0.0, pitch)
        share = _share_that_fits(m, n, roll, pitch)
        roll, pitch = share * roll, share * pitch
        lift = clamp(lift, *_thrust_room(m, n, roll, pitch))
        low, high = _yaw_room(m, n, roll, pitch, lift)
    yaw = clamp(yaw, low, high)
    for i in range(n):
        f = m.low[i]
        if f < m.top[i]:
            s = AXES * i
            f = _level(m, i, roll, pitch) + m.share[s + THRUST] * lift + m.share[s + YAW] * yaw
            if f < m.low[i]:
                f = m.low[i]
            elif f > m.top[i]:
                f = m.top[i]
        r.wanted.rotor_thrust[i] = f


@compilable
def authority_left(r: Tick, airframe: Airframe) -> float:
    """The share [1] of roll or pitch torque that is left about hover, of the axis with less.

    Of a rotor its range to the nearer limit counts, against that of a sound one. Reads health.
    """
    n, w, health, least = int(airframe.rotors), airframe.wrench, r.health, 1.0
    hover = airframe.mass * GRAVITY / n
    for axis in (3, 4):
        whole = left = 0.0
        for i in range(n):
            top = airframe.rotor_thrust_max[i]
            sound = abs(w[6 * i + axis]) * min(hover, top - hover)
            high = min(top * health.effectiveness[i], health.most[i])
            room = min(high - hover, hover - health.least[i]) / min(hover, top - hover)
            whole += sound
            left += sound * clamp(room, 0.0, 1.0)
        least = min(least, left / whole)
    return least


@compilable
def _left_to_others(
    r: Tick, airframe: Airframe, torque: Vec3, thrust: float
) -> tuple[float, float, float, float]:
    """Roll, pitch, thrust, yaw beside what rotors give that do not obey. Writes mixer."""
    m, n, w, health = r.mixer, int(airframe.rotors), airframe.wrench, r.health
    x, y, z, lift = torque[0], torque[1], torque[2], thrust
    all_obey = True
    for i in range(n):
        m.low[i] = health.least[i]
        m.top[i] = min(airframe.rotor_thrust_max[i] * health.effectiveness[i], health.most[i])
        if not m.low[i] < m.top[i]:
            f, at = m.low[i], 6 * i
            x, y, z = x - w[at + 3] * f, y - w[at + 4] * f, z - w[at + 5] * f
            lift, all_obey = lift + w[at + 2] * f, False
    if all_obey:
        for i in range(AXES * n):
            m.share[i] = airframe.share[i]
    else:
        share_out(m, airframe)
    return x, y, lift, z


@compilable
def share_out(m: Mixer, airframe: Airframe) -> None:
    """The pseudoinverse of the rotors that obey. Reads low, top of the mixer; writes share."""
    n, w = int(airframe.rotors), airframe.wrench
    for i in range(m.gram.size):
        m.gram[i] = 0.0
    for i in range(n):
        s, at, obeys = AXES * i, 6 * i, 1.0 if m.low[i] < m.top[i] else 0.0
        m.share[s + ROLL], m.share[s + PITCH] = obeys * w[at + 3], obeys * w[at + 4]
        m.share[s + THRUST], m.share[s + YAW] = -obeys * w[at + 2], obeys * w[at + 5]
        for k in range(AXES):
            for j in range(AXES):
                m.gram[JOINTS * k + j] += m.share[s + k] * m.share[s + j]
    # What the rotors that are left cannot do independently is not asked of them: yaw first.
    factorise(m.factor, m.gram, AXES)
    for i in range(n):
        for k in range(AXES):
            m.work[k] = m.share[AXES * i + k]
        solve(m.factor, m.work, AXES)
        for k in range(AXES):
            m.share[AXES * i + k] = m.work[k]


@compilable
def _level(m: Mixer, i: int, roll: float, pitch: float) -> float:
    """What roll and pitch ask of a rotor [N]."""
    return float(m.share[AXES * i + ROLL] * roll + m.share[AXES * i + PITCH] * pitch)


@compilable
def _yaw_room(m: Mixer, n: int, roll: float, pitch: float, lift: float) -> Vec2:
    """Range of yaw [N m] within every rotor's limits."""
    low, high = -_FAR, _FAR
    for i in range(n):
        if m.low[i] < m.top[i]:
            s = AXES * i
            rest = _level(m, i, roll, pitch) + m.share[s + THRUST] * lift
            low, high = _narrowed(low, high, m.share[s + YAW], m.low[i] - rest, m.top[i] - rest)
    return low, high


@compilable
def _thrust_room(m: Mixer, n: int, roll: float, pitch: float) -> Vec2:
    """Range of thrust [N] for which there is a yaw within every rotor's limits."""
    low, high = -_FAR, _FAR
    for i in range(n):
        if m.low[i] < m.top[i]:
            a, b = m.share[AXES * i + THRUST], m.share[AXES * i + YAW]
            c = _level(m, i, roll, pitch)
            if abs(b) <= _NONE:
                low, high = _narrowed(low, high, a, m.low[i] - c, m.top[i] - c)
                continue
            # Least yaw of the one, greatest of the other: (rate, at no thrust) each.
            at_least = ((m.low[i] if b > 0.0 else m.top[i]) - c) / b
            for j in range(n):
                e, d = m.share[AXES * j + THRUST], m.share[AXES * j + YAW]
                if m.low[j] < m.top[j] and abs(d) > _NONE:
                    free = (m.top[j] if d > 0.0 else m.low[j]) - _level(m, j, roll, pitch)
                    low, high = _narrowed(low, high, a / b - e / d, at_least - free / d, _FAR)
    return low, high


@compilable
def _narrowed(low: float, high: float, slope: float, least: float, most: float) -> Vec2:
    """The range of x, as far as ``least <= slope x <= most``; empty where that is nowhere."""
    if abs(slope) > _NONE:
        a, b = least / slope, most / slope
        return max(low, min(a, b)), min(high, max(a, b))
    return (low, high) if least <= _NONE and most >= -_NONE else (_NONE, -_NONE)


@compilable
def _share_that_fits(m: Mixer, n: int, roll: float, pitch: float) -> float:
    """The largest share [1] of roll and pitch together that leaves room for some thrust and yaw."""
    fits, fails = 0.0, 1.0
    for k in range(_HALVINGS):
        share = 1.0 if k == 0 else 0.5 * (fits + fails)
        low, high = _thrust_room(m, n, share * roll, share * pitch)
        if low <= high:
            fits = share
        else:
            fails = share
        if fits >= fails:
            break
    return fits
