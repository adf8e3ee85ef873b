r"""Which rotor or joint does not give what it is commanded, from how the vehicle moves.

What acts on the vehicle beside the model is observed from its momentum, which needs no
acceleration: for roll and pitch, with the torque of the commanded thrusts through their lag,

.. math:: \dot{\hat r} = K (I \dot\omega - \tau - \hat r),

for the thrust from the accelerometer, and for each joint from the arm's generalised momentum.

A rotor that gives x more than commanded leaves a pattern: its arm times x about one axis and x
along z. For each rotor x is the projection of what is observed onto its pattern. One has failed
when the mean square of x is large *and* the pattern explains nearly all of what is observed. A push
along z, a mass or a battery that is not as believed, an arm that is heavier, a contact: each leaves
another pattern, however strong it is. What lasts along z is learned as long as nothing turns the
vehicle. Rotors that are all slower than believed make the vehicle swing, and half a swing looks
like a single one: how rotors twice as slow would turn the vehicle is computed as well, and where
that much explains what does, none has failed, whatever pushes along z meanwhile.

A joint has failed when torque is observed that undoes what is asked of its drive, and the base does
not feel it either. A surface that holds the tool undoes torques as well; there a joint has failed
that does not move while the base carries the arm about.

Source: A. De Luca, R. Mattone, Actuator failure detection and isolation using generalized momenta,
ICRA 2003, for the joints; docs/decisions/0033-actuators-that-fail.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from numpy.typing import NDArray

from fsw.autopilot.control.rotor_loss import flies_without
from fsw.autopilot.geometry.vectors import add, clamp, dot, put_three, subtract, three
from fsw.autopilot.model.actuator_health import LIMP, SOUND, STUCK
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.multibody import (
    Bodies,
    Several,
    joint_drift,
    load_on_base,
    move_bodies,
    posture,
)
from fsw.autopilot.model.rotors import lag_rotor, load_of_tip, rotor_wrench
from fsw.autopilot.signals import Vec3
from fsw.autopilot.tick_record import NO_ROTOR, Sent, Tick, Watched, watch_anew
from fsw.compiled import compilable, kernel
from fsw.record import ROTORS, Floats, padded

OBSERVER: Final = 30.0  # 1/s; the gyro's noise in a laboratory's suite is 0.5 N of a rotor then
MEMORY: Final = 0.1  # s, of mean squares
LEARNING: Final = 2.0  # s, of what lasts along z
LEARNING_BELOW: Final = 1.0  # N of a rotor about roll and pitch
SETTLING: Final = 1.0  # s, before anything is found
AIRBORNE: Final = 0.5  # of the weight; with less thrust nothing is found
CONTACT: Final = 3.0  # m/s^2 more than the rotors give: near the ground, it carries
# Healthy flights in all suites, in real air, with another mass, lag, inertia or friction, have
# less, or not for so long (docs/decisions/0033-actuators-that-fail.md).
WEAK: Final = 1.5  # N, root mean square
WEAK_TIME: Final = 0.15  # s
STRONG: Final = 4.0  # N, with which less time is needed
STRONG_TIME: Final = 0.03  # s
EXPLAINED: Final = 0.9  # share of all that is observed
# All rotors are slow, and none has failed, where what turns the vehicle is up to SLOW times what
# rotors twice as slow would leave, and that explains SLOW_SHARE of it.
SLOW: Final = 1.5
SLOW_SHARE: Final = 0.7
LOST: Final = 0.2  # of what is commanded; a rotor that gives less is lost
LOST_TIME: Final = 0.15  # s
LOST_FROM: Final = 4.0  # N commanded; with less it is not seen
ALONG: Final = 0.3  # sine over cosine of the angle of axes that are one
UNLIKE: Final = 0.5  # share of what a second rotor lacks that along z may differ
QUIET: Final = 0.75  # N; a rotor below that gives what it is commanded again
QUIET_TIME: Final = 3.0  # s
ASTRAY: Final = 1.2  # N, root mean square of what no effectiveness explains
SMOOTHED: Final = 0.05  # s, of what a rotor gives that does not obey
LEAST_EFFECTIVE: Final = 0.25  # the command grows by four at most
EFFECT_RATE: Final = 2.0  # 1/s, by which allocation follows
# Joints. Torques are those of a drive with the friction of the paper's, and grow with it: friction
# undoes what a drive is asked for as well, and hides a drive that fails.
UNDONE: Final = 0.12  # N m, root mean square of what undoes the torque
UNDOING: Final = 0.5  # share of the torque that it undoes
ODD: Final = 0.2  # N m, root mean square of what base and arm do not feel of each other
ODD_SHARE: Final = 0.5  # of what undoes the torque, the same
BEHIND: Final = 0.02  # rad, root mean square of the distance from the reference
# With so much undone the joint may be where it should be: friction holds a limp one that hardly
# has to move. Friction of three times what the drives have undoes 0.1 N m.
PLAINLY: Final = 0.15  # N m, root mean square
PLAIN_SHARE: Final = 0.7
JOINT_TIME: Final = 0.1  # s
STANDING: Final = 0.2  # rad/s, root mean square of the rate of a joint that stands
MOVED: Final = 0.05  # rad; a joint that has moved so far is not stuck
# In contact: the rate, root mean square, that would hold the tool, and the share of it below which
# a joint stands.
MOVING: Final = 0.1  # rad/s
RIGID: Final = 0.1
RIGID_TIME: Final = 0.3  # s
_SHORT: Final = 0.01  # m; shorter levers move no tool

# What is known of parts that have failed, which lasts while nothing can be observed.
_OF_FAILED: Final = (
    "failed",
    "effect",
    "failed2",
    "failed_by_thrust",
    "failed_thrust2",
    "failed_more2",
    "gives",
    "lost",
    "disobeys",
    "joint",
    "stood_at",
)

# What the numbers above were measured with, of rotors and of a vehicle that one of them turns.
_HOVER: Final = 8.584  # N
_TURNING: Final = 8.584  # rad/s^2, that the loss of a rotor in hover turns it by
_INERTIA: Final = 1.02  # kg m, over the rotors' lever: the gyro's noise in newtons of a rotor
_FRICTION: Final = 0.035  # N m, of a drive at its largest rate
_QUICKEST: Final = 0.35  # of those times; rotors and observer have lags of their own


@dataclass(frozen=True, slots=True)
class WatchLaw:
    """What of the vehicle the watch needs; thrusts and times scale the numbers above."""

    airframe: Airframe
    thrusts: float  # with the thrust of a rotor in hover, or with the gyro's noise
    times: float  # with the time in which a vehicle tilts that has lost a rotor
    spares: Several  # (ROTORS,) 1 for a rotor without which the others fly, else 0
    torques: Several  # (JOINTS,) scale those of a joint, with its drive's friction


def watch_law(airframe: Airframe) -> WatchLaw:
    """The law of a vehicle in its home posture."""
    J = posture(airframe.bodies, airframe.home_posture).inertia
    hover, lever = airframe.mass * GRAVITY / airframe.rotors, airframe.rotor_lever
    turning = hover * lever / float(min(J[0], J[4]))
    noise = float(max(J[0], J[4])) / lever
    spares = tuple([float(flies_without(airframe, k)) for k in range(airframe.rotors)])
    return WatchLaw(
        airframe,
        thrusts=round(max(hover / _HOVER, noise / _INERTIA), 3),
        times=round(max(math.sqrt(_TURNING / turning), _QUICKEST), 3),
        spares=padded(spares, ROTORS),
        torques=torques_by_friction(airframe),
    )


def torques_by_friction(airframe: Airframe) -> Several:
    """What scales the torques that the watch looks for in each joint (JOINTS,) [1]."""
    friction = zip(airframe.joint_friction, airframe.joint_drag, strict=True)
    return tuple([round(max((slow + fast) / _FRICTION, 1.0), 3) for slow, fast in friction])


def pause(s: Watched) -> None:
    """Forget all but what has failed, while nothing can be observed."""
    kept = Watched(bytearray(s.numbers.tobytes()))
    watch_anew(s)
    if kept.failed != NO_ROTOR or kept.joint.any():
        for name in _OF_FAILED:
            setattr(s, name, getattr(kept, name))


@kernel
def watch(
    before: NDArray[Any],
    after: NDArray[Any],
    laws: NDArray[Any],
    decay: float,
    dt: float,
    angles_known: bool,
) -> bool:
    """Watch the actuators over a tick of ``dt`` [s]; whether any of them has failed by now.

    By the ``laws`` (1,) [SI] it reads the command of the record ``before`` (1,) [SI], and estimate
    and joints of the one ``after`` (1,) [SI], whose watch it writes. A rotor's error shrinks by
    ``decay`` [1]. Where the joints' angles are not known by encoders only rotors are judged.
    """
    law, sent, r = laws[0], before[0].sent, after[0]
    airframe = law.airframe
    s, x = r.watch, r.estimate
    joints, rotors = int(airframe.bodies.joints), int(airframe.rotors)
    move_bodies(r.bodies, airframe.bodies, airframe.joint_armature, x)
    if s.running == 0.0:
        for i in range(rotors):
            s.thrust[i] = s.slow[i] = sent.rotor_thrust[i]
    _observe_base(r, law, decay, dt, sent)
    # With something in the gripper it is not known what the joints are to do.
    if angles_known and r.payload.gripped == 0.0:
        _observe_arm(r, airframe.bodies, dt, sent.joint_torque)
        s.arm_seen += dt
    else:
        _forget_arm(s)
    force, _ = rotor_wrench(airframe, s.thrust)
    carried = s.lift > CONTACT * airframe.mass and not s.aloft
    if carried or not -force[2] > AIRBORNE * airframe.mass * GRAVITY:
        s.running = 0.0  # on the ground, or about to be
    s.running += dt
    settled = s.running > SETTLING
    _judge_rotors(r, law, dt, settled)
    found = s.failed >= 0
    # What a surface does to the tool can look like a drive that gives nothing.
    tells = settled and s.arm_seen > SETTLING and r.pressing.near == 0
    for k in range(joints):
        _judge_joint(s, k, law.torques[k], dt, tells, x.q_arm[k])
        _judge_yielding(s, k, dt, x.q_arm[k])
        found = found or s.joint[k] != SOUND
    return bool(found)


@compilable
def pattern_of(airframe: Airframe, rotor: int) -> Vec3:
    """What a newton more of a rotor leaves: roll and pitch [N at the rotors' lever], lift [N]."""
    w, lever, at = airframe.wrench, airframe.rotor_lever, 6 * rotor
    return w[at + 3] / lever, w[at + 4] / lever, -w[at + 2]


@compilable
def _observe_base(r: Tick, law: WatchLaw, decay: float, dt: float, sent: Sent) -> None:
    """What turns and lifts the base beside the model, and the means of its products."""
    airframe, observer = law.airframe, OBSERVER / law.times
    s, rate, J, rotors = r.watch, r.estimate.w_WB_B, r.bodies.inertia, int(airframe.rotors)
    for i in range(rotors):
        before = s.thrust[i]
        s.thrust[i] = lag_rotor(before, sent.rotor_thrust[i], decay)
        r.mixer.mean[i] = 0.5 * (before + s.thrust[i])
    force, turn = rotor_wrench(airframe, r.mixer.mean)
    pushed, turned = load_of_tip(r, airframe.bodies, sent.joint_torque)
    load = load_on_base(r.bodies, airframe.bodies, add(force, pushed), r.pressing.load)
    modelled = free = subtract(add(turn, turned), load)
    if r.pressing.near > 0:  # drives are judged by what turns the base where nothing is touched
        free = subtract(turn, load_on_base(r.bodies, airframe.bodies, force, sent.joint_torque))
    grown = subtract(rate, s.rate)
    for i in range(2):
        gained = dot(three(J, 3 * i), grown)
        if s.running == 0.0:
            gained = dt * modelled[i]
        s.torque[i] += OBSERVER * (gained - dt * (free[i] + s.torque[i]))
        s.turned[i] += observer * (gained - dt * (modelled[i] + s.turned[i]))
    share, total = min(observer * dt, 1.0), -force[2]
    lift = airframe.mass * r.estimate.specific_force - (1.0 + s.lasting) * total
    s.lift += share * (lift - s.lift)
    seen = s.turned[0] / airframe.rotor_lever, s.turned[1] / airframe.rotor_lever, s.lift
    x, y, z = seen
    # What the ground carries does not last.
    flies = total > AIRBORNE * airframe.mass * GRAVITY and z <= CONTACT * airframe.mass
    if flies and s.failed < 0 and max(abs(x), abs(y)) < LEARNING_BELOW * law.thrusts:
        s.lasting += dt / LEARNING * lift / total
    forget = min(dt / (MEMORY * law.times), 1.0)
    _observe_slow(r, law, dt, decay, sent, seen)
    products = (x * x, y * y, z * z, x * y, x * z, y * z)
    for i in range(s.products.size):
        s.products[i] += forget * (products[i] - s.products[i])
    for i in range(rotors):
        pattern = pattern_of(airframe, i)
        s.extra[i] = dot(pattern, seen) / dot(pattern, pattern)
        s.by_thrust[i] += forget * (s.extra[i] * s.thrust[i] - s.by_thrust[i])
        s.thrust2[i] += forget * (s.thrust[i] * s.thrust[i] - s.thrust2[i])
    put_three(s.rate, 0, three(rate, 0))
    if s.failed >= 0:
        _observe_failed(s, law, dt, seen)


@compilable
def _observe_failed(s: Watched, law: WatchLaw, dt: float, seen: Vec3) -> None:
    """What the failed rotor gives, which is known, and whether another one is lost as well."""
    # What turns the base says how much, and pushes do not.
    airframe, k, forget = law.airframe, s.failed, min(dt / (MEMORY * law.times), 1.0)
    lost_from = LOST_FROM * law.thrusts
    own = pattern_of(airframe, k)
    x, y, z = seen
    # How much more of it explains what turns the base.
    off = (own[0] * x + own[1] * y) / (own[0] * own[0] + own[1] * own[1])
    thrust = s.thrust[k]
    # Of both about that axis: with what is lacking along z the opposite one turns the base.
    lacking = min(0.5 * (z - off), 0.0)
    more = max(off, 0.0) if lacking > -UNLIKE * off else 0.0
    s.gives += min(dt / (SMOOTHED * law.times), 1.0) * (thrust + off - s.gives)
    s.failed2 += forget * (off * off - s.failed2)
    s.failed_by_thrust += forget * (off * thrust - s.failed_by_thrust)
    s.failed_thrust2 += forget * (thrust * thrust - s.failed_thrust2)
    s.failed_more2 += forget * (more * more - s.failed_more2)
    # What turns beside what the failed one lacks: a battery that sags lowers all rotors alike,
    # and looks along z like an opposite rotor that is gone.
    turned = (s.effect - 1.0) * thrust - off
    gives_nothing = thrust > lost_from and off < (LOST - 1.0) * thrust
    s.lost_for = s.lost_for + dt if gives_nothing else 0.0
    for i in range(int(airframe.rotors)):
        g, pattern = s.thrust[i], pattern_of(airframe, i)
        across = own[0] * pattern[1] - own[1] * pattern[0]
        along = own[0] * pattern[0] + own[1] * pattern[1]
        # Of rotors that turn the base about one axis only lift tells which one gives how much.
        opposite = abs(across) < ALONG * abs(along)
        other = 0.5 * (z - off)
        unlike = 0.0
        if not opposite:
            other = (own[0] * y - own[1] * x) / across
            unlike = abs(z - (x * pattern[1] - y * pattern[0]) / across - other)
        gone = g > lost_from and other < (LOST - 1.0) * g and unlike < -UNLIKE * other
        gone = gone and (not opposite or turned < UNLIKE * (LOST - 1.0) * g)
        known = i == k or (opposite and along > 0.0)  # or beside it: both leave the same
        s.others_lost_for[i] = s.others_lost_for[i] + dt if gone and not known else 0.0


@compilable
def _observe_slow(r: Tick, law: WatchLaw, dt: float, decay: float, sent: Sent, seen: Vec3) -> None:
    """How rotors twice as slow would turn it, and how alike that is to what is ``seen`` [N]."""
    airframe, s, lever = law.airframe, r.watch, law.airframe.rotor_lever
    for i in range(int(airframe.rotors)):
        before = s.slow[i]
        s.slow[i] = lag_rotor(before, sent.rotor_thrust[i], math.sqrt(decay))
        r.mixer.off[i] = 0.5 * (before + s.slow[i]) - r.mixer.mean[i]
    _, turn = rotor_wrench(airframe, r.mixer.off)
    share, forget = min(OBSERVER / law.times * dt, 1.0), min(dt / (MEMORY * law.times), 1.0)
    s.slow_torque[0] += share * (turn[0] - s.slow_torque[0])
    s.slow_torque[1] += share * (turn[1] - s.slow_torque[1])
    x, y = s.slow_torque[0] / lever, s.slow_torque[1] / lever
    s.slow_by += forget * (x * seen[0] + y * seen[1] - s.slow_by)
    s.slow2 += forget * (x * x + y * y - s.slow2)


@compilable
def mean_square(s: Watched, airframe: Airframe, rotor: int) -> float:
    """Mean square [N^2] of what a rotor gives beside its command, by its pattern."""
    x, y, z = pattern_of(airframe, rotor)
    p, size = s.products, x * x + y * y + z * z
    total = x * x * p[0] + y * y * p[1] + z * z * p[2]
    total += 2.0 * (x * y * p[3] + x * z * p[4] + y * z * p[5])
    return float(total / (size * size))


@compilable
def _judge_rotors(r: Tick, law: WatchLaw, dt: float, settled: bool) -> None:
    s, airframe, weak = r.watch, law.airframe, WEAK * law.thrusts
    if s.failed >= 0:
        _follow_failed(s, law, dt)
        if settled and not s.lost:
            _judge_others(s, law)
        return
    found, most = NO_ROTOR, 0.0
    for i in range(int(airframe.rotors)):
        size = mean_square(s, airframe, i)
        if size > most:
            found, most = i, size
    turning = s.products[0] + s.products[1]
    observed = turning + s.products[2]
    alike = mistaken = False
    if found >= 0:
        pattern = pattern_of(airframe, found)
        explained = dot(pattern, pattern) * most
        alike = most > weak * weak and explained > EXPLAINED * observed
        mistaken = _a_drive_does_this(r, airframe, pattern)
    slow = s.slow_by * s.slow_by > SLOW_SHARE * turning * s.slow2
    if slow and 0.0 < s.slow_by < SLOW * s.slow2:
        mistaken = True
    if not (settled and alike and not mistaken):
        s.suspect, s.suspected = NO_ROTOR, 0.0
        return
    s.suspected = s.suspected + dt if found == s.suspect else 0.0
    s.suspect = found
    strong = STRONG * law.thrusts
    enough = STRONG_TIME if most > strong * strong else WEAK_TIME
    if s.suspected >= enough * law.times:
        _name(s, found, most)


@compilable
def _a_drive_does_this(r: Tick, airframe: Airframe, pattern: Vec3) -> bool:
    """Whether a drive that is dead, or its friction, turns the base about this pattern's axis."""
    s, m = r.watch, r.bodies
    if r.pressing.near > 0:  # what undoes a torque there is the surface
        return False
    for k in range(int(airframe.bodies.joints)):
        x, y = m.reaction[3 * k], m.reaction[3 * k + 1]
        same = abs(x * pattern[0] + y * pattern[1])
        whole = math.sqrt((x * x + y * y) * (pattern[0] * pattern[0] + pattern[1] * pattern[1]))
        if s.undone2[k] > UNDONE * UNDONE and same > 0.5 * whole and whole > 0.1:
            return True
    return False


@compilable
def _name(s: Watched, found: int, size: float) -> None:
    """Follow a failed rotor from now on; ``size`` [N^2] is the mean square by its pattern."""
    s.failed, s.effect, s.quiet_for = found, 1.0, 0.0
    s.gives = s.thrust[found] + s.extra[found]
    s.failed2, s.failed_by_thrust = size, s.by_thrust[found]
    more = max(s.extra[found], 0.0)
    s.failed_thrust2, s.failed_more2 = s.thrust2[found], more * more


@compilable
def _judge_others(s: Watched, law: WatchLaw) -> None:
    """Whether a second rotor is lost; then it is the failed one."""
    for i in range(int(law.airframe.rotors)):
        if s.others_lost_for[i] > LOST_TIME * law.times:
            s.suspect, s.suspected = i, s.others_lost_for[i]
            _name(s, i, mean_square(s, law.airframe, i))
            s.lost, s.disobeys = 1, 0
            return


@compilable
def _follow_failed(s: Watched, law: WatchLaw, dt: float) -> None:
    """What of the failed rotor is left, and whether it is back."""
    astray, quiet_below = ASTRAY * law.thrusts, QUIET * law.thrusts
    thrust2 = max(s.failed_thrust2, 1e-6)
    by_effect = s.failed_by_thrust * s.failed_by_thrust / thrust2
    explained = s.failed2 - by_effect < astray * astray
    # A rotor that comes and goes is no weak one, and flies better as a sound one. One that gives
    # too much at times does not obey.
    if explained and not s.disobeys:
        # By the means of a tenth of a second.
        seen = clamp(1.0 + s.failed_by_thrust / thrust2, 0.0, 1.0)
        towards = max(seen, LEAST_EFFECTIVE) - s.effect
        most = EFFECT_RATE / law.times * dt
        s.effect += clamp(towards, -most, most)
    # Without one that others fly without it is safe to be quick; else it ends the flight.
    sure = STRONG_TIME if law.spares[s.failed] > 0.0 else LOST_TIME
    if s.lost_for > sure * law.times:
        s.lost = 1
    if not explained and s.failed_more2 > astray * astray:
        s.disobeys = 1
    quiet = s.failed2 < quiet_below * quiet_below and not s.lost and not s.disobeys
    s.quiet_for = s.quiet_for + dt if quiet else 0.0
    if s.quiet_for > QUIET_TIME:
        s.failed, s.effect, s.suspect, s.suspected = NO_ROTOR, 1.0, NO_ROTOR, 0.0


@compilable
def _observe_arm(r: Tick, bodies: Bodies, dt: float, torque: Floats) -> None:
    """What acts on the arm beside gravity, its own motion and the torques."""
    s, m, x, joints = r.watch, r.bodies, r.estimate, int(bodies.joints)
    field = 0.0, 0.0, x.specific_force
    observed, forget = min(OBSERVER * dt, 1.0), min(dt / MEMORY, 1.0)
    carried, moved, whole = _yielding(r, joints)
    for k in range(joints):
        gained, drift = m.momentum[k] - s.momentum[k], joint_drift(m, k, field)
        if s.running == 0.0 or s.arm_seen == 0.0:
            gained = dt * (torque[k] + drift)
        s.momentum[k] = m.momentum[k]
        s.undone[k] += OBSERVER * (gained - dt * (torque[k] + drift + s.undone[k]))
        s.asked[k] += observed * (torque[k] - s.asked[k])
        s.undone2[k] += forget * (s.undone[k] * s.undone[k] - s.undone2[k])
        s.asked2[k] += forget * (s.asked[k] * s.asked[k] - s.asked2[k])
        s.undoing[k] += forget * (s.undone[k] * s.asked[k] - s.undoing[k])
        s.rate2[k] += forget * (x.qd_arm[k] * x.qd_arm[k] - s.rate2[k])
        share = r.pressing.along[k] / whole
        yielding = share * carried
        s.unseen[k] += dt * (share * moved)
        s.yielding2[k] += forget * (yielding * yielding - s.yielding2[k])
        behind = r.joints.reference[k] - x.q_arm[k]
        s.behind2[k] += forget * (behind * behind - s.behind2[k])
    # What a drive does not give to the arm it does not take from the base. A contact, and a gyro
    # that is wrong, are felt on one side alone.
    odd2 = 0.0
    for i in range(2):
        odd, felt = s.torque[i], 0.0
        for k in range(joints):
            reaction = m.reaction[3 * k + i]
            odd, felt = odd + reaction * s.undone[k], felt + abs(reaction)
        odd *= min(felt, 1.0)  # what no joint does about an axis says nothing of joints
        odd2 += odd * odd
    s.odd2 += forget * (odd2 - s.odd2)


@compilable
def _yielding(r: Tick, joints: int) -> Vec3:
    """How joints hold a tool in contact where it is.

    The speed [m/s] along the normal that they take from it, in all and beside what is seen, and the
    square of their levers [m^2] for that. No speed without contact.
    """
    k, whole = r.pressing, 0.0
    if k.contact == 0:
        return 0.0, 0.0, 1.0
    carried = moved = -k.speed
    for i in range(joints):
        carried -= k.along[i] * r.estimate.qd_arm[i]
        whole += k.along[i] * k.along[i]
    return carried, moved, max(whole, _SHORT * _SHORT)


@compilable
def felt_inside(r: Tick, airframe: Airframe, felt: Floats) -> None:
    """Write how much of what undoes each joint's torque is ``felt`` nearer to the base (j,) [1].

    By mean squares, of what turns the base beside the model where drives act on it as they are
    asked, and as the arm is seen to move; or of what undoes the torque of a joint between. The
    first is a share of what turns the base: a gyro that is off shows more there than any joint.
    """
    s = r.watch
    turned2 = airframe.rotor_lever**2 * (s.products[0] + s.products[1])
    unseen, inside = s.odd2 - turned2, 0.0
    for k in range(int(airframe.bodies.joints)):
        u = s.undone2[k]
        by_base = unseen / max(u, ODD * ODD, turned2)
        felt[k] = max(by_base, inside / max(u, UNDONE * UNDONE))
        if r.pressing.near > 0:  # what a surface does is felt as well
            felt[k] = 0.0
        inside = max(inside, u)


@compilable
def _forget_arm(s: Watched) -> None:
    """Begin anew when encoders are back."""
    s.arm_seen, s.odd2 = 0.0, 0.0
    s.undone[:], s.asked[:], s.joint_for[:] = 0.0, 0.0, 0.0
    s.undone2[:], s.asked2[:], s.undoing[:] = 0.0, 0.0, 0.0
    s.rate2[:], s.behind2[:], s.yielding2[:], s.stands_for[:] = 0.0, 0.0, 0.0, 0.0


@compilable
def _judge_joint(
    s: Watched, k: int, torques: float, dt: float, settled: bool, angle: float
) -> None:
    if s.joint[k] == STUCK and abs(angle - s.stood_at[k]) > MOVED:
        s.joint[k] = LIMP
    if s.joint[k] != SOUND:
        return
    seen2 = s.undone2[k] / (torques * torques)
    undone = seen2 > UNDONE * UNDONE and s.undoing[k] < -UNDOING * s.asked2[k]
    plainly = seen2 > PLAINLY * PLAINLY and s.undoing[k] < -PLAIN_SHARE * s.asked2[k]
    behind = s.behind2[k] > BEHIND * BEHIND or plainly
    undone = undone and s.odd2 < ODD * ODD + ODD_SHARE * ODD_SHARE * s.undone2[k]
    s.joint_for[k] = s.joint_for[k] + dt if settled and undone and behind else 0.0
    if s.joint_for[k] > JOINT_TIME:
        s.joint[k] = STUCK if s.rate2[k] < STANDING * STANDING else LIMP
        s.stood_at[k] = angle


@compilable
def _judge_yielding(s: Watched, k: int, dt: float, angle: float) -> None:
    """Find a joint that stands where the base carries the arm about and the tool is held."""
    yields2 = s.yielding2[k]
    stands = yields2 > MOVING * MOVING and s.rate2[k] < RIGID * RIGID * yields2
    s.stands_for[k] = s.stands_for[k] + dt if stands else 0.0
    if s.joint[k] == SOUND and s.stands_for[k] > RIGID_TIME:
        s.joint[k], s.stood_at[k] = STUCK, angle
