"""Residuals: what each two of the sensors, or one and the rotors' model, differ by.

How the vehicle turns is said by the gyro (G), by what measures attitudes (the pose P, or the
magnetometer B) and by the rotors' model (M). How it accelerates is said by the accelerometer (A),
by what measures places (P, or satellites N), and by the model. The attitude of a pose (Q) may be
wrong where its place is not; not the other way round. Of each two of them there is a residual over
windows of 0.1 to 3 s. Thresholds of what contains the model follow from how well it has predicted
so far in this flight, those of measurements from the noise that they state and turn out to have.

Source: E. Chow, A. Willsky, Analytical Redundancy and the Design of Robust Failure Detection
Systems, IEEE TAC 29 (1984) 603; docs/decisions/0041-one-law-for-who-is-wrong.md.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.estimation.error_state import (
    BA,
    CONTRADICTED,
    HEIGHT_LASTS,
    NO_FORCE,
    NO_HEADING,
    WITNESS,
)
from fsw.autopilot.estimation.faults.sources import (
    AA,
    AM,
    AN,
    AP,
    COUNT,
    GB,
    GG,
    GM,
    GP,
    MB,
    MN,
    MP_FORCE,
    MP_TURN,
    NN,
    OF,
    B,
    G,
    N,
    P,
    Source,
)
from fsw.autopilot.geometry.quaternion import conjugate, multiply, rotation_vector, turned
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, rotate, rotate_back
from fsw.autopilot.geometry.vectors import (
    add,
    add_scaled,
    clamp,
    cross,
    dot,
    four,
    norm,
    put_three,
    subtract,
    three,
)
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.signals import Mat3, Vec3, Vec4
from fsw.compiled import compilable, kernel, machine_code

Array = NDArray[np.float64]
# What of residuals says nothing, if one of these does: attitudes turn what is felt.
_MASKS: Final = tuple(int(one | (G | B if k in (AN, MN) else 0)) for k, one in enumerate(OF))
# Whose measurements each of them is read at, as ``EVIDENCE.aids``; -1: at each look.
_KINDS: Final = tuple(0 if one & P else 1 if one & N else 2 if one & B else -1 for one in OF)
# Integrals of ``FILTER.witness`` over the time since the vehicle flies, by column: the turn that
# the gyro says (quaternion, and sum of rates [rad, FRD]), velocity and place that the accelerometer
# makes [SI, NED] and that the rotors make, rate and turn that the rotors make [SI, FRD], and what
# is felt beside the rotors [m/s, FRD], the turn in each axis [rad], and the time itself [s].
SAID, FELT, FELT2, MADE, MADE2, SPUN, SPUN2, BESIDE, TURN = 0, 4, 7, 10, 13, 16, 19, 22, 25
LASTS: Final = 28
WINDOWS: Final = (0.1, 0.5, 1.0, 2.0)  # s
EVERY: Final = 0.02  # s, between looks
_LONG: Final = 3.0  # s, over which means of half a second are compared
_MEAN: Final = 0.5  # s
# For so long [s] a reading is in a window, or in the one before it.
CONTAINED: Final = (*(2.0 * window for window in WINDOWS), _LONG + 2.0 * _MEAN)
_ROWS: Final = 256  # looks: 5 s
_STANDS: Final = 0.3  # s
_AIDS: Final = 256  # measurements of a kind, at most one a look
_MEASURED: Final = 1  # column of what is measured, after the time: place and attitude, for example
_AT: Final = 8  # column of the integrals at its time
_SETTLING: Final = 1.0  # s in flight until residuals are looked at
_BASELINE: Final = 5.0  # s, of the mean of biases and of what is felt beside the model
_LIFTS: Final = 5.0  # m/s^2: with less lift the vehicle hardly flies
_LIFT_OFF: Final = 0.3  # by which share the mass, or the rotors, may be off
_LATEST: Final = 0.3  # s, for which a measurement counts after it came
# Of forces [m/s^3/sqrt(Hz)] and rates [rad/s^2/sqrt(Hz)] of the rotors' model: gusts and errors.
MIN_WALKS: Final = (3.0, 0.15)
_LEARNING: Final = 10.0  # s, of the mean squares of residuals with the model
_MODEL_SIGMAS: Final = 5.0  # of them, that are nominal
_NOISE_SIGMAS: Final = 4.0  # of the noise of measurements
_BEND_SIGMAS: Final = 5.5  # the same of second differences of places: two in a row share noise
# The least thresholds, by window [SI]. A gust is a force of 1 to 2 m/s^2 and no turn.
_TURN_OFF: Final = 0.2  # rad/s
_TURN_OFF_AIDED: Final = 0.15  # rad/s
# They are the paper's, whose rotors turn it with so much. Others turn more beside what the model
# says: by what rotors are off by, and by pushes at their origin where a heavy arm has moved the
# centre of mass. So many deviations of a walk of pushes of up to 0.8 m/s^2, each for 0.1 s.
_AGILE: Final = 35.0  # rad/s^2
_PUSHES: Final = 5.0 * 0.8 * math.sqrt(0.1 / 3.0)  # m/s^1.5
_FORCE_OFF: Final = (2.5, 1.8, 1.5, 1.5)  # m/s^2
_FORCE_OFF_AIDED: Final = 0.9  # m/s^2; without an accelerometer nothing tells a gust from a lie
_ACCEL_AT: Final = list(Source).index(Source.ACCELEROMETER)
_PUSH: Final = 1.3  # m/s^2, of a disturbance (``SUR_DISTURB``) and wind (``TRK_WIND_MAX``) together
_GYRO_OFF: Final = 0.012  # rad/s: scale, axes and bias
_GYRO_OFF_LONG: Final = 0.004  # rad/s: bias, and what scale and axes make of turning to and fro
_GYRO_AXES: Final = 0.011  # rad: by how much they are off for each radian that the vehicle turns on
_FIELD_OFF_LONG: Final = 0.012  # rad/s: hard and soft iron of a vehicle that tilts
_IRON: Final = 0.1  # rad: by how much they turn a field, for each radian that the vehicle turns
_ACCEL_OFF: Final = 0.4  # m/s^2: scale, axes, bias and tilt
_SPEED_OFF: Final = 0.08  # m/s
# Biases, of which units of this kind are sold with a third or less (EstimatorTuning).
_ACCEL_BIAS: Final = 0.8  # m/s^2
_GYRO_BIAS: Final = 0.1  # rad/s
_KNOWN: Final = 0.4  # of that
_LEANT: Final = 3.0  # s
# How a vehicle moves between two measurements, of which one may be an outlier: beside the velocity
# that the last two of them show, or with any where there are none.
_GAINS: Final = 15.0  # m/s^2, half of it
_SPEED: Final = 10.0  # m/s
_RATE: Final = 4.0  # rad/s
_FOLLOWS: Final = 0.5  # s, for which that tells garbage
_SELDOM: Final = 0.055  # s between two poses, in the mean of eight
_NOISE: Final = 20.0  # deviations of a place that is extrapolated

EVIDENCE: Final = np.dtype(
    [
        ("looked", float),  # s, when last
        ("silent", float, (len(Source),)),  # s, when each of them said nothing of use last
        ("began", float),  # s, when the vehicle began to fly; -1: it does not
        ("rows", float, (_ROWS, 1 + WITNESS)),  # ring: time [s] and integrals
        ("count", np.int64),
        # Of pose, satellites and compass: ring of measurements with the integrals at their times;
        # one that is far from the last waits until another one says the same.
        ("aids", float, (3, _AIDS, _AT + WITNESS)),
        ("aid_count", np.int64, (3,)),
        ("aid_first", np.int64, (3,)),
        ("waiting", float, (3, _AT + WITNESS)),
        ("waits", np.int64, (3,)),
        ("turns", float, (4,)),  # as of ``FILTER``
        ("squares", float, (COUNT, 4)),  # mean squares of residuals with the model, by window
        # Residual over threshold, by window, the long one last: at the last look, what both of the
        # last two looks have had, and the threshold [SI].
        ("raw", float, (COUNT, 5)),
        ("both", float, (COUNT, 5)),
        ("threshold", float, (COUNT, 5)),
        ("came", float, (COUNT,)),  # s, when it was computed last
        ("ratio", float, (COUNT,)),  # the largest of all windows
        ("size", float, (COUNT,)),  # SI, of that
        # The largest of all windows that hold a time in which somebody has said nothing of use.
        ("unheard", float, (COUNT,)),
        # How far gyro and field have turned apart [rad], how the vehicle has accelerated across by
        # satellites, by window [m/s^2], and what such a heading makes of a residual [m/s^2].
        ("apart", float),
        ("across", float, (5,)),
        ("headed", float, (COUNT,)),
        ("noise", float, (2,)),  # of the last pose: m, rad
        ("tipped", float),  # s, when gyro and poses that come seldom differed by a tilt
    ],
    align=True,
)
Evidence = NDArray[Any]  # (1,) of EVIDENCE
Aid = tuple[bool, float, Vec3, Vec4, float, float]
"""Whether there is one, its time [s], what it measures, and deviations of both [SI]."""
NO_AID: Final[Aid] = (False, 0.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 0.0, 0.0)


def scale_of_turns(agility: float, swing: float) -> Vec4:
    """How much more [1] a vehicle turns beside rotors than the paper's, by window; 1 at least.

    Of its ``agility`` [rad/s^2] and its ``swing`` [rad/m] (``rotors.py``).
    """
    a, b, c, d = [_PUSHES * swing * math.sqrt(window) / _TURN_OFF for window in WINDOWS]
    least = max(agility / _AGILE, 1.0)
    return max(a, least), max(b, least), max(c, least), max(d, least)


def at_start() -> Evidence:
    """What is known before anything was compared."""
    evidence = np.zeros(1, EVIDENCE)
    evidence["silent"] = -math.inf
    return evidence


def note_silence(evidence: Evidence, silent: Source, now: float) -> Source:
    """Note what says nothing of use at ``now`` [s]; what has not for the shortest window."""
    bits, last = int(silent), evidence["silent"][0]  # an operation of flags takes a microsecond
    for place in range(len(last)):
        if bits >> place & 1:
            last[place] = now
    lately = [now - at < CONTAINED[0] for at in last.tolist()]
    return Source(sum([1 << place for place, lost in enumerate(lately) if lost]))


def forget_poses(evidence: Evidence) -> None:
    """Compare poses that come from now on with no earlier ones."""
    s = evidence[0]
    s["aid_first"][0], s["waits"][0] = s["aid_count"][0], 0
    s["came"][[k for k in range(COUNT) if _KINDS[k] == 0]] = -1.0


def pose_stands(evidence: Evidence) -> bool:
    """Whether poses have neither moved nor turned by more than their noise lately."""
    s, most = evidence[0], math.sqrt(2.0) * _NOISE_SIGMAS
    last = int(s["aid_count"][0]) - 1
    newest = s["aids"][0, last % _AIDS]
    for k in range(last - 1, max(int(s["aid_first"][0]), last - _AIDS) - 1, -1):
        row = s["aids"][0, k % _AIDS]
        turn = rotation_vector(
            multiply(conjugate(four(row, _MEASURED + 3)), four(newest, _MEASURED + 3))
        )
        if math.dist(three(row, _MEASURED), three(newest, _MEASURED)) > most * s["noise"][0]:
            return False
        if norm(turn) > most * s["noise"][1]:
            return False
        if newest[0] - row[0] > _STANDS:
            return True
    return False


def size_of(evidence: Evidence, source: Source) -> float:
    """The largest residual [SI] of a ``source`` that fires; 0: none does."""
    s = evidence[0]
    fired = np.where(s["ratio"] > 1.0, s["size"], 0.0)
    return float(max(fired[k] for k in range(COUNT) if OF[k] & source))


@compilable
def witness(x: Any, R: Mat3, dt: float, model: Vec4, pushed: Vec3) -> None:
    """Integrate what everybody says of the tick of ``dt`` [s] that ends now.

    ``R`` [1, body to NED] and the ``model`` [SI, FRD] of ``imu.add_imu``, which is not known where
    the vehicle does not fly: then all begins anew. What the tool touches ``pushed`` it [m/s^2, NED]
    is the model's as well.
    """
    W = x.witness
    if not model[3] > 0.0:
        W[SAID:FELT] = 0.0
        return
    if _begins(W):
        W[:] = 0.0
        W[SAID] = 1.0
        x.baseline[6:9] = 0.0
        for i in range(6):
            x.baseline[i] = x.bias[i]
    f, w = three(x.newest, 0), three(x.newest, 3)
    q = turned(four(W, SAID), dt * w[0], dt * w[1], dt * w[2])
    for i in range(4):
        W[SAID + i] = q[i]
    b = x.baseline
    felt = rotate(R, subtract(f, b))
    own = rotate_back(R, pushed)
    lift = (1.0 + b[9]) * model[3]
    made = rotate(R, (own[0], own[1], own[2] - lift))
    # Biases are as the filter finds them until residuals are looked at, and means from then on: of
    # a mean that begins with nothing known, half would be missing for long.
    W[LASTS] += dt
    share = dt / _BASELINE
    known = dt / min(max(W[LASTS] - _SETTLING, dt), _BASELINE)
    for i in range(3):
        down = GRAVITY if i == 2 else 0.0
        W[FELT + i] += dt * (felt[i] + down)
        W[FELT2 + i] += dt * W[FELT + i]
        W[MADE + i] += dt * (made[i] + down)
        W[MADE2 + i] += dt * W[MADE + i]
        W[SPUN + i] += dt * model[i]
        W[SPUN2 + i] += dt * W[SPUN + i]
        beside = f[i] + (lift if i == 2 else 0.0) - own[i]
        W[BESIDE + i] += dt * beside
        W[TURN + i] += dt * w[i]
        if not (x.suspect & ~NO_HEADING or x.out):
            b[i] += known * (x.bias[i] - b[i])
            b[3 + i] += known * (x.bias[3 + i] - b[3 + i])
            b[6 + i] += share * (beside - b[6 + i])
    unseen = x.time - x.height_time > HEIGHT_LASTS
    if not (unseen or x.suspect & CONTRADICTED or x.out & NO_FORCE):
        _weigh(b, own[2] - f[2] + b[2], model[3], dt / min(W[LASTS], _BASELINE))


@compilable
def _weigh(b: Array, felt: float, thrust: float, share: float) -> None:
    """Learn by which share of itself the rotors lift the vehicle more than the model says.

    ``felt`` [m/s^2, along -z] is what they lift it by, ``thrust`` [m/s^2] what the model says.
    The mass that is flown follows the accelerometer within a second: by that, rotors would
    bear out one that is wrong. This one does so as slowly as biases, and neither while anybody but
    the rotors may be wrong nor while nothing measures the height.
    """
    if thrust > _LIFTS and felt > _LIFTS:
        b[9] += share * (felt / thrust - 1.0 - b[9])
        b[9] = clamp(b[9], -_LIFT_OFF, _LIFT_OFF)


@machine_code
@kernel
def look(
    e: Evidence, numbers: Any, now: float, pose: Aid, fix: Aid, field: Aid, learns: bool
) -> None:
    """Take in the newest measurements at ``now`` [s], and compute all residuals."""
    s, x = e[0], numbers[0]
    s.looked = now
    for k in range(4):
        s.turns[k] = max(x.turns[k], 1.0)
    if _begins(x.witness):
        _begin_anew(s)
        return
    if s.began < 0.0:
        s.began = now
    row = s.rows[s.count % _ROWS]
    row[0] = now
    for i in range(WITNESS):
        row[1 + i] = x.witness[i]
    s.count += 1
    if pose[0]:
        s.noise[0], s.noise[1] = pose[4], pose[5]
    kept = _take(s, 0, pose), _take(s, 1, fix), _take(s, 2, field)
    if now - s.began < _SETTLING:
        return
    _compare(s, x, now, (pose, fix, field), kept, learns)
    _note_bias(s, x, now, 0, AA, _ACCEL_BIAS)
    _note_bias(s, x, now, 1, GG, _GYRO_BIAS)
    for k in range(COUNT):
        _note_largest(s, now, k)
    # How quickly the model has been off, which is what a filter without a half of the unit needs.
    x.model_walk[0] = MIN_WALKS[0]
    x.model_walk[1] = max(s.turns[1] * MIN_WALKS[1], 2.0 * math.sqrt(s.squares[GM, 1] / WINDOWS[1]))


@compilable
def _compare(
    s: Any,
    x: Any,
    now: float,
    aids: tuple[Aid, Aid, Aid],
    kept: tuple[bool, bool, bool],
    learns: bool,
) -> None:
    """Compute the residuals of rotors, and of those measurements that were ``kept``.

    What waits is compared with nothing: the one before it would count a second time.
    """
    bias, lasting = three(x.baseline, 3), three(x.baseline, 6)
    (posed, fixed, fielded), (pose, fix, field) = kept, aids
    for k in range(4):
        felt = not x.out & NO_FORCE and now - s.silent[_ACCEL_AT] >= CONTAINED[k]
        force = _FORCE_OFF_AIDED if felt else _FORCE_OFF[k]
        _unit_and_model(s, now, k, lasting, learns)
        if posed:
            _unit_and_pose(s, now, k, pose[4], pose[5], bias, force, learns)
        if fixed:
            _unit_and_fix(s, now, k, fix[4], fix[5], force, learns)
        if fielded:
            _unit_and_field(s, now, k, field[4], bias, learns)
    if posed:
        _over_long(s, now, 0, pose[5], bias)
    if fielded:
        _over_long(s, now, 2, field[4], bias)


@compilable
def _note_largest(s: Any, now: float, k: int) -> None:
    """Keep what is largest of a residual in all windows."""
    s.ratio[k], s.size[k], s.unheard[k] = 0.0, 0.0, 0.0
    if not now - s.came[k] < _LATEST:
        return
    kind, heard = _KINDS[k], now
    if kind >= 0:  # a measurement is of a time before
        heard = s.aids[kind, (s.aid_count[kind] - 1) % _AIDS, 0]
    silent = -math.inf
    for i in range(len(s.silent)):
        if _MASKS[k] & (1 << i):
            silent = max(silent, s.silent[i])
    for i in range(5):
        if heard - silent < CONTAINED[i]:
            s.unheard[k] = max(s.unheard[k], s.both[k, i])
        elif s.both[k, i] > s.ratio[k]:
            s.ratio[k], s.size[k] = s.both[k, i], s.both[k, i] * s.threshold[k, i]
            s.headed[k] = min(s.apart, 2.0) * s.across[i] if k in (AN, MN) else math.inf


@compilable
def _note_bias(s: Any, x: Any, now: float, half: int, k: int, most: float) -> None:
    """Keep how far the bias of a half is beyond the ``most`` [SI] that its kind has.

    By the square, because it is no noise. Of one that is in doubt, it is the one from before. What
    is known of it no better than when the filter began is no evidence, and neither is a force's
    that was found because measurements leant one way: it may be a tilt's.
    """
    if not half and x.leant_at > 0.0 and x.time - x.leant_at < _LEANT:
        return
    bias = three(x.bias, 3 * half)
    if x.lost & (1 << half):
        bias = three(x.kept_bias, 3 * half)
    else:
        for i in range(BA + 3 * half, BA + 3 * half + 3):
            if x.covariance[i, i] > (_KNOWN * most) ** 2:
                return
    share = norm(bias) / most
    _note(s, now, k, 0, (share * share * most, 0.0, 0.0), most)


@compilable
def _begins(W: Array) -> bool:
    """Whether integrals have not begun: their turn is none."""
    return not (W[SAID] != 0.0 or W[SAID + 1] != 0.0 or W[SAID + 2] != 0.0 or W[SAID + 3] != 0.0)


@compilable
def _begin_anew(s: Any) -> None:
    s.began, s.count, s.apart, s.tipped = -1.0, 0, 0.0, -math.inf
    s.aid_count[:], s.aid_first[:], s.waits[:] = 0, 0, 0
    s.came[:], s.ratio[:] = -1.0, 0.0
    s.raw[:], s.both[:], s.squares[:] = 0.0, 0.0, 0.0


@compilable
def _integrals(s: Any, time: float, row: Array) -> bool:
    """Put into a ``row`` [SI] the integrals at its ``time`` [s]; False: they are not known."""
    for k in range(s.count - 1, max(s.count - _ROWS, 0), -1):
        a, b = s.rows[(k - 1) % _ROWS], s.rows[k % _ROWS]
        if a[0] <= time <= b[0]:
            share = (time - a[0]) / (b[0] - a[0])
            for i in range(WITNESS):
                row[_AT + i] = a[1 + i] + share * (b[1 + i] - a[1 + i])
            return True
    return False


@compilable
def _take(s: Any, kind: int, aid: Aid) -> bool:
    """Keep a measurement, unless it is far from the last one and nothing has confirmed it yet.

    Whether it is kept.
    """
    there, time, place, q, sigma, about = aid
    new = s.waiting[kind]
    if not there:
        return False
    n, first = s.aid_count[kind], s.aid_first[kind]
    last = s.aids[kind, (n - 1) % _AIDS]
    if n > first and time - last[0] < 0.9 * EVERY:
        return False
    v, about_v = (0.0, 0.0, 0.0), _SPEED
    if kind != 2 and n - first >= 2:
        before = s.aids[kind, (n - 2) % _AIDS]
        v, about_v = _difference(last, before, _MEASURED, last[0] - before[0]), 0.0
    turns = 9.0 * about if kind == 0 else math.inf
    room = _NOISE * sigma, about_v, turns, _NOISE * about if kind == 1 else math.inf
    confirmed = s.waits[kind] > 0 and _is_near(new, time, place, q, v, room)
    near = n == first or _is_near(last, time, place, q, v, room)
    # After a while nearly everything may follow the last one: of garbage two do not say the same.
    follows = near and (n == first or time - last[0] < _FOLLOWS)
    known = _integrals(s, time, new)
    new[0] = time
    put_three(new, _MEASURED, place)
    for i in range(4):
        new[_MEASURED + 3 + i] = q[i]
    s.waits[kind] = 0
    if not known:
        return False
    if not follows and not confirmed:
        s.waits[kind] = 1
        return False
    if not near:  # the sensor has jumped: what it said before is of another frame
        s.aid_first[kind] = n
    row = s.aids[kind, n % _AIDS]
    for i in range(_AT + WITNESS):
        row[i] = new[i]
    s.aid_count[kind] = n + 1
    return True


@compilable
def _is_near(row: Array, time: float, place: Vec3, q: Vec4, v: Vec3, room: Vec4) -> bool:
    """Whether a place may follow a ``row`` [SI], at a velocity ``v`` [m/s, NED], with an attitude.

    Or with a velocity, in ``q``. ``room`` [m, m/s, rad, m/s]: of the place, of the velocity ``v``,
    of the attitude, and of the velocity.
    """
    dt = time - row[0]
    off = add_scaled(subtract(place, three(row, _MEASURED)), v, -dt)
    near: bool = norm(off) <= room[0] + room[1] * dt + _GAINS * dt * dt
    if room[3] < math.inf:
        gained = norm(subtract((q[0], q[1], q[2]), three(row, _MEASURED + 3)))
        return near and gained <= 2.0 * _GAINS * dt + room[3]
    if not room[2] < math.inf:
        return near
    turn = rotation_vector(multiply(conjugate(four(row, _MEASURED + 3)), q))
    return near and norm(turn) <= _RATE * dt + room[2]


@compilable
def _before(s: Any, kind: int, at: int, window: float, room: float) -> int:
    """The measurement a ``window`` [s] before that ``at`` [1], within ``room`` [s]; -1: none."""
    wanted = s.aids[kind, at % _AIDS, 0] - window
    best, least = -1, room
    for k in range(at - 1, max(s.aid_first[kind], s.aid_count[kind] - _AIDS + 1) - 1, -1):
        off = s.aids[kind, k % _AIDS, 0] - wanted
        if abs(off) < least:
            best, least = k, abs(off)
        if off < -room:
            break
    return best


@compilable
def _note(s: Any, now: float, k: int, window: int, r: Vec3, threshold: float) -> None:
    """Keep a residual ``r`` [SI] over its ``threshold`` [SI]; a single one may be off."""
    ratio = norm(r) / threshold
    s.threshold[k, window] = threshold
    s.both[k, window] = min(ratio, s.raw[k, window])
    s.raw[k, window] = ratio
    s.came[k] = now


@compilable
def _note_turn(s: Any, now: float, window: int, r: Vec3, threshold: float) -> None:
    """The same of gyro and pose, and when they differed by a tilt while poses came seldom."""
    _note(s, now, GP, window, r, threshold)
    last = s.aid_count[0] - 1
    before = max(last - 8, s.aid_first[0])
    apart = s.aids[0, last % _AIDS, 0] - s.aids[0, before % _AIDS, 0]
    if apart > _SELDOM * (last - before) and math.hypot(r[0], r[1]) > threshold:
        s.tipped = now


@compilable
def _note_model(
    s: Any, now: float, k: int, window: int, r: Vec3, least: float, noise: float, learns: bool
) -> None:
    """The same of one with the rotors' model, of which it is learnt what is nominal."""
    squares = s.squares[k]
    usual = max(least, _MODEL_SIGMAS * math.sqrt(squares[window]))
    _note(s, now, k, window, r, usual + noise)
    if learns:
        size = norm(r)
        squares[window] += EVERY / _LEARNING * (size * size - squares[window])


@compilable
def _unit_and_model(s: Any, now: float, k: int, lasting: Vec3, learns: bool) -> None:
    """How rates have changed, and the force, against rotors; ``lasting`` [m/s^2, FRD] of it."""
    n, back = s.count, round(WINDOWS[k] / EVERY)
    if n < back + 2:
        return
    a, b = s.rows[(n - 2) % _ROWS], s.rows[(n - 1) % _ROWS]
    c, d = s.rows[(n - back - 2) % _ROWS], s.rows[(n - back - 1) % _ROWS]
    last, first, over = b[0] - a[0], d[0] - c[0], b[0] - d[0]
    turn, force = _difference(b, a, 1 + TURN, last), _difference(b, d, 1 + BESIDE, over)
    turn0, spun0 = _difference(d, c, 1 + TURN, first), _difference(d, c, 1 + SPUN2, first)
    spun = _difference(b, a, 1 + SPUN2, last)
    r = _turned_beside(turn, turn0, spun, spun0)
    _note_model(s, now, GM, k, r, s.turns[k] * _TURN_OFF, 0.0, learns)
    _note_model(s, now, AM, k, _beside(force, lasting), _FORCE_OFF[k], 0.0, learns)


@compilable
def _beside(force: Vec3, lasting: Vec3) -> Vec3:
    """A ``force`` [m/s^2, FRD] beside rotors, less of a ``lasting`` one [m/s^2, FRD] what is in it.

    Wind may end at any moment, and turn: across, all that is no more than it was is no news.
    """
    x, y, z = lasting
    size = x * x + y * y
    share = (x * force[0] + y * force[1]) / max(size, 1e-9)
    most = min(1.0, _PUSH / math.sqrt(max(size, 1e-9)))
    share = 1.0 if share > 1.0 else max(share, -most)
    return force[0] - share * x, force[1] - share * y, force[2] - z


@compilable
def _difference(b: Array, a: Array, column: int, over: float) -> Vec3:
    """Three integrals of row ``b`` [SI] less those of ``a`` [SI], ``over`` [s]."""
    return _over(subtract(three(b, column), three(a, column)), over)


@compilable
def _over(a: Vec3, seconds: float) -> Vec3:
    return a[0] / seconds, a[1] / seconds, a[2] / seconds


@compilable
def _turned_beside(rate: Vec3, rate0: Vec3, spun: Vec3, spun0: Vec3) -> Vec3:
    """By how much a rate has changed [rad/s, FRD] beside what rotors have ``spun``."""
    return add_scaled(subtract(subtract(rate, rate0), spun), spun0, 1.0)


@compilable
def _apart(a: Array, b: Array, column: int) -> Vec4:
    """The turn from row ``a`` [SI] to ``b`` [SI]: quaternions, from a ``column`` on."""
    return multiply(conjugate(four(a, column)), four(b, column))


@compilable
def _bend(c: Array, b: Array, a: Array, column: int) -> Vec3:
    """The second difference of three places [m/s^2] in rows ``a``, ``b`` and ``c`` [SI]."""
    first, second = b[0] - a[0], c[0] - b[0]
    v0, v1 = _difference(b, a, column, first), _difference(c, b, column, second)
    return _over(subtract(v1, v0), 0.5 * (first + second))


@compilable
def _unit_and_pose(
    s: Any, now: float, k: int, sigma: float, about: float, bias: Vec3, force: float, learns: bool
) -> None:
    """How poses turn and accelerate against gyro, accelerometer and rotors.

    Poses are known to ``sigma`` [m] and ``about`` [rad], the gyro's ``bias`` [rad/s, FRD]; rotors
    are off by a ``force`` [m/s^2] at least.
    """
    T, last = WINDOWS[k], s.aid_count[0] - 1
    middle = _before(s, 0, last, T, 0.03)
    if middle < 0:
        return
    c, b = s.aids[0, last % _AIDS], s.aids[0, middle % _AIDS]
    over = c[0] - b[0]
    seen, said = _apart(b, c, _MEASURED + 3), _apart(b, c, _AT + SAID)
    off = rotation_vector(multiply(conjugate(said), seen))
    r = add(_over(off, over), bias)
    turning = math.sqrt(6.0) * about / over
    _note_turn(s, now, k, r, _GYRO_OFF + _NOISE_SIGMAS * turning)
    first = _before(s, 0, middle, T, 0.03)
    if first < 0:
        return
    a = s.aids[0, first % _AIDS]
    before = b[0] - a[0]
    turn0, turn = rotation_vector(_apart(a, b, _MEASURED + 3)), rotation_vector(seen)
    spun0, spun = _difference(b, a, _AT + SPUN2, before), _difference(c, b, _AT + SPUN2, over)
    r = _turned_beside(_over(turn, over), _over(turn0, before), spun, spun0)
    least, noise = s.turns[k] * _TURN_OFF_AIDED, 2.0 * _NOISE_SIGMAS * turning
    _note_model(s, now, MP_TURN, k, r, least, noise, learns)
    bent = _bend(c, b, a, _MEASURED)
    felt, made = _bend(c, b, a, _AT + FELT2), _bend(c, b, a, _AT + MADE2)
    noise = _BEND_SIGMAS * math.sqrt(18.0) * sigma / (over * over)
    _note(s, now, AP, k, subtract(bent, felt), _ACCEL_OFF + noise)
    _note_model(s, now, MP_FORCE, k, subtract(bent, made), force, noise, learns)


@compilable
def _unit_and_fix(
    s: Any, now: float, k: int, sigma: float, speed: float, force: float, learns: bool
) -> None:
    """How a receiver's velocity changes against accelerometer and rotors, and its place with it.

    They are known to ``sigma`` [m] and ``speed`` [m/s]; rotors are off by a ``force`` [m/s^2].
    """
    last = s.aid_count[1] - 1
    first = _before(s, 1, last, WINDOWS[k], 0.06)
    if first < 0:
        return
    b, a = s.aids[1, last % _AIDS], s.aids[1, first % _AIDS]
    over, velocity = b[0] - a[0], _MEASURED + 3
    change = _difference(b, a, velocity, over)
    felt, made = _difference(b, a, _AT + FELT, over), _difference(b, a, _AT + MADE, over)
    s.across[k] = math.hypot(change[0], change[1])
    noise = 2.5 * speed / over
    _note(s, now, AN, k, subtract(change, felt), _ACCEL_OFF + noise)
    _note_model(s, now, MN, k, subtract(change, made), force, noise, learns)
    path = (0.0, 0.0, 0.0)
    for j in range(first, last):
        c, d = s.aids[1, j % _AIDS], s.aids[1, (j + 1) % _AIDS]
        both = add(three(c, velocity), three(d, velocity))
        path = add_scaled(path, both, 0.5 * (d[0] - c[0]))
    r = subtract(_difference(b, a, _MEASURED, over), _over(path, over))
    _note(s, now, NN, k, r, _SPEED_OFF + _NOISE_SIGMAS * math.sqrt(6.0) * sigma / over)


@compilable
def _field_off(a: Array, b: Array) -> Vec3:
    """The turn [rad, FRD] that the field in row ``b`` [SI] shows beside what the gyro said."""
    said = matrix_from_quaternion(_apart(a, b, _AT + SAID))
    u = rotate_back(said, three(a, _MEASURED))
    v = three(b, _MEASURED)
    return _over(cross(u, v), -dot(v, v))


@compilable
def _unit_and_field(s: Any, now: float, k: int, noise: float, bias: Vec3, learns: bool) -> None:
    """How the Earth's field turns in body axes against gyro and rotors.

    It is known to ``noise`` [Gauss], the gyro's ``bias`` [rad/s, FRD]; a turn about it is not seen.
    """
    T, last = WINDOWS[k], s.aid_count[2] - 1
    middle = _before(s, 2, last, T, 0.03)
    if middle < 0:
        return
    c, b = s.aids[2, last % _AIDS], s.aids[2, middle % _AIDS]
    over, off, v = c[0] - b[0], _field_off(b, c), three(c, _MEASURED)
    off = _over(off, over)
    iron = _IRON * norm(rotation_vector(_apart(b, c, _AT + SAID)))
    noise = _NOISE_SIGMAS * noise / max(norm(v), 1e-3)
    r, threshold = _across(bias, v, off), _GYRO_OFF + (iron + noise) / over
    _note(s, now, GB, k, r, threshold)
    s.apart = max(s.apart, (norm(r) + threshold) * over)
    first = _before(s, 2, middle, T, 0.03)
    if first < 0:
        return
    a = s.aids[2, first % _AIDS]
    before, off0 = b[0] - a[0], _field_off(a, b)
    turn, turn0 = _difference(c, b, _AT + TURN, over), _difference(b, a, _AT + TURN, before)
    spun, spun0 = _difference(c, b, _AT + SPUN2, over), _difference(b, a, _AT + SPUN2, before)
    rate, rate0 = add_scaled(turn, off, 1.0), add_scaled(turn0, off0, 1.0 / before)
    r = _turned_beside(rate, rate0, spun, spun0)
    iron += _IRON * norm(rotation_vector(_apart(a, b, _AT + SAID)))
    room = (iron + 2.0 * noise) / over
    across, least = _across(r, v, (0.0, 0.0, 0.0)), s.turns[k] * _TURN_OFF_AIDED
    _note_model(s, now, MB, k, across, least, room, learns)


@compilable
def _across(a: Vec3, v: Vec3, r: Vec3) -> Vec3:
    """What of ``a`` is at right angles to the field ``v`` [Gauss], added to ``r``, both [rad/s]."""
    size = max(norm(v), 1e-3)
    along = dot(a, v) / (size * size)
    return r[0] + a[0] - along * v[0], r[1] + a[1] - along * v[1], r[2] + a[2] - along * v[2]


@compilable
def _over_long(s: Any, now: float, kind: int, about: float, bias: Vec3) -> None:
    """Means over half a second, 3 s apart, of how far gyro and attitudes have turned apart.

    Attitudes are known to ``about`` [rad], or the field [Gauss]; the gyro's ``bias`` [rad/s, FRD].
    """
    last = s.aid_count[kind] - 1
    time = s.aids[kind, last % _AIDS, 0]
    first = _before(s, kind, last, _LONG + _MEAN, 0.1)
    if first < 0:
        return
    a, n, m, t0, t1 = s.aids[kind, first % _AIDS], 0, 0, 0.0, 0.0
    off0 = off1 = (0.0, 0.0, 0.0)
    for j in range(first, last + 1):
        b = s.aids[kind, j % _AIDS]
        early, late = b[0] <= a[0] + _MEAN, b[0] >= time - _MEAN
        if not (early or late):
            continue
        off = (
            rotation_vector(
                multiply(conjugate(_apart(a, b, _AT + SAID)), _apart(a, b, _MEASURED + 3))
            )
            if kind == 0
            else _field_off(a, b)
        )
        if early:
            off0, t0, n = add(off0, off), t0 + b[0], n + 1
        else:
            off1, t1, m = add(off1, off), t1 + b[0], m + 1
    if n < 2 or m < 2:
        return
    over = t1 / m - t0 / n
    r = _over(subtract(_over(off1, m), _over(off0, n)), over)
    b = s.aids[kind, last % _AIDS]
    turned_on = norm(rotation_vector(_apart(a, b, _AT + SAID)))
    if kind == 0:
        r = add(r, bias)
        noise = _NOISE_SIGMAS * math.sqrt(3.0 / n + 3.0 / m) * about
        _note_turn(s, now, 4, r, _GYRO_OFF_LONG + (_GYRO_AXES * turned_on + noise) / over)
    else:
        iron = _IRON * turned_on / over
        _note(s, now, GB, 4, _across(bias, three(b, _MEASURED), r), _FIELD_OFF_LONG + iron)
