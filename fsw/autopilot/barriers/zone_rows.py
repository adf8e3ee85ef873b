r"""Every zone of a safe set against every probe of the body, at every node: written once.

A zone is a shape to keep out of or in. Near a probe it is a plane with the unit normal n into the
free side (``fsw.autopilot.shapes``), frozen at the guess, node by node: outside a convex shape the
half-space in front of its tangent plane lies outside the shape, wherever the optimum goes. With the
distance d of the probe's surface to it and w the zone's velocity, the paper's barriers are all

.. math:: h = S(d) + n\cdot(v - w)

(eqs 11, 22 and 23); MPC-HC (eqs 14, 15) takes d itself. Rows of one zone at one node share a slack.

A zone that the tool may touch is kept clear of by all other parts. The tool's ball comes to its
surface no faster than at ``TOUCH_SPEED``, with which it may meet it: ahead of it no clearance and
no reserve :math:`\lambda` is kept. The force is the fast loop's (``fsw.autopilot.control.press``).

A row that cannot bind, whatever the inputs are, is left out exactly: over the horizon no place of
the vehicle can go farther than its speed and the limits on the inputs allow.

Source: docs/equations.md E10, E11, E12, E14, E15, E22, E23;
docs/decisions/0029-shapes-and-a-body.md.
"""

from __future__ import annotations

import math

import numpy as np

from fsw.autopilot.barriers.barrier_function import barrier_value, cbf_lower_bound
from fsw.autopilot.barriers.constraint_block import Rows, TargetPoints, block
from fsw.autopilot.barriers.nearest_place import nearest_place
from fsw.autopilot.barriers.safe_approach import BarrierNumbers, BarrierTuning, safe_approach_slope
from fsw.autopilot.geometry.vectors import dot, three
from fsw.autopilot.model.body import (
    FORM,
    ON,
    OTHER,
    PART,
    RADIUS,
    SPHERE,
    TOOL,
    Body,
    Probes,
    reaches,
)
from fsw.autopilot.model.kinematics import Frame, position, velocity
from fsw.autopilot.model.linearisation import (
    Horizon,
    Linearisation,
    chain,
    fill_slopes,
    fill_turned,
)
from fsw.autopilot.model.prediction import (
    QD_ARM,
    QDD_ARM,
    YAW_ACC,
    YAW_RATE,
    Array,
    CondensedModel,
    J,
)
from fsw.autopilot.shapes.zones import (
    CLEARANCE,
    FOLLOWS,
    FORCE_MAX,
    PLANES,
    Zones,
    all_moving_zones,
    shifts,
    zone_arrays,
)
from fsw.autopilot.signals import SafeSet, Vec3, Vec4
from fsw.compiled import kernel, machine_code

_NO_ROW = 1e3  # residual of a row that is left out
_LEAST_THRUST = 6.0  # m/s^2, specific, within the limits of the inputs
TOUCH_SPEED = 0.05  # m/s, of a tool that meets a surface, at most


# Entries of the settings, for kernels: one array costs what one number costs to hand over.
_DISTANCES, _TIGHTENING, _FIRST, _MOST, _KEPT, _FOLLOWING, _REACH = 0, 1, 2, 3, 7, 13, 19
_LAMBDA = 3  # among the entries of a tuning


def settings(
    tunings: tuple[BarrierTuning, BarrierTuning],
    period: float,
    *,
    distances: bool = False,
    tightening: float = 0.0,
    first_node: int = 1,
    most: Vec4 = (math.inf, 0.0, 0.0, 0.0),
    reach: tuple[float, ...] = (),
) -> Array:
    """What the kernels need to know besides geometry (20 + j,) [SI]; arguments as of ``ZoneRows``.

    ``period`` [s] is the planner's, ``first_node`` [1] the first with rows; ``tightening`` [m],
    ``most`` [m/s^2, rad/s^2], ``reach`` (1 + j,) [m] as of ``model.body.reaches``.
    """
    numbers = [entry for tuning in tunings for entry in tuning.numbers(period)]
    return np.array([distances, tightening, first_node, *most, *numbers, *reach], dtype=np.float64)


class ZoneRows:
    """Rows for zones x probes x planes x nodes, one slack a node and zone."""

    def __init__(
        self,
        safe_set: SafeSet,
        body: Body,
        model: CondensedModel,
        tunings: tuple[BarrierTuning, BarrierTuning],
        *,
        distances: bool = False,
        tightening: float = 0.0,
        skipped_nodes: int | None = None,
        most: Vec4 = (math.inf, 0.0, 0.0, 0.0),
        least_lambda: float = 0.0,
    ) -> None:
        """Lay out the rows of a safe set, to be refilled.

        The first of ``tunings`` is for all zones but those that follow the target. With
        ``distances`` the rows require a distance of ``tightening`` [m] in place of a barrier.
        ``most`` bounds the inputs: horizontal and vertical [m/s^2], yaw and joints [rad/s^2]; by
        default no row is left out. Lambda follows the disturbance down to ``least_lambda`` [m/s]
        if that is not 0, but for zones that follow the target: those have no room to spare.
        """
        self._kept, self._least_lambda = tunings[0], least_lambda
        self._probes = body.probes
        self._period_us = round(1e6 * model.period)
        self.update(safe_set)
        following = self._zones[:, FOLLOWS] > 0.0
        per_zone = self._zones[:, PLANES] * np.where(following, 1, len(self._probes))
        skipped = tunings[0].skipped_nodes if skipped_nodes is None else skipped_nodes
        first_node = 1 + skipped
        self._settings = settings(
            tunings,
            model.period,
            distances=distances,
            tightening=tightening,
            first_node=first_node,
            most=most,
            reach=reaches(body, model.airframe.bodies),
        )
        parts, others = len(body.parts), sum(not part.tool for part in body.parts)
        touched = self._zones[:, FORCE_MAX] > 0.0
        starts = sum(
            1 if follows else others if touch else parts
            for follows, touch in zip(following, touched, strict=True)
        )
        per_group = tuple(per_zone.astype(int).tolist())
        self.rows = block(per_group, first_node, model.horizon, model.inputs, starts)
        self._rows, self._fill = self.rows.rows, machine_code(_fill)

    def update(self, safe_set: SafeSet) -> None:
        """Take other numbers of the same zones: they moved, or their clearance changed."""
        self._zones, self._moving = zone_arrays(safe_set), all_moving_zones(safe_set)
        self._targets: TargetPoints | None = None

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise every row along the normals of the guess."""
        if targets is not self._targets:  # one request has many iterations
            times_us = targets.t_us + self._period_us * np.arange(len(targets.position))
            self._moves = shifts(self._moving, times_us, targets.position, targets.velocity)
            self._targets = targets
            lambda_ = self._kept.following(targets.recent_disturbance, self._least_lambda)
            self._settings[_KEPT + _LAMBDA] = lambda_
        self._fill(
            self._zones,
            self._moves,
            self._probes,
            horizon.horizon,
            self._settings,
            self._rows,
        )


def layout(safe_set: SafeSet) -> tuple[tuple[str, bool, bool], ...]:
    """What of a safe set decides how many rows there are; the rest is numbers."""
    return tuple((zone.shape.kind, zone.keep_in, zone.touch is not None) for zone in safe_set.zones)


@kernel
def _tuning(settings: Array, follows: bool, touches: bool) -> BarrierNumbers:
    at = _FOLLOWING if follows else _KEPT
    return BarrierNumbers(
        settings[at],
        settings[at + 1],
        settings[at + 2],
        0.0 if touches else settings[at + 3],
        settings[at + 4],
        int(settings[at + 5]),
    )


@kernel
def _room_to_touch(zones: Zones, k: int, touches: bool, tuning: BarrierNumbers) -> float:
    """How much nearer [m] than others the tool may come."""
    return zones[k, CLEARANCE] + TOUCH_SPEED / tuning.slope if touches else 0.0


@kernel
def _fill(
    zones: Zones,
    moves: tuple[Array, Array],
    probes: Probes,
    horizon: Horizon,
    settings: Array,
    rows: Rows,
) -> None:
    """All rows; ``moves`` are shift and velocity of the zones at the nodes (n + 1, zones, 3)."""
    distances = settings[_DISTANCES] > 0.0
    frames, impulse, (shifts, speeds) = horizon.frames, horizon.impulse, moves
    gradients, values, least_values = rows.gradient, rows.value, rows.lower_bound
    turned, slopes = horizon.turned, horizon.slopes
    start = frames[0]
    fill_starts(zones, shifts[0], speeds[0], probes, start, settings, distances, rows.start)
    row = 0
    for i in range(int(settings[_FIRST]), len(frames)):
        frame = frames[i]
        reach = _reach(horizon, i, settings)
        approach = 0.0 if distances else reach[1]
        turned_for = (0.0, 0.0, 0.0)
        for k in range(len(zones)):
            follows, shift = zones[k, FOLLOWS] > 0.0, three(shifts[i, k], 0)
            for b in range(1 if follows else len(probes)):
                touches = zones[k, FORCE_MAX] > 0.0 and probes[b, TOOL] > 0.0
                tuning = _tuning(settings, follows, touches)
                radius, on = 0.0 if follows else probes[b, RADIUS], int(probes[b, ON])
                radius -= _room_to_touch(zones, k, touches, tuning)
                for which in range(int(zones[k, PLANES])):
                    local, at, binds = nearest_place(zones, k, which, shift, probes, b, frame)
                    binds = binds and not (touches and (distances or probes[b, FORM] != SPHERE))
                    n, d = (at.nx, at.ny, at.nz), at.distance - radius
                    value, least, steepness = d, settings[_TIGHTENING], 1.0
                    if binds and not distances:
                        value, least, steepness = _barrier(
                            frame, start, on, local, (n, d), (shifts, speeds), i, k, tuning
                        )
                    # Not "<": a row that is no number stays, for the solver to refuse.
                    binds = binds and not value - least >= steepness * reach[0] + approach
                    if binds:
                        if n != turned_for:
                            fill_turned(frame, n, turned)
                            turned_for = n
                        fill_slopes(frame, on, local, n, turned, slopes)
                        if distances:
                            chain(impulse, i, slopes[0], gradients[row])
                        else:
                            for s in range(slopes.shape[1]):
                                slopes[1, s] += steepness * slopes[0, s]
                            chain(impulse, i, slopes[1], gradients[row])
                        values[row], least_values[row] = value, least
                    else:
                        gradients[row] = 0.0
                        values[row], least_values[row] = _NO_ROW, 0.0
                    row += 1


@kernel
def _barrier(
    frame: Frame,
    start: Array,
    on: int,
    local: Vec3,
    plane: tuple[Vec3, float],
    moves: tuple[Array, Array],
    node: int,
    zone: int,
    tuning: BarrierNumbers,
) -> tuple[float, float, float]:
    """h of a place, the least that is allowed, and the slope of S: all at the plane of a node."""
    (n, d), (shifts, speeds) = plane, moves
    p, p0 = position(frame, on, local), position(start, on, local)
    v, v0 = velocity(frame, on, local), velocity(start, on, local)
    # Where the place was at node 0, against the plane where the zone was then.
    d0, rate0, rate = d, 0.0, 0.0
    for axis in range(3):
        moved = shifts[node, zone, axis] - shifts[0, zone, axis]
        d0 += n[axis] * (p0[axis] - p[axis] + moved)
        rate0 += n[axis] * (v0[axis] - speeds[0, zone, axis])
        rate += n[axis] * (v[axis] - speeds[node, zone, axis])
    least = cbf_lower_bound(barrier_value(d0, rate0, tuning), node, tuning)
    steepness = safe_approach_slope(d, tuning.alpha, tuning.slope)
    return barrier_value(d, rate, tuning), least, steepness


@kernel
def _reach(horizon: Horizon, node: int, settings: Array) -> tuple[float, float]:
    """How far [m] and how much faster [m/s] any place can be at a node than at the guess.

    A bound for all inputs within their limits: horizontal, vertical, yaw, joints. A
    place swings about the base by the tilt that a change of acceleration takes, by yaw and joints.
    """
    most, levers = settings[_MOST : _MOST + 4], settings[_REACH:]
    joints = len(levers) - 1
    far = fast = up = up_fast = 0.0
    tilt = tilt_rate = turn = turn_rate = swing = swing_rate = 0.0
    for step in range(node):
        g, at = horizon.impulse[node - 1 - step], (QDD_ARM + joints) * step
        u = horizon.inputs[at : at + QDD_ARM + joints]
        level = most[0] + math.sqrt(u[0] * u[0] + u[1] * u[1])
        vertical = most[1] + abs(u[2])
        far, fast = far + abs(g[0]) * level, fast + abs(g[1]) * level
        up, up_fast = up + abs(g[4]) * vertical, up_fast + abs(g[5]) * vertical
        tilt, tilt_rate = tilt + abs(g[2]) * level, tilt_rate + abs(g[3]) * level
        yaw = most[2] + abs(u[YAW_ACC])
        turn, turn_rate = turn + abs(g[7]) * yaw, turn_rate + abs(g[8]) * yaw
        # Each joint moves what comes after it, no farther off than it reaches.
        arm = 0.0
        for joint in range(joints):
            arm += levers[1 + joint] * (most[3] + abs(u[QDD_ARM + joint]))
        swing, swing_rate = swing + abs(g[9]) * arm, swing_rate + abs(g[10]) * arm
    state = horizon.states[node]
    jerk = math.sqrt(state[J] * state[J] + state[J + 1] * state[J + 1])
    rates = 0.0
    for joint in range(joints):
        rates += abs(state[QD_ARM + 2 * joint])
    # Linearised, a place turns about the base as much as it does for a small turn.
    angle = tilt / _LEAST_THRUST + turn
    rate = tilt_rate / _LEAST_THRUST + turn_rate
    turning = jerk / _LEAST_THRUST + abs(state[YAW_RATE]) + rates
    rate += angle * turning
    swing_rate += swing * turning
    return (
        math.sqrt(far * far + up * up) + angle * levers[0] + swing,
        math.sqrt(fast * fast + up_fast * up_fast) + rate * levers[0] + swing_rate,
    )


@kernel
def fill_starts(
    zones: Zones,
    shift: Array,
    speed: Array,
    probes: Probes,
    frame: Frame,
    settings: Array,
    distances: bool,
    starts: Array,
) -> None:
    """The least value of each zone and part at one instant: h [m/s], or the distance [m].

    ``settings`` (20 + j,) [SI] are as above, ``shift`` (zones, 3) [m, NED] and
    ``speed`` (zones, 3) [m/s, NED] those of the zones. Into ``starts`` (zones x parts,) [SI], zone
    by zone; a zone that follows the target has one entry, one that may be touched none of the
    tool's.
    """
    starts[:] = math.inf
    first = 0
    for k in range(len(zones)):
        follows = zones[k, FOLLOWS] > 0.0
        tuning, moved = _tuning(settings, follows, False), three(shift[k], 0)
        tried = 1 if follows else len(probes)
        # Of the sphere the paper's pair h2a and h2b: towards the nearest place, and away from it.
        planes = 2 if follows else int(zones[k, PLANES])
        touched, count = zones[k, FORCE_MAX] > 0.0, 0
        for b in range(tried):
            if touched and probes[b, TOOL] > 0.0:
                continue
            number = int(probes[b, OTHER if touched else PART])
            at_part, count = first + number, number + 1
            for which in range(planes):
                local, at, _ = nearest_place(zones, k, which, moved, probes, b, frame)
                value = at.distance - (0.0 if follows else probes[b, RADIUS])
                if not distances:
                    n, v = (at.nx, at.ny, at.nz), velocity(frame, int(probes[b, ON]), local)
                    rate = dot(n, v) - n[0] * speed[k, 0] - n[1] * speed[k, 1] - n[2] * speed[k, 2]
                    value = barrier_value(value, rate, tuning)
                starts[at_part] = min(starts[at_part], value)
        first += count
