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
like a single one: what rotors twice as slow would leave is computed as well, and where that much
explains what is observed none has failed.

A joint has failed when torque is observed that undoes what is asked of its drive, and the base does
not feel it either.

Source: A. De Luca, R. Mattone, Actuator failure detection and isolation using generalized momenta,
ICRA 2003, for the joints; docs/decisions/0033-actuators-that-fail.md.
"""

from __future__ import annotations

import math
from typing import Any, Final

from numpy.typing import NDArray

from fsw.autopilot.control.joints import arm_dynamics
from fsw.autopilot.geometry.vectors import clamp
from fsw.autopilot.model.actuator_health import LIMP, SOUND, STUCK
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.rotors import hanging_arm, lag_rotors
from fsw.autopilot.signals import StateEstimate, Vec2, Vec3, Vec4
from fsw.autopilot.tick_record import NO_ROTOR, Watched, watch_anew
from fsw.compiled import compilable, kernel

OBSERVER: Final = 30.0  # 1/s; the gyro's noise in a laboratory's suite is 0.5 N of a rotor then
MEMORY: Final = 0.1  # s, of mean squares
LEARNING: Final = 2.0  # s, of what lasts along z
LEARNING_BELOW: Final = 1.0  # N of a rotor about roll and pitch
SETTLING: Final = 1.0  # s, before anything is found
AIRBORNE: Final = 0.5  # of the weight; with less thrust nothing is found
CONTACT: Final = 3.0  # m/s^2 more than the rotors give: the ground carries
# Healthy flights in all suites, in real air, with another mass, lag, inertia or friction, have
# less, or not for so long (docs/decisions/0033-actuators-that-fail.md).
WEAK: Final = 1.5  # N, root mean square
WEAK_TIME: Final = 0.15  # s
STRONG: Final = 4.0  # N, with which less time is needed
STRONG_TIME: Final = 0.03  # s
EXPLAINED: Final = 0.9  # share of all that is observed
# All rotors are slow, and none has failed, where what is observed is up to SLOW times what rotors
# twice as slow would leave, and that explains SLOW_SHARE of it. Measured beside walls with rotors
# that are twice as slow: 1.05 to 1.26 times, and 0.74 to 0.88.
SLOW: Final = 1.5
SLOW_SHARE: Final = 0.7
LOST: Final = 0.2  # of what is commanded; a rotor that gives less is lost
LOST_TIME: Final = 0.15  # s
LOST_FROM: Final = 4.0  # N commanded; with less it is not seen
UNLIKE: Final = 0.5  # share of what a second rotor lacks that along z may differ
QUIET: Final = 0.75  # N; a rotor below that gives what it is commanded again
QUIET_TIME: Final = 3.0  # s
ASTRAY: Final = 1.2  # N, root mean square of what no effectiveness explains
SMOOTHED: Final = 0.05  # s, of what a rotor gives that does not obey
LEAST_EFFECTIVE: Final = 0.25  # the command grows by four at most
EFFECT_RATE: Final = 2.0  # 1/s, by which allocation follows
# Joints.
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

Law = NDArray[Any]


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
    laws: Law,
    decay: float,
    dt: float,
    angles_known: bool,
) -> bool:
    """Watch the actuators over a tick of ``dt`` [s]; whether any of them has failed by now.

    It reads the command of the record ``before`` (1,) [SI], and estimate and joints of the one
    ``after`` (1,) [SI], whose watch it writes. A rotor's error shrinks by ``decay`` [1]. Where the
    joints' angles are not known by encoders only rotors are judged.
    """
    airframe, sent, r = laws[0], before[0].sent, after[0]
    s, x = r.watch, r.estimate
    thrust = sent.rotor_thrust[0], sent.rotor_thrust[1], sent.rotor_thrust[2], sent.rotor_thrust[3]
    torque = sent.joint_torque[0], sent.joint_torque[1]
    reference = r.joints.reference[0], r.joints.reference[1]
    rate = x.w_WB_B[0], x.w_WB_B[1], x.w_WB_B[2]
    q_arm, qd_arm = (x.q_arm[0], x.q_arm[1]), (x.qd_arm[0], x.qd_arm[1])
    specific_force = x.specific_force
    if s.running == 0.0:
        for i in range(4):
            s.thrust[i] = s.slow[i] = thrust[i]
    _observe_base(s, airframe, decay, dt, thrust, torque[0], rate, q_arm, specific_force)
    if angles_known:
        _observe_arm(s, airframe, dt, torque, reference, rate, q_arm, qd_arm, specific_force)
        s.arm_seen += dt
    else:
        _forget_arm(s)
    total = s.thrust[0] + s.thrust[1] + s.thrust[2] + s.thrust[3]
    weight = airframe.mass * GRAVITY
    if not total > AIRBORNE * weight or s.lift > CONTACT * airframe.mass:
        s.running = 0.0  # on the ground, or about to be
    s.running += dt
    settled = s.running > SETTLING
    _judge_rotors(s, dt, settled)
    for k in range(2):
        _judge_joint(s, k, dt, settled and s.arm_seen > SETTLING, q_arm[k])
    return bool(s.failed >= 0 or s.joint[0] != SOUND or s.joint[1] != SOUND)


@compilable
def _observe_base(
    s: Watched,
    airframe: Airframe,
    decay: float,
    dt: float,
    commanded: Vec4,
    joint1_torque: float,
    rate: Vec3,
    q_arm: Vec2,
    specific_force: float,
) -> None:
    """What turns and lifts the base beside the model, and the means of its products."""
    f = (s.thrust[0], s.thrust[1], s.thrust[2], s.thrust[3])
    g = lag_rotors(f, commanded, decay)
    m = (0.5 * (f[0] + g[0]), 0.5 * (f[1] + g[1]), 0.5 * (f[2] + g[2]), 0.5 * (f[3] + g[3]))
    arm, inertia = airframe.rotor_arm, airframe.inertia
    roll_inertia = hanging_arm(airframe, q_arm).roll_inertia
    wx, wy, wz = rate
    modelled_x = arm * (m[1] - m[3]) - (inertia[2] - inertia[1]) * wy * wz
    modelled_y = arm * (m[2] - m[0]) - joint1_torque - (inertia[0] - inertia[2]) * wz * wx
    gained_x, gained_y = wx - s.rate[0], wy - s.rate[1]
    if s.running == 0.0:
        gained_x, gained_y = modelled_x * dt / roll_inertia, modelled_y * dt / inertia[1]
    share = min(OBSERVER * dt, 1.0)
    s.torque[0] += OBSERVER * (roll_inertia * gained_x - dt * (modelled_x + s.torque[0]))
    s.torque[1] += OBSERVER * (inertia[1] * gained_y - dt * (modelled_y + s.torque[1]))
    total = m[0] + m[1] + m[2] + m[3]
    lift = airframe.mass * specific_force - (1.0 + s.lasting) * total
    s.lift += share * (lift - s.lift)
    x, y, z = s.torque[0] / arm, s.torque[1] / arm, s.lift
    # What the ground carries does not last.
    flies = total > AIRBORNE * airframe.mass * GRAVITY and z <= CONTACT * airframe.mass
    if flies and s.failed < 0 and max(abs(x), abs(y)) < LEARNING_BELOW:
        s.lasting += dt / LEARNING * lift / total
    forget = min(dt / MEMORY, 1.0)
    _observe_slow(s, dt, decay, commanded, m, arm, (x, y, z))
    products = (x * x, y * y, z * z, x * z, y * z)
    for i in range(5):
        s.products[i] += forget * (products[i] - s.products[i])
    extra = (0.5 * (z - y), 0.5 * (z + x), 0.5 * (z + y), 0.5 * (z - x))
    for i in range(4):
        s.thrust[i], s.extra[i] = g[i], extra[i]
        s.by_thrust[i] += forget * (extra[i] * g[i] - s.by_thrust[i])
        s.thrust2[i] += forget * (g[i] * g[i] - s.thrust2[i])
    for i in range(3):
        s.rate[i] = rate[i]
    if s.failed >= 0:
        # Which one is known: what turns the base says how much, and pushes do not.
        k, opposite = s.failed, (s.failed + 2) % 4
        turns = (-y, x, y, -x)
        off, thrust = turns[k], g[k]
        # Of both about that axis: with what is lacking along z the opposite one turns the base.
        lacking = min(0.5 * (z - off), 0.0)
        more = max(off, 0.0) if lacking > -UNLIKE * off else 0.0
        s.gives += min(dt / SMOOTHED, 1.0) * (thrust + off - s.gives)
        s.failed2 += forget * (off * off - s.failed2)
        s.failed_by_thrust += forget * (off * thrust - s.failed_by_thrust)
        s.failed_thrust2 += forget * (thrust * thrust - s.failed_thrust2)
        s.failed_more2 += forget * (more * more - s.failed_more2)
        # What turns beside what the failed one lacks: a battery that sags lowers all rotors alike,
        # and looks along z like an opposite rotor that is gone.
        turned = (s.effect - 1.0) * thrust - off
        gives_nothing = thrust > LOST_FROM and off < (LOST - 1.0) * thrust
        s.lost_for = s.lost_for + dt if gives_nothing else 0.0
        for i in range(4):
            other = 0.5 * (z - off) if i == opposite else turns[i]
            unlike = 0.0 if i == opposite else abs(z - off - other)
            gone = g[i] > LOST_FROM and other < (LOST - 1.0) * g[i] and unlike < -UNLIKE * other
            gone = gone and (i != opposite or turned < UNLIKE * (LOST - 1.0) * g[i])
            s.others_lost_for[i] = s.others_lost_for[i] + dt if gone and i != k else 0.0


@compilable
def _observe_slow(
    s: Watched, dt: float, decay: float, commanded: Vec4, modelled: Vec4, arm: float, seen: Vec3
) -> None:
    """What rotors twice as slow would leave, as what is ``seen`` [N], and how alike both are."""
    f = (s.slow[0], s.slow[1], s.slow[2], s.slow[3])
    g = lag_rotors(f, commanded, math.sqrt(decay))
    off = (
        0.5 * (f[0] + g[0]) - modelled[0],
        0.5 * (f[1] + g[1]) - modelled[1],
        0.5 * (f[2] + g[2]) - modelled[2],
        0.5 * (f[3] + g[3]) - modelled[3],
    )
    share, forget = min(OBSERVER * dt, 1.0), min(dt / MEMORY, 1.0)
    s.slow_torque[0] += share * (arm * (off[1] - off[3]) - s.slow_torque[0])
    s.slow_torque[1] += share * (arm * (off[2] - off[0]) - s.slow_torque[1])
    s.slow_lift += share * (off[0] + off[1] + off[2] + off[3] - s.slow_lift)
    x, y, z = s.slow_torque[0] / arm, s.slow_torque[1] / arm, s.slow_lift
    s.slow_by += forget * (x * seen[0] + y * seen[1] + z * seen[2] - s.slow_by)
    s.slow2 += forget * (x * x + y * y + z * z - s.slow2)
    for i in range(4):
        s.slow[i] = g[i]


@compilable
def mean_square(s: Watched, rotor: int) -> float:
    """Mean square [N^2] of what a rotor gives beside its command, by its pattern (0 to 3)."""
    xx, yy, zz, xz, yz = s.products[0], s.products[1], s.products[2], s.products[3], s.products[4]
    if rotor == 0:
        fourfold = zz + yy - 2.0 * yz
    elif rotor == 1:
        fourfold = zz + xx + 2.0 * xz
    elif rotor == 2:
        fourfold = zz + yy + 2.0 * yz
    else:
        fourfold = zz + xx - 2.0 * xz
    return 0.25 * float(fourfold)


@compilable
def _judge_rotors(s: Watched, dt: float, settled: bool) -> None:
    if s.failed >= 0:
        _follow_failed(s, dt)
        if settled and not s.lost:
            _judge_others(s)
        return
    found, most = NO_ROTOR, 0.0
    for i in range(4):
        size = mean_square(s, i)
        if size > most:
            found, most = i, size
    observed = s.products[0] + s.products[1] + s.products[2]
    alike = most > WEAK * WEAK and 2.0 * most > EXPLAINED * observed
    # A drive of joint 1 that is dead turns the base as well.
    mistaken = (found == 0 or found == 2) and s.undone2[0] > UNDONE * UNDONE
    slow = s.slow_by * s.slow_by > SLOW_SHARE * observed * s.slow2
    if slow and 0.0 < s.slow_by < SLOW * s.slow2:
        mistaken = True
    if not (settled and alike and not mistaken):
        s.suspect, s.suspected = NO_ROTOR, 0.0
        return
    s.suspected = s.suspected + dt if found == s.suspect else 0.0
    s.suspect = found
    if s.suspected >= (STRONG_TIME if most > STRONG * STRONG else WEAK_TIME):
        _name(s, found, most)


@compilable
def _name(s: Watched, found: int, size: float) -> None:
    """Follow a failed rotor from now on; ``size`` [N^2] is the mean square by its pattern."""
    s.failed, s.effect, s.quiet_for = found, 1.0, 0.0
    s.gives = s.thrust[found] + s.extra[found]
    s.failed2, s.failed_by_thrust = size, s.by_thrust[found]
    more = max(s.extra[found], 0.0)
    s.failed_thrust2, s.failed_more2 = s.thrust2[found], more * more


@compilable
def _judge_others(s: Watched) -> None:
    """Whether a second rotor is lost; then it is the failed one."""
    for i in range(4):
        if s.others_lost_for[i] > LOST_TIME:
            s.suspect, s.suspected = i, s.others_lost_for[i]
            _name(s, i, mean_square(s, i))
            s.lost, s.disobeys = 1, 0
            return


@compilable
def effect_seen(s: Watched) -> float:
    """Thrust over command of the failed rotor [1], by the means of a tenth of a second."""
    return clamp(1.0 + float(s.failed_by_thrust) / max(float(s.failed_thrust2), 1e-6), 0.0, 1.0)


@compilable
def _follow_failed(s: Watched, dt: float) -> None:
    """What of the failed rotor is left, and whether it is back."""
    by_effect = s.failed_by_thrust * s.failed_by_thrust / max(s.failed_thrust2, 1e-6)
    explained = s.failed2 - by_effect < ASTRAY * ASTRAY
    # A rotor that comes and goes is no weak one, and flies better as a sound one. One that gives
    # too much at times does not obey.
    if explained and not s.disobeys:
        towards = max(effect_seen(s), LEAST_EFFECTIVE) - s.effect
        s.effect += clamp(towards, -EFFECT_RATE * dt, EFFECT_RATE * dt)
    if s.lost_for > LOST_TIME:
        s.lost = 1
    if not explained and s.failed_more2 > ASTRAY * ASTRAY:
        s.disobeys = 1
    quiet = s.failed2 < QUIET * QUIET and not s.lost and not s.disobeys
    s.quiet_for = s.quiet_for + dt if quiet else 0.0
    if s.quiet_for > QUIET_TIME:
        s.failed, s.effect, s.suspect, s.suspected = NO_ROTOR, 1.0, NO_ROTOR, 0.0


@compilable
def _observe_arm(
    s: Watched,
    airframe: Airframe,
    dt: float,
    torque: Vec2,
    reference: Vec2,
    rate: Vec3,
    q_arm: Vec2,
    qd_arm: Vec2,
    specific_force: float,
) -> None:
    """What acts on the arm beside gravity, its own motion and the torques."""
    none = (0.0, 0.0, 0.0)
    level = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    moving = StateEstimate(0, none, none, level, rate, 0.0, q_arm, qd_arm, specific_force)
    arm = arm_dynamics(airframe, moving, (0.0, specific_force))
    share, forget = min(OBSERVER * dt, 1.0), min(dt / MEMORY, 1.0)
    for k in range(2):
        gained = arm.momentum[k] - s.momentum[k]
        if s.running == 0.0 or s.arm_seen == 0.0:
            gained = dt * (torque[k] + arm.drift[k])
        s.momentum[k] = arm.momentum[k]
        s.undone[k] += OBSERVER * (gained - dt * (torque[k] + arm.drift[k] + s.undone[k]))
        s.asked[k] += share * (torque[k] - s.asked[k])
        s.undone2[k] += forget * (s.undone[k] * s.undone[k] - s.undone2[k])
        s.asked2[k] += forget * (s.asked[k] * s.asked[k] - s.asked2[k])
        s.undoing[k] += forget * (s.undone[k] * s.asked[k] - s.undoing[k])
        s.rate2[k] += forget * (qd_arm[k] * qd_arm[k] - s.rate2[k])
        behind = reference[k] - q_arm[k]
        s.behind2[k] += forget * (behind * behind - s.behind2[k])
    # What a drive does not give to the arm it does not take from the base. A contact, and a gyro
    # that is wrong, are felt on one side alone.
    odd = s.torque[1] + s.undone[0]
    s.odd2 += forget * (odd * odd - s.odd2)


@compilable
def _forget_arm(s: Watched) -> None:
    """Begin anew when encoders are back."""
    s.arm_seen, s.odd2 = 0.0, 0.0
    for k in range(2):
        s.undone[k], s.asked[k], s.joint_for[k] = 0.0, 0.0, 0.0
        s.undone2[k], s.asked2[k], s.undoing[k] = 0.0, 0.0, 0.0
        s.rate2[k], s.behind2[k] = 0.0, 0.0


@compilable
def _judge_joint(s: Watched, k: int, dt: float, settled: bool, angle: float) -> None:
    if s.joint[k] == STUCK and abs(angle - s.stood_at[k]) > MOVED:
        s.joint[k] = LIMP
    if s.joint[k] != SOUND:
        return
    undone = s.undone2[k] > UNDONE * UNDONE and s.undoing[k] < -UNDOING * s.asked2[k]
    plainly = s.undone2[k] > PLAINLY * PLAINLY and s.undoing[k] < -PLAIN_SHARE * s.asked2[k]
    behind = s.behind2[k] > BEHIND * BEHIND or plainly
    undone = undone and s.odd2 < ODD * ODD + ODD_SHARE * ODD_SHARE * s.undone2[k]
    s.joint_for[k] = s.joint_for[k] + dt if settled and undone and behind else 0.0
    if s.joint_for[k] > JOINT_TIME:
        s.joint[k] = STUCK if s.rate2[k] < STANDING * STANDING else LIMP
        s.stood_at[k] = angle
