r"""What measurements of the error-state filter share: the gate, places, and what is forgotten.

How a sensor is fused, its residual and slope over the error, is in its own file (``sensors/``). A
measurement lies up to one period of the IMU beside the filter's time: the state is moved there by
its own velocity, acceleration and rate. One whose chi-square is beyond its gate is not fused.

Source: J. Solà, Quaternion kinematics for the error-state Kalman filter, 2017, section 6.1.
"""

from __future__ import annotations

import math
from typing import Any, Final

from fsw.autopilot.estimation.error_state import (
    BA,
    DELAY,
    LAGS,
    NO_HEADING,
    NOTHING,
    Filter,
    P,
    V,
    correct,
    distance,
    reset_covariance,
)
from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from fsw.autopilot.geometry.vectors import (
    ZERO,
    add,
    add_scaled,
    dot,
    four,
    norm,
    put_three,
    subtract,
    three,
)
from fsw.autopilot.signals import Vec3
from fsw.compiled import compilable, kernel, machine_code

REFUTED_FOR: Final = 2.0  # s; poses that were refuted so lately make nobody else doubted
# Of the chi-square of a part whose other part is refused.
_DOUBTED_GATE = 0.05
# Of how a variance follows the noise that there is with each measurement, and by at most so much.
_RATE = 0.06
_MOST = 6.0
# By what differences of innovations are beyond which are expected, variances grow.
_SCALE_FROM = 2.0
_SCALE_LIMIT = 100.0  # ten times the stated deviation: what is beyond is no noise, but garbage
_GARBAGE = 20.0  # of one axis: what is as far beyond that
# Innovations in a row, each over its deviation, lean one way from so large a sum on that keeps so
# much of itself from one to the next; a single one counts by at most a share of that.
_KEEPS = 0.8
_LEANS = 8.0
_COUNTS = 0.55
_LEAPS = 4.5  # deviations, and what a force makes from one to the next: no growth makes more
_SUM, _LAST, _LEAPT = 0, 1, 2  # what is remembered of each kind
_MIN_SCATTER = 0.14  # a receiver knows its velocity better than it is believed, by at most that
_EXPLAINED = NOTHING | NO_HEADING  # who may be wrong then without a force's being so
# What is not known of a state that poses contradict by little: standard deviations.
_DOUBTED_PLACE: Final = 0.05  # m
_DOUBTED_SPEED: Final = 0.5  # m/s
# What is not known of a force then, for how long it has been so, and how well that is known.
_LEANT_FORCE = 3.0  # m/s^2
_LEANT_FOR = 0.2  # s
_LEANT_ABOUT = 0.1  # s
# Noise that is alike from one measurement to the next differs from one ``LAGS`` before, and goes
# back as far. A scale of that is more by chance than this one is used.
_LAG_RATE = 0.12
_LAG_MOST = 12.0  # as quickly as over the last one: until noise is known, a pose contradicts others
_SURELY = 12.0
_LAG_FROM = 1.2  # from then on, and less than before: what is alike after the lag is missing
# Of what variances are scaled: place and attitude of a pose, place and velocity of satellites.
POSE, GNSS = 0, 2


@compilable
def believable(variance: Vec3, least: float) -> Vec3:
    """A ``variance`` [any unit, any frame], at least ``least`` [same unit] where it is one."""
    x, y, z = variance
    # NaN and zero mean that the sensor does not know; both fail the comparison.
    return (x if x > least else least, y if y > least else least, z if z > least else least)


@compilable
def followed(scale: float, squared: float, start: float) -> float:
    """By how much variances are larger than stated, after a measurement; ``scale`` [1] before it.

    ``squared`` [1] is the square of by how much its innovation differs from the last one, over the
    variance of an innovation. Beyond twice ``start`` [1] they grow.
    """
    grown: float = max(scale, 1.0) * math.exp(_RATE * (min(0.5 * squared, _MOST) - start))
    return max(grown, 1.0)


@compilable
def clear(x: Any, rows: int) -> None:
    """Slopes of some ``rows`` [1] of a state ``x`` [SI]: none."""
    x.H[:rows, :] = 0.0


@compilable
def judged(
    x: Any, rows: int, gate: float, part: int = 0, scaled: int = -1, doubted: bool = False
) -> float:
    """Chi-square over ``gate`` [1] of a part of a measurement; fuses what is within it.

    The variance of what is ``scaled`` grows where innovations say that it is larger than stated.
    They say so by how they differ from one to the next: noise is what does not stay. What stays is
    somebody's error, and no reason to believe a measurement less. Of what stays and grows the force
    is doubted that predicts. A part is ``doubted`` whose sensor's other part is refused: what is
    wrong in one may be so in both, so it must be nearer, and says nothing of a force.
    """
    for k in range(rows):
        x.innovation[part, k] = x.residual[k]
        if scaled >= 0:
            x.variance[k] *= max(x.noise_scale[scaled], 1.0)
    gate *= _DOUBTED_GATE if doubted else 1.0
    ratio = distance(x, rows) / gate
    leans = scaled >= 0 and not doubted and _leans(x, scaled) and not x.suspect & _EXPLAINED
    if leans and x.time - x.refuted[1] > REFUTED_FOR:
        _doubt_force(x)
        for k in range(rows):
            x.residual[k] = x.innovation[part, k]
        ratio = distance(x, rows) / gate
    if ratio <= 1.0:
        correct(x, rows)
        if x.H[rows - 1, P + 2] != 0.0:
            x.height_time = x.time
    if scaled >= 0:
        _follow_noise(x, rows, part, scaled)
    return ratio


@compilable
def _leans(x: Any, scaled: int) -> bool:
    """Whether innovations of a kind that is ``scaled`` [1] lean one way, by a leaky sum of them.

    Noise does not, nor does what has leapt and not grown.
    """
    # Satellites' places wander. What is wrong beside a pose that does not drift, or an attitude,
    # the law for who is wrong finds soon enough, and a pose's delay leans as well.
    if not (scaled == GNSS + 1 or (scaled == POSE and x.drifts)):
        return False
    memory = x.leaning[scaled]
    scatter = math.sqrt(max(x.scatter[scaled], 1.0 if scaled == POSE else _MIN_SCATTER))
    # An accelerometer that is wrong shows at 10 Hz as a step of many deviations, and stays.
    force = _LEANT_FORCE * (x.time - x.innovated_at[scaled]) if scaled == GNSS + 1 else 0.0
    most = _LEAPS * scatter + force / x.factor[0, 0]
    grown, leaps = _without_leap(memory, three(x.residual, 0), most)
    x.innovated_at[scaled], most = x.time, _LEANS * scatter
    share = 1.0 / max(norm(grown) / (_COUNTS * most), 1.0)
    total = ZERO
    if not leaps:
        kept = add_scaled(ZERO, three(memory[_SUM], 0), _KEEPS)
        total = add_scaled(kept, grown, share)
    leans = dot(total, total) >= most * most
    if leans:
        x.leant_at, total = x.time, ZERO
    put_three(memory[_SUM], 0, total)
    return leans


@compilable
def _without_leap(memory: Any, z: Vec3, most: float) -> tuple[Vec3, bool]:
    """An innovation ``z`` [1], over its deviation, without what has leapt; whether it leaps.

    That is by more than ``most`` [1] from the last one. It is left out as far as it stays, and
    less and less as the filter takes it in.
    """
    step = subtract(z, three(memory[_LAST], 0))
    leaps = dot(step, step) > most * most
    leapt = add_scaled(ZERO, three(memory[_LEAPT], 0), _KEEPS)
    if leaps:
        leapt = add(leapt, step)
    put_three(memory[_LAST], 0, z)
    put_three(memory[_LEAPT], 0, leapt)
    stays = min(max(dot(leapt, z) / max(dot(leapt, leapt), 1e-12), 0.0), 1.0)
    return add_scaled(z, leapt, -stays), leaps


@compilable
def _doubt_force(x: Any) -> None:
    """Know little of the accelerometer's bias, and of what it has made of velocity and place.

    One cause, so that the next measurement tells all of it: what grows is known too late to wait
    until velocities have been seen.
    """
    M, R, variance = x.covariance, matrix_from_quaternion(four(x.q)), _LEANT_FORCE * _LEANT_FORCE
    fast, far = _LEANT_FOR, 0.5 * _LEANT_FOR * _LEANT_FOR
    for i in range(3):
        M[P + i, P + i] += far * far * variance
        M[V + i, V + i] += (fast * fast + _LEANT_ABOUT * _LEANT_ABOUT) * variance
        M[BA + i, BA + i] += variance
        both = far * fast * variance
        M[P + i, V + i] += both
        M[V + i, P + i] += both
        for j in range(3):
            turned = R[3 * i + j] * variance
            M[P + i, BA + j] -= far * turned
            M[BA + j, P + i] -= far * turned
            M[V + i, BA + j] -= fast * turned
            M[BA + j, V + i] -= fast * turned


@compilable
def _follow_noise(x: Any, rows: int, part: int, scaled: int) -> None:
    """Let a scale of variances follow how innovations differ, from the last and from before it.

    What differs by more than the largest scale explains is no noise, and makes none.
    """
    L, y, squared, beyond = x.factor, x.innovated, 0.0, 0.0
    for k in range(rows):
        total = x.innovation[part, k] - x.innovated_last[scaled, k]
        x.innovated_last[scaled, k] = x.innovation[part, k]
        beyond += total * total / (_variance(x, k) + _more(x, k, scaled))
        for j in range(k):
            total -= L[k, j] * y[j]
        y[k] = total / L[k, k]
        squared += y[k] * y[k]
    if beyond > _GARBAGE * rows:
        squared = 0.0
    x.scatter[scaled] += _RATE * (min(0.5 * squared / rows, _MOST) - x.scatter[scaled])
    own = x.noise_by_lag[scaled]
    own[0] = min(followed(own[0], squared / rows, _SCALE_FROM), _SCALE_LIMIT)
    largest, count = own[0], x.innovations[scaled]
    for lag in range(len(LAGS) if scaled in (POSE, GNSS) else 0):  # of places
        if count % LAGS[lag] == 0:
            _look_back(x, rows, part, scaled, lag)
        largest = max(largest, own[1 + lag] / _SURELY)
    x.innovations[scaled] = count + 1
    x.noise_scale[scaled] = largest


@compilable
def _variance(x: Any, k: int) -> float:
    """Variance [SI] of an innovation's row ``k`` [1]."""
    total = 0.0
    for j in range(k + 1):
        total += x.factor[k, j] * x.factor[k, j]
    return total


@compilable
def _more(x: Any, k: int, scaled: int) -> float:
    """By how much more [SI] it would be with the largest scale."""
    more: float = (_SCALE_LIMIT / max(x.noise_scale[scaled], 1.0) - 1.0) * x.variance[k]
    return more


@compilable
def _look_back(x: Any, rows: int, part: int, scaled: int, lag: int) -> None:
    """Let the scale of a ``lag`` [1] follow how far the innovation has gone back since.

    Of two differences in a row noise makes one against the other, as far as it is another noise
    after the lag. What grows, somebody's error, makes both alike, and counts for nothing.
    """
    before, returned, beyond = x.innovated_before[scaled, lag], 0.0, 0.0
    for k in range(rows):
        gone, variance = x.innovation[part, k] - before[0, k], _variance(x, k)
        returned -= gone * before[1, k] / variance
        beyond += gone * gone / (variance + _more(x, k, scaled))
        before[0, k], before[1, k] = x.innovation[part, k], gone
    if beyond > _GARBAGE * rows:
        returned = 0.0
    scale = max(x.noise_by_lag[scaled, 1 + lag], 1.0)
    start = _LAG_FROM if scale > _SURELY else _SCALE_FROM
    grown = scale * math.exp(_LAG_RATE * (min(max(returned / rows, -_MOST), _LAG_MOST) - start))
    x.noise_by_lag[scaled, 1 + lag] = min(grown, _SURELY * _SCALE_LIMIT)


@compilable
def position_rows(x: Any, z: Vec3, variance: Vec3, dt: float, delayed: float) -> None:
    """Rows of a position ``z`` [m, NED] of ``variance`` [m^2, NED], ``dt`` [s] after the state.

    ``delayed`` [1] is 1 where its delay is estimated, else 0.
    """
    clear(x, 3)
    for i in range(3):
        moving = x.v[i] + dt * x.acceleration[i]
        x.residual[i] = z[i] - (x.p[i] + dt * (x.v[i] + 0.5 * dt * x.acceleration[i]))
        x.H[i, P + i] = 1.0
        x.H[i, V + i] = dt
        x.H[i, DELAY] = -delayed * moving
        x.variance[i] = variance[i]


@machine_code
@kernel
def set_place(x: Filter, time: float, p: Vec3, variance: Vec3) -> Vec3:
    """Take ``p`` [m, NED] of ``time`` [s] as it is, ``variance`` [m^2, NED]; how far it jumped."""
    s = x[0]
    dt = time - s.time
    jump = add_scaled(subtract(p, s.p), s.v, -dt)
    put_three(s.p, 0, add(s.p, jump))
    forget(s, P, variance)
    s.height_time = s.time
    return jump


@compilable
def forget(x: Any, first: int, variance: Vec3) -> None:
    """Give three errors of a state ``x`` [SI] a ``variance`` [SI, of x] anew."""
    for i in range(3):
        reset_covariance(x, x.covariance, first + i, variance[i])


@machine_code
@kernel
def doubt_force(filters: Filter) -> None:
    """Know little more of a state whose place poses contradict, and whose attitude they do not.

    By little, which may be chance in any direction: the accelerometer may have led it there.
    """
    M = filters[0].covariance
    for i in range(3):
        M[P + i, P + i] += _DOUBTED_PLACE * _DOUBTED_PLACE
        M[V + i, V + i] += _DOUBTED_SPEED * _DOUBTED_SPEED
        M[BA + i, BA + i] += _LEANT_FORCE * _LEANT_FORCE
