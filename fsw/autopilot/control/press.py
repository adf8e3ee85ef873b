r"""The tool on a surface: who pushes how hard, known without a force sensor, and never too hard.

Position cannot bound a force: a wall of 10 kN/m takes 5 N within half a millimetre, and the base is
pushed about by centimetres. So along the surface's normal the arm gives a force and the base a
place. With the tool's Jacobian J, the joints' levers :math:`J_n = n^T J` along the normal n, their
mass matrix M and

.. math:: \lambda = (J_n M^{-1} J_n^T)^{-1}, \qquad s = n^T (J J^T + \epsilon)^{-1} J

the tool's mass along n and what joint torques give statically along n, the accelerations that
the joint loop asks for lose their :math:`s^T J_n \ddot q`, the tool is kept still against the
base's own acceleration, and :math:`-J_n^T f` presses. Whatever the wall's stiffness and wherever it
moves, it then meets f, the tool's mass, and friction. What pushes the base is taken up by the arm.
An arm that is nearly straight presses less and less, and follows no further.

The observer of the joints' generalised momentum gives the torques from outside, from which follow

.. math:: \hat f = s\,\hat\tau, \qquad
          |\hat f - f| \le \sum_k |s_k| (\tau_{c,k} + |M_{qv,k}| d_m + \mu |g_k|) =: e

with the drives' friction :math:`\tau_c`, a push :math:`d_m` on the base that is not yet observed,
and masses that are wrong by a share :math:`\mu`. The barrier on the force is

.. math:: h_f = f_{max} - e - f \ge 0, \qquad v \le \rho (f_{max} - e) / \sqrt{k_{max} \lambda}

: what is commanded never exceeds :math:`f_{max} - e`, and in free air the tool comes no faster than
the hardest wall can stop within a share :math:`\rho` of it. To keep in contact is soft: a wall that
yields is followed as far as the force reaches.

Source: docs/equations.md T8.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.autopilot.control.allocation import AXES, YAW
from fsw.autopilot.geometry.rotation import rotate, rotate_back
from fsw.autopilot.geometry.vectors import (
    add_scaled,
    clamp,
    cross,
    dot,
    norm,
    put_three,
    subtract,
    three,
)
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.multibody import (
    Bodies,
    factorise,
    lever_of,
    place_of_tip,
    solve,
    times_symmetric,
    velocity_of_tip,
)
from fsw.autopilot.shapes.zones import (
    CLEARANCE,
    DAMPS,
    FORCE_MAX,
    ROUGH,
    STIFF,
    Zones,
    moved_by,
    surface_at,
    velocity_of,
)
from fsw.autopilot.signals import Vec3
from fsw.autopilot.tick_record import Pressing, Tick
from fsw.compiled import compilable
from fsw.record import JOINTS, Floats
from vehicles.description import V6

_BALANCED = 0.5  # share of what rotors have in hover, that the moment of a force may take


@dataclass(frozen=True, slots=True)
class PressTuning:
    """How the tool meets a surface and presses on it."""

    near: float = 0.15  # m from a surface that may be touched the observer is at work
    band: float = 0.04  # m from it the tool's force along the normal is bounded
    bandwidth: float = 80.0  # rad/s, of the tool's speed along the normal
    stiffness: float = 10.0  # 1/s, of its place in the band
    speed: float = 0.05  # m/s, with which it looks for a surface, at most
    back: float = 0.3  # m/s, at most, out of the band
    share: float = 0.3  # rho, of the largest force, that an impact may give
    search: float = 2.0  # N, at most, to move the tool in free air
    rise: float = 10.0  # N/s, of the force; 15 swung an arm straight, in 1 of 20 flights
    fall: float = 10.0  # N/s, the same in contact: what leans on a surface is to be caught
    drop: float = 150.0  # N/s, where there is none
    felt: float = 0.4  # N, from which on there is contact
    struck: float = 1.0  # N, the same where none was looked for
    lost: float = 0.15  # N, below which there is none
    farthest: float = 0.3  # m, of a surface from where it was announced, that is believed
    slipping: float = 0.5  # s, over which the mean of a slip is taken
    remember: float = 0.1  # s, in which the mean speed of a tool in contact follows
    damping: float = 1.0  # N, at most, against speeds beside the mean
    noticed: float = 10.0  # m/s^2; what is slowed down more than this has struck something
    disturbance: float = 0.8  # m/s^2, d_m
    wrong: float = 0.03  # mu, share by which masses may be wrong
    heaviest: float = 1.0  # kg; an arm that is nearly straight is not believed to be heavier
    # m, levers along the normal of an arm that is nearly straight: it presses with all of the force
    # above the first, and with none below the second
    bent: float = 0.09
    straight: float = 0.05


@compilable
def look_for_surface(
    r: Tick, bodies: Bodies, tuning: PressTuning, radius: float, zones: Zones, dt: float
) -> None:
    """The surface that the tool's ball of ``radius`` [m] may touch, the nearest of ``zones``.

    How long the tool has missed it, and how it slips, is looked at ``dt`` [s] after the last time.
    Reads u, estimate, bodies; writes pressing.
    """
    k, estimate, found = r.pressing, r.estimate, False
    nearest = tuning.near
    for zone in range(zones.shape[0]):
        if not zones[zone, FORCE_MAX] > 0.0:
            continue
        tip = rotate(estimate.R_WB, place_of_tip(r.bodies, bodies))
        p = estimate.p_WB[0] + tip[0], estimate.p_WB[1] + tip[1], estimate.p_WB[2] + tip[2]
        x, y, z = subtract(p, moved_by(zones, zone, estimate.t_us))
        at = surface_at(zones, zone, 0, x, y, z)
        announced = at.distance + zones[zone, CLEARANCE] - radius
        distance = announced - (k.moved if zone == k.zone else 0.0)
        if distance < nearest:
            found, nearest = True, distance
            if zone != k.zone:
                k.zone, k.moved = zone, 0.0
            n = (at.nx, at.ny, at.nz)
            put_three(k.normal, 0, n)
            k.surface_speed = dot(n, velocity_of(zones, zone, estimate.t_us))
            k.most, k.stiffness = zones[zone, FORCE_MAX], zones[zone, STIFF]
            k.dissipation, k.friction = zones[zone, DAMPS], zones[zone, ROUGH]
    if found:
        k.distance = nearest
        if k.contact > 0:  # it is where it is felt
            k.moved, k.distance = k.moved + nearest, 0.0
        if k.near == 0:
            k.near = 1
            for i in range(int(bodies.joints)):
                k.momentum[i], k.external[i] = r.bodies.momentum[i], r.joints.disturbance[i]
    if k.near > 0 and (not found or abs(k.moved) > tuning.farthest):
        _forget(r)
    _watch_contact(r, bodies, tuning, dt)


@compilable
def _watch_contact(r: Tick, bodies: Bodies, tuning: PressTuning, dt: float) -> None:
    k = r.pressing
    k.coming = max(k.speed, k.coming - tuning.noticed * dt)
    if not r.u.force > 0.0:
        if k.met > 0:
            k.met, k.lost_for = 0, 0.0
            for i in range(3):
                k.slip[i] = 0.0
        return
    if k.contact > 0:
        k.met, k.lost_for = 1, 0.0
        v = rotate(r.estimate.R_WB, velocity_of_tip(r.bodies, bodies))
        normal = three(k.normal, 0)
        base, plan = r.estimate.v_WB, r.plan.v
        v = v[0] + base[0] - plan[0], v[1] + base[1] - plan[1], v[2] + base[2] - plan[2]
        v = add_scaled(v, normal, -dot(normal, v))
        for i in range(3):
            k.slip[i] += min(dt / tuning.slipping, 1.0) * (v[i] - k.slip[i])
    elif k.met > 0:
        k.lost_for += dt


@compilable
def _forget(r: Tick) -> None:
    k = r.pressing
    k.near = k.contact = 0
    k.pressed = k.unsure = k.mass = k.speed = k.mean_speed = k.coming = k.blow = 0.0
    k.asked = k.ramped = k.commanded = 0.0
    for i in range(3):
        k.force[i] = r.observed.known[i] = 0.0
    for i in range(JOINTS):
        k.momentum[i] = k.external[i] = 0.0


def off_surface(k: Pressing, p: Vec3, by: float) -> Vec3:
    """A place ``p`` [m, NED] ``by`` [m] off the surface that the tool is at, or as it is.

    What follows a push begins there, and a landing stays off the surface.
    """
    return add_scaled(p, three(k.normal, 0), by) if k.near > 0 else p


@compilable
def weigh_tool(r: Tick, airframe: Airframe, tuning: PressTuning) -> None:
    """The force on the tool, from what the joints' observer has found, and what can be balanced.

    Reads estimate, mass, bodies, pressing.external; writes pressing, observed.known.
    """
    k, m, b, n = r.pressing, r.bodies, airframe.bodies, int(airframe.bodies.joints)
    if k.near == 0:
        return
    R, normal = r.estimate.R_WB, three(k.normal, 0)
    along, tip = rotate_back(R, normal), place_of_tip(m, b)
    k.balanced = _balanced(r, airframe, cross(subtract(tip, three(m.centre, 0)), along)[2])
    shape, reached = _levers(r, tip, n), (0.0, 0.0, 0.0)
    for i in range(n):
        lever = lever_of(m, i, tip)
        k.along[i] = k.work[i] = dot(along, lever)
        k.share[i] = dot(along, times_symmetric(shape, lever))
        reached = add_scaled(reached, lever, k.along[i])
    factorise(m.factor, m.qq, n)
    solve(m.factor, k.work, n)
    whole, turned, eased = 0.0, 0.0, (0.0, 0.0, 0.0)
    for i in range(n):
        eased = add_scaled(eased, lever_of(m, i, tip), k.work[i])
        whole += k.share[i] * k.along[i]
        turned += k.share[i] * k.share[i]
    v = rotate(R, velocity_of_tip(m, b))
    speed = dot(
        normal, (v[0] + r.estimate.v_WB[0], v[1] + r.estimate.v_WB[1], v[2] + r.estimate.v_WB[2])
    )
    k.speed = k.surface_speed - speed
    # Joints feel the part of a force that they move the tool along; of what is normal to the
    # surface the rest is known. It turns a vehicle farther aside that is turned aside.
    k.pressed, least, freed = pressed_by(k, k.external, n), 1.0 / tuning.heaviest, dot(along, eased)
    held = k.friction * norm(add_scaled(eased, along, -freed))
    k.mass, k.held_mass = 1.0 / max(freed, least), 1.0 / max(freed - held, least)
    # Rates of s give the tool unit speed along n: an arm that is nearly straight has to turn fast.
    # A part of n that no joint moves the tool along, as with a vehicle turned aside, is no matter.
    reach = whole / math.sqrt(turned) if turned > 0.0 else 0.0
    k.stroke = clamp((reach - tuning.straight) / (tuning.bent - tuning.straight), 0.0, 1.0)
    k.unsure = 0.0
    gravity = rotate_back(R, (0.0, 0.0, GRAVITY))
    for i in range(n):
        held = abs(dot(three(m.vq, 3 * i), gravity))
        torque = airframe.joint_friction[i] + tuning.wrong * held
        torque += tuning.disturbance * norm(three(m.vq, 3 * i))
        k.unsure += abs(k.share[i]) * torque
    force = _force_on_tool(r, shape, tip, n)
    if k.contact > 0:
        force = add_scaled(force, subtract(along, times_symmetric(shape, reached)), k.pressed)
    force = rotate(R, force)
    put_three(k.force, 0, force)
    # What the base counts on is no more than what it was asked to stand, of an arm that is nearly
    # straight as well: what still presses there pushes it.
    into = clamp(dot(normal, force), 0.0, k.ramped + tuning.damping) if k.contact > 0 else 0.0
    aside = add_scaled(force, normal, -dot(normal, force))
    slipping = norm(aside)
    share = min(1.0, into / slipping) if slipping > 0.0 else 0.0
    for i in range(3):
        r.observed.known[i] = (into * normal[i] + share * aside[i]) / r.mass


@compilable
def _balanced(r: Tick, airframe: Airframe, lever: float) -> float:
    """The largest force [N] whose moment about yaw, by a ``lever`` [m], rotors can balance.

    A tool ahead of the base is pushed back past it: turned aside, the vehicle is turned farther,
    and yaw is the axis for which rotors have least. Reads mass.
    """
    hover, most = r.mass * GRAVITY / airframe.rotors, math.inf
    for i in range(int(airframe.rotors)):
        spent = abs(airframe.share[AXES * i + YAW] * lever)  # N a newton
        left = min(hover, airframe.rotor_thrust_max[i] - hover)
        most = min(most, _BALANCED * left / max(spent, _NO_SHARE))
    return most


@compilable
def pressed_by(k: Pressing, torque: Floats, joints: int) -> float:
    """Force [N] along the normal that a ``torque`` (j,) [N m] makes where the tool cannot move."""
    felt = whole = 0.0
    for i in range(joints):
        felt += k.share[i] * torque[i]
        whole += k.share[i] * k.along[i]
    return felt / max(whole, _AHEAD)


_AHEAD = 0.5  # share of the normal, at least, that joints move the tool along
_BLOCKED = 0.5  # share of the speed asked for below which something is in the way
_DAMPS = 0.1  # of Hunt and Crossley's dissipation times speed, in the largest force
_NO_SHARE = 1e-9  # N a newton
_DAMPED = 1e-4  # m^2, of levers without which a direction is left out


@compilable
def _levers(r: Tick, tip: Vec3, n: int) -> V6:
    """Inverse of J J^T, damped [1/m^2, B], of the joints' levers of the tool: xx yy zz xy xz yz."""
    m = r.bodies
    xx = yy = zz = _DAMPED
    xy = xz = yz = 0.0
    for i in range(n):
        x, y, z = lever_of(m, i, tip)
        xx, yy, zz = xx + x * x, yy + y * y, zz + z * z
        xy, xz, yz = xy + x * y, xz + x * z, yz + y * z
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
    size = 1.0 / (xx * a + xy * b + xz * c)
    d, e, f = xx * zz - xz * xz, xx * yy - xy * xy, xy * xz - xx * yz
    return a * size, d * size, e * size, b * size, c * size, f * size


@compilable
def _force_on_tool(r: Tick, shape: V6, tip: Vec3, n: int) -> Vec3:
    """Least force [N, B] on the tool that gives the observed torques, by damped least squares."""
    total, m = (0.0, 0.0, 0.0), r.bodies
    for i in range(n):
        total = add_scaled(total, lever_of(m, i, tip), r.pressing.external[i])
    return times_symmetric(shape, total)


@compilable
def _blow(k: Pressing) -> float:
    """The most [N] that the hardest surface gives a tool that has come so fast."""
    damped = 1.0 + _DAMPS * k.dissipation * k.coming
    return damped * k.coming * math.sqrt(k.stiffness * k.held_mass)


@compilable
def presses(r: Tick, tuning: PressTuning) -> bool:
    """Whether the tool's motion along the normal is a matter of force now."""
    k = r.pressing
    struck = k.pressed > k.unsure + tuning.struck  # by what is not where it was announced
    return k.near > 0 and (k.contact > 0 or k.asked > 0.0 or k.distance < tuning.band or struck)


@compilable
def press(
    r: Tick, airframe: Airframe, tuning: PressTuning, field: Vec3, turning: Vec3, dt: float
) -> float:
    """Acceleration [m/s^2] of the tool into the surface beside the base, for a tick of ``dt`` [s].

    It keeps the tool still against the base's own acceleration, and moves it in free air; the force
    that joints press with besides is pressing.commanded. ``field`` [m/s^2, B] and ``turning``
    [rad/s^2, B] are as of ``joint_torques``. Reads u, joints, estimate; writes pressing.
    """
    k, m, n = r.pressing, r.bodies, int(airframe.bodies.joints)
    normal, R = three(k.normal, 0), r.estimate.R_WB
    bounded = max(k.most - k.unsure - tuning.damping, 0.0)
    k.asked = min(r.u.force, bounded, k.balanced)
    firm = k.mass * tuning.bandwidth
    most = max(k.most - k.unsure, 0.0)
    fastest = min(tuning.speed, tuning.share * most / math.sqrt(max(k.stiffness, 1.0) * k.mass))
    # What is in the way is felt by the tool's standing still, before the observer is sure.
    blocked = k.distance < tuning.band and k.asked > 0.0 and k.speed < _BLOCKED * fastest
    if k.contact > 0:
        if k.pressed < tuning.lost:
            k.contact, k.blow = 0, 0.0
    elif k.pressed > k.unsure + (tuning.felt if blocked else tuning.struck):
        k.contact, k.mean_speed, k.blow = 1, 0.0, _blow(k)
    wanted = k.asked if k.contact > 0 or blocked else 0.0
    fall = tuning.fall if k.contact > 0 else tuning.drop
    k.ramped = clamp(wanted, k.ramped - fall * dt, k.ramped + tuning.rise * dt)
    force = min(k.stroke * k.ramped, most)
    moving = 0.0
    if k.contact > 0 and force > 0.0:
        k.mean_speed += min(dt / tuning.remember, 1.0) * (k.speed - k.mean_speed)
        damped = clamp(firm * (k.mean_speed - k.speed), -tuning.damping, tuning.damping)
        rebound = firm * max(k.speed - fastest, 0.0)  # it has come off, and comes back too fast
        force = clamp(force + damped - rebound, 0.0, most)
    else:
        toward, lead = fastest, 0.0
        if not k.asked * k.stroke > 0.0:
            # The reference of the joints leads, which knows where the base really is.
            for i in range(n):
                off = r.joints.reference[i] - r.estimate.q_arm[i]
                rate = r.joints.reference_rate[i] - r.estimate.qd_arm[i]
                lead -= k.along[i] * (tuning.stiffness * off + rate)
            toward = k.speed + lead
            toward = clamp(toward, -tuning.back, fastest)
        top = min(tuning.share * most, tuning.search)
        moving = clamp(firm * (toward - k.speed), -3.0 * top, min(top, most - force)) / k.mass
    k.commanded = force
    # What the tool does of itself: nothing, in the world.
    carried = GRAVITY * normal[2] - dot(rotate_back(R, normal), field)
    carried += dot(rotate_back(R, normal), cross(turning, place_of_tip(m, airframe.bodies)))
    return float(moving + carried)
