r"""Whether a configuration can keep its safe set at all, before anything flies.

The paper's :math:`\lambda \in \{1, 5\}` cannot be met in its own workspace sphere: at the
centre, at rest, :math:`h = S(r)`, which would have to be at least :math:`\lambda`. Such
contradictions show in a few inequalities. Each finding states one of them, whether it
holds, and the nearest value that is enough.

Source: docs/equations.md T5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fsw.autopilot.barriers.safe_approach import LOUD, BarrierTuning, stand_off
from fsw.autopilot.control.gains import tracking_gains
from fsw.autopilot.control.part_tube import LoopOfParts, PartReach, part_reaches, towards
from fsw.autopilot.control.px4_tube import is_stable, px4_tube
from fsw.autopilot.control.tube import (
    Tube,
    all_axes,
    all_axes_up_to,
    base_after,
    base_reach,
    estimate_tube,
    limits_used,
    tube,
)
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.model.multibody import posture
from fsw.autopilot.model.rotors import swing
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.touching import against_touching
from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.ball import is_point
from fsw.autopilot.signals import SafeSet, Zone

_SIGMAS = 3.0  # that count where clearances do not grow
# How far what turns the base may move it off its plan. Vehicles that come with Pandion have 5 mm at
# most; two that had 21 and 22 mm left the safe set.
_TURNED = 0.01  # m
# Times a limit that the worst disturbance uses, from which a loop is none: one that needed seven
# times its jerk flew into a wall in still air.
_SATURATED = 2.0
_SEEN_S = 0.02  # in which the observer sees what begins: two of its time constants


@dataclass(frozen=True, slots=True)
class Finding:
    """One inequality of the analysis."""

    name: str
    left: float  # of what is compared, in its unit; negative: it does not hold
    statement: str  # with numbers, and what is enough where it does not hold
    refuses: bool = True  # a finding that only warns says False

    @property
    def holds(self) -> bool:
        """Whether the inequality does."""
        return self.left >= 0.0


@dataclass(frozen=True, slots=True)
class Accuracy:
    """Standard deviations of an estimate, each of its worst axis."""

    source: str  # of positions
    position: float  # m, of the part of the body that is least certain
    velocity: float  # m/s
    tilt: float  # rad


def analyse(config: FlightConfig, safe_set: SafeSet, loop: Tube) -> tuple[Finding, ...]:
    """Every finding about a controller with barriers in a safe set; there is none for the others.

    A zone needs what a wall needs: it lies behind its tangent plane, and going round it only takes
    the vehicle off that plane. The loop is ``loop_tube(config)``, which takes a moment and
    does not depend on the safe set.
    """
    planner = config.planner
    if config.controller != "blf" or not safe_set.zones:
        return ()
    spheres = [zone for zone in safe_set.zones if kind_of(zone.shape).follows_target]
    others = [zone for zone in safe_set.zones if zone not in spheres]
    findings: list[Finding] = []
    for sphere in spheres:
        radius = sphere.shape.numbers[-1]
        findings.append(_actuation(config, planner.workspace, radius))
        findings.append(_room_in_sphere(planner.workspace, radius))
        if config.inner == "tracking":
            findings.append(_wind_in_sphere(planner.workspace, loop, radius))
    if others:
        findings.append(_actuation(config, planner.walls, math.inf))
        findings += _links(config, others)
    for tuning, zones in ((planner.workspace, spheres), (planner.walls, others)):
        if zones:
            findings += _loop_beside(config, tuning, loop, SafeSet(tuple(zones)))
    if config.is_above_px4:
        findings += _px4_loops(config, loop, others)
    findings += _touched(config, safe_set, loop)
    if config.inner == "tracking":
        findings.append(_turned(config))
        if others:
            findings += _tubes_of_parts(config, loop, others)
            findings += _returns(config, loop)
        findings.append(_limits(config, loop))
    return tuple(findings)


def _touched(config: FlightConfig, safe_set: SafeSet, loop: Tube) -> list[Finding]:
    """What can be promised at each surface that may be touched, or why nothing can."""
    found = []
    for number, zone in enumerate(safe_set.zones, start=1):
        if zone.touch is not None:
            against = against_touching(config, zone, loop)
            why = f"zone {number} cannot be touched: {against}"
            found.append(Finding("touch", -1.0 if against else 0.0, why))
    return found


def _loop_beside(
    config: FlightConfig, tuning: BarrierTuning, loop: Tube, kept: SafeSet
) -> list[Finding]:
    """Whether what a plan keeps from zones of one kind is enough for the loop that follows it."""
    disturbance = config.surroundings.disturbance
    if not config.follows_plan:
        return [_sampled(tuning, disturbance, config.planner.period)]
    if config.is_above_px4 and not is_stable(config.px4):
        return []  # nothing bounds it
    found = [_base_tube(tuning, loop, disturbance)]
    if config.inner == "tracking":
        found.append(_tube_of_all_axes(config, tuning, loop, kept))
    return found


def refusals(findings: tuple[Finding, ...]) -> tuple[str, ...]:
    """The statements that speak against flying."""
    return tuple(f.statement for f in findings if f.refuses and not f.holds)


def weakened(findings: tuple[Finding, ...], before: tuple[Finding, ...]) -> list[Finding]:
    """Those that held ``before`` and do not now, or that refuse and have less left than before."""
    had: dict[str, float] = {}
    for one in before:
        had[one.name] = min(one.left, had.get(one.name, math.inf))

    def is_weaker(one: Finding) -> bool:
        left = had.get(one.name, 0.0)
        return not one.holds and (left >= 0.0 or (one.refuses and one.left < left))

    return [one for one in findings if is_weaker(one)]


def warnings(findings: tuple[Finding, ...]) -> tuple[str, ...]:
    """The statements an operator should know and may fly with."""
    return tuple(f.statement for f in findings if not f.refuses and not f.holds)


def loop_tube(config: FlightConfig) -> Tube:
    """Tube of the loops that follow the plan, ours or PX4's, per m/s^2 of disturbance."""
    pushed = config.surroundings.hanging, config.surroundings.disturbance_hold, config.tick
    if config.is_above_px4:
        return px4_tube(config.px4, *pushed)
    return tube(config.airframe, config.tuning.tracking, *pushed)


def estimate_reach(config: FlightConfig, accuracy: Accuracy) -> float:
    """How far [m] an estimate of an accuracy leads the base off its plan: what it adds to the tube.

    At as many sigma as clearances grow by, besides the position's own error, by which these grow.
    Errors of position, velocity and tilt are bounded however they change; what the gyro's noise
    does is known by its spectrum.
    """
    moved = estimate_tube(config.airframe, config.tuning.tracking, config.tick)
    sigmas = config.limits.clearance_sigmas or _SIGMAS
    noise = GRAVITY * config.estimator.gyro_noise / math.sqrt(config.tick)
    loop = (
        (moved.position - 1.0) * accuracy.position
        + moved.velocity * accuracy.velocity
        + moved.acceleration * GRAVITY * accuracy.tilt
        + moved.jerk * noise
    )
    return sigmas * loop


def estimate_findings(
    config: FlightConfig, safe_set: SafeSet, loop: Tube, accuracy: Accuracy
) -> tuple[Finding, ...]:
    """Whether what a plan keeps is enough for an estimate of an accuracy as well.

    The loop is ``loop_tube(config)``. Nothing without barriers, or of a loop that follows no state.
    """
    if config.controller != "blf" or config.inner != "tracking":
        return ()
    planner, follows = config.planner, [kind_of(z.shape).follows_target for z in safe_set.zones]
    findings = []
    if any(follows):
        findings.append(_estimate(config, planner.workspace, loop, accuracy, inside=True))
    if not all(follows):
        findings.append(_estimate(config, planner.walls, loop, accuracy, inside=False))
    return tuple(findings)


def _estimate(
    config: FlightConfig, tuning: BarrierTuning, loop: Tube, accuracy: Accuracy, *, inside: bool
) -> Finding:
    reach, room = estimate_reach(config, accuracy), stand_off(tuning)
    sigmas = config.limits.clearance_sigmas or _SIGMAS
    off = sigmas * accuracy.position
    pushed = base_reach(loop, config.surroundings.disturbance)
    # The sphere that follows the target has no room to spare: it is hardly made smaller.
    grows = config.limits.clearance_sigmas > 0.0 and not inside
    needed = pushed + reach + (0.0 if grows else off)
    more = 1e3 * (needed - room)
    remedy = (
        f"lambda >= {needed * tuning.slope:.3f} m/s and a radius {more:.0f} mm larger"
        if inside
        else f"a clearance {math.ceil(more):.0f} mm larger"
    )
    place = "for which clearances grow" if grows else "for which the zone does not shrink"
    return _finding(
        "estimate",
        room - needed,
        f"estimate from {accuracy.source}, {sigmas:g} sigma: a place off by "
        f"{1e3 * off:.0f} mm, {place}; a velocity off by "
        f"{1e3 * sigmas * accuracy.velocity:.0f} mm/s and a tilt off by "
        f"{1e3 * sigmas * accuracy.tilt:.1f} mrad, which move the base by "
        f"{1e3 * reach:.0f} mm at most; with the tube {1e3 * needed:.0f} mm of the "
        f"{1e3 * room:.0f} mm that the plan keeps",
        f"{remedy} is enough",
        refuses=False,
    )


def sampled_robustness(tuning: BarrierTuning, disturbance: float, period: float) -> float:
    """Least lambda [m/s] that rejects a constant ``disturbance`` [m/s^2] along the normal.

    In sampled data, with the planner's ``period`` [s].
    """
    return disturbance * (1.0 + 0.5 * tuning.slope * period) / tuning.gamma


def _actuation(config: FlightConfig, tuning: BarrierTuning, radius: float) -> Finding:
    surroundings = config.surroundings
    available = GRAVITY * math.tan(config.planner.limits.tilt)
    wanted = tuning.alpha + tuning.gamma * tuning.lambda_ + surroundings.target_acceleration
    parts = "alpha + gamma lambda + |a_t|"
    if radius < math.inf:
        wanted += surroundings.tangential_speed**2 / radius
        parts += " + w^2/r"
    best = tuning.alpha - (wanted - available)
    remedy = (
        f"alpha <= {best:.2f} m/s^2 is enough"
        if best > 0.0
        else f"lambda <= {(available - wanted) / tuning.gamma + tuning.lambda_:.2f} m/s is enough"
    )
    return _finding(
        "actuation",
        available - wanted,
        f"braking needs {parts} = {wanted:.2f} m/s^2 and the tilt gives {available:.2f}",
        remedy,
    )


def _room_in_sphere(tuning: BarrierTuning, radius: float) -> Finding:
    at_centre = tuning.approach_speed(radius)
    return _finding(
        "sphere",
        at_centre - tuning.lambda_,
        f"h2a and h2b at the centre are S(r) = {at_centre:.3f} m/s and lambda is "
        f"{tuning.lambda_:.3f}",
        f"lambda <= {at_centre:.3f} m/s or r >= {stand_off(tuning):.3f} m is enough",
    )


def _wind_in_sphere(tuning: BarrierTuning, loop: Tube, radius: float) -> Finding:
    """A sphere without room to spare cannot become smaller in wind."""
    needed, spare = stand_off(tuning) + loop.wind_beyond, radius - stand_off(tuning)
    return _finding(
        "wind",
        radius - needed,
        f"wind that is cancelled can push the base {loop.wind_beyond * 1e3:.0f} mm further off "
        f"its plan when it turns, and the sphere has {spare * 1e3:.0f} mm to spare",
        f"r >= {needed:.3f} m is enough",
        refuses=False,
    )


def _links(config: FlightConfig, zones: list[Zone]) -> list[Finding]:
    """Both ends of a link keep off a point; the nearest place of the link is between them."""
    clearance = min([zone.clearance for zone in zones if is_point(zone)], default=math.inf)
    if clearance == math.inf or config.planner.body != "points":
        return []
    bodies = config.airframe.bodies
    links = [bodies.offset[3 * k : 3 * k + 3] for k in range(1, bodies.joints)]
    longest = max(math.hypot(*link) for link in (*links, bodies.tip))
    left = math.sqrt(max(clearance**2 - 0.25 * longest**2, 0.0))
    found = _finding(
        "links",
        left if left > 0.0 else -1.0,
        f"with both ends of a link {clearance * 1e3:.0f} mm from a point, the middle of the "
        f"longest, {longest * 1e3:.0f} mm, keeps {left * 1e3:.0f} mm",
        f"a clearance above {0.5 * longest * 1e3:.0f} mm is enough",
        refuses=False,
    )
    return [found]


def _base_tube(tuning: BarrierTuning, loop: Tube, disturbance: float) -> Finding:
    reach, room = base_reach(loop, disturbance), stand_off(tuning)
    return _finding(
        "tube",
        room - reach,
        f"no disturbance within {disturbance:g} m/s^2 on one axis pushes the base "
        f"further than {reach * 1e3:.0f} mm off its plan, which keeps {room * 1e3:.0f} mm from "
        f"the boundary: margin {(room - reach) * 1e3:+.0f} mm",
        f"lambda >= {reach * tuning.slope:.3f} m/s is enough",
    )


def _returns(config: FlightConfig, loop: Tube) -> list[Finding]:
    """Whether lambda is back before a sudden disturbance has used up what is kept meanwhile."""
    least, tuning = config.planner.lambda_min, config.planner.walls
    if not tuning.following(0.0, least) < tuning.lambda_:
        return []
    room, low, high = return_room(config, loop, least), least, tuning.lambda_
    while not room >= 0.0 and high - low > 1e-3:
        middle = 0.5 * (low + high)
        enough = return_room(config, loop, middle) >= 0.0
        low, high = (low, middle) if enough else (middle, high)
    kept = stand_off(replace(tuning, lambda_=least))
    return [
        _finding(
            "return of lambda",
            room,
            f"after little disturbance the plan keeps {kept * 1e3:.0f} mm, and when "
            f"{config.surroundings.disturbance:g} m/s^2 begin on one axis lambda is back with "
            f"{room * 1e3:+.0f} mm left",
            f"SAFE_LAMBDA_MIN >= {math.ceil(1e3 * high) / 1e3:.3f} m/s is enough, and 0 keeps "
            "lambda whole",
        )
    ]


def return_room(config: FlightConfig, loop: Tube, least: float) -> float:
    """Least distance [m] of the base to a wall after a disturbance that begins in still air.

    Lambda follows the disturbance down to ``least`` [m/s]. The worst of all instants, and of all
    that may have been observed before, which has the base as far off its plan as the tube says.
    What begins is seen, asked about and planned for, and rows of the first nodes hold nothing; then
    h rises as eq 25 has it, and the distance follows h.
    """
    dt, planner, tuning = config.tick, config.planner, config.planner.walls
    after = base_after(config.airframe, config.tuning.tracking, dt)
    wind = loop.base_wind - loop.wind_beyond
    begins = _SEEN_S + planner.period + config.plan_delay_ticks * dt
    times = dt * np.arange(1, len(after) + 1)
    periods = np.floor((times - begins) / planner.period)
    periods[periods <= tuning.skipped_nodes] = 0.0
    missing = (1.0 - tuning.gamma * planner.period) ** periods
    faded = np.exp(-tuning.slope * times)
    rest = []
    for seen in np.linspace(0.0, LOUD, 5):
        kept = tuning.following(float(seen), least)
        h = tuning.lambda_ - (tuning.lambda_ - kept) * missing
        # d' = h - k_S d from rest; k_S is the most that S rises by with d.
        distance = stand_off(replace(tuning, lambda_=kept))
        gained = faded * np.cumsum((h - kept) * dt / faded)
        pushed = config.surroundings.disturbance * after + seen * (after[-1] - after) + wind
        rest.append(float((distance + gained - pushed).min()))
    return min(rest)


def _tube_of_all_axes(
    config: FlightConfig, tuning: BarrierTuning, loop: Tube, safe_set: SafeSet
) -> Finding:
    """A wall meets one axis of it, if it stands along one; a sphere meets all of them together.

    Above what saturates the rotors there is no bound.
    """
    expected, room = config.surroundings.disturbance, stand_off(tuning)
    most = all_axes_up_to(config.airframe, loop, expected)
    whole = most > 0.99 * expected
    across, up = all_axes(config.airframe, loop, most)
    across -= loop.wind_beyond
    reach = _reach(safe_set, across, up)
    return _finding(
        "tube of all axes",
        room - reach if whole else most - expected,
        f"pushed within {most:.2f} m/s^2 on all axes at once the base can be {across * 1e3:.0f} mm "
        f"off its plan on a horizontal axis and {up * 1e3:.0f} mm vertically, {reach * 1e3:.0f} mm "
        f"towards the boundary, and the plan keeps {room * 1e3:.0f} mm",
        f"above {most:.2f} m/s^2 on all axes the rotors can saturate, and nothing is bounded"
        if not whole
        else f"lambda >= {reach * tuning.slope:.3f} m/s would be proof",
        refuses=False,
    )


def _reach(safe_set: SafeSet, across: float, up: float) -> float:
    """How far towards a boundary ``across`` [m] on x and on y and ``up`` [m] can lead [m]."""
    corner = math.hypot(across, across, up)
    flat = [zone.shape.numbers for zone in safe_set.zones if kind_of(zone.shape).flat]
    if len(flat) < len(safe_set.zones):
        return corner
    return max(across * (abs(n[0]) + abs(n[1])) + up * abs(n[2]) for n in flat)


def _tubes_of_parts(config: FlightConfig, loop: Tube, zones: list[Zone]) -> list[Finding]:
    found = [_end_effector_tube(config, loop)]
    return [*found, _part_tube(config, zones)] if config.planner.body == "full" else found


def _end_effector_tube(config: FlightConfig, loop: Tube) -> Finding:
    """Across the arm's plane the arm cannot compensate; along it, it does until it gives way."""
    tuning, surroundings = config.planner.walls, config.surroundings
    reach = loop.end_effector * surroundings.disturbance + loop.end_effector_wind
    expected = loop.end_effector_expected * surroundings.disturbance
    room, compensation = stand_off(tuning), config.tuning.compensation
    along = (
        f", and along it once the base is {compensation.far * 1e3:.0f} mm off its plan"
        if config.tuning.compensate
        else " and along it"
    )
    return _finding(
        "end-effector tube",
        room - reach,
        f"an end-effector that hangs {surroundings.hanging * 1e3:.0f} mm below the base can be "
        f"pushed {reach * 1e3:.0f} mm across the arm's plane{along}, by the worst disturbance "
        f"({expected * 1e3:.0f} mm expected at random), and the plan keeps {room * 1e3:.0f} mm",
        _proof(config, reach),
        refuses=False,
    )


def part_tube(config: FlightConfig) -> tuple[PartReach, ...]:
    """Reach of the parts of the base with the configured tracking loop."""
    loop = LoopOfParts(
        airframe=config.airframe,
        tuning=config.tuning.tracking,
        disturbance=config.surroundings.disturbance,
        hold_s=config.surroundings.disturbance_hold,
        dt=config.tick,
    )
    return part_reaches(loop, config.body)


def _part_tube(config: FlightConfig, zones: list[Zone]) -> Finding:
    """The base tilts to push back, and moves feet and rotors with it."""
    reaches = part_tube(config)
    far: list[PartReach] = []
    for zone in zones:
        n = zone.shape.numbers
        far += [towards(reaches, (n[0], n[1], n[2]))] if kind_of(zone.shape).flat else reaches
    most, room = max(far, key=lambda reach: reach.worst), stand_off(config.planner.walls)
    return _finding(
        "part tube",
        room - most.worst,
        f"the worst disturbance on one axis and the tilt against it can move the {most.name} "
        f"{most.worst * 1e3:.0f} mm towards a boundary ({most.expected * 1e3:.0f} mm expected at "
        f"random), and the plan keeps {room * 1e3:.0f} mm",
        _proof(config, most.worst),
        refuses=False,
    )


def _proof(config: FlightConfig, reach: float) -> str:
    """What keeps ``reach`` [m] from a wall: lambda, and alpha where the tilt would not do then."""
    tuning, limits = config.planner.walls, config.planner.limits
    least = math.ceil(1e3 * reach * tuning.slope) / 1e3
    target = config.surroundings.target_acceleration
    left = GRAVITY * math.tan(limits.tilt) - tuning.gamma * least - target
    if left >= tuning.alpha:
        return f"lambda >= {least:.3f} m/s would be proof"
    if left > 0.0:
        min_alpha = math.floor(1e2 * left) / 1e2
        return f"lambda >= {least:.3f} m/s with alpha <= {min_alpha:.2f} m/s^2 would be proof"
    return "no lambda that the tilt can keep would be proof"


def _limits(config: FlightConfig, loop: Tube) -> Finding:
    """The tube is that of the linear loop: it holds while no limit is reached."""
    disturbance = config.surroundings.disturbance
    used = limits_used(config.airframe, config.tuning.tracking, loop, disturbance)
    worst = max(used, key=lambda name: used[name])
    return _finding(
        "limits",
        1.0 - used[worst],
        f"the tube holds while no limit is reached: the worst disturbance of {disturbance:g} "
        f"m/s^2 on one axis uses {used[worst]:.0%} of the {worst}",
        f"up to {disturbance / used[worst]:.2f} m/s^2 none is",
        refuses=used[worst] > _SATURATED,
    )


def _turned(config: FlightConfig) -> Finding:
    """What turns the base beside its rotors, which the tube does not know.

    Drives rub against the base, and where the centre of mass is elsewhere a push turns it. The
    loop holds a constant angular acceleration a off its plan by g a / k, with its gain k on place.
    """
    airframe, disturbance = config.airframe, config.surroundings.disturbance
    stiffness = tracking_gains(config.tuning.tracking, airframe.rotor_lag, config.tick).k[0]
    pushed, rubbed = disturbance * swing(airframe), _turned_by_friction(airframe)
    off = GRAVITY * (pushed + rubbed) / stiffness
    return _finding(
        "turned",
        _TURNED - off,
        f"friction of its joints turns the base by {rubbed:.1f} rad/s^2, and a push of "
        f"{disturbance:g} m/s^2 by {pushed:.1f}: that holds it {1e3 * off:.0f} mm off "
        f"its plan, of {1e3 * _TURNED:.0f} mm",
        "a base of more inertia, joints with less friction, or a lighter arm are enough",
    )


def _turned_by_friction(airframe: Airframe) -> float:
    """Angular acceleration [rad/s^2] of roll or pitch by all drives that rub at once."""
    m = posture(airframe.bodies, airframe.home_posture)
    joints = airframe.bodies.joints
    reaction = np.abs(np.array(m.reaction[: 3 * joints]).reshape(joints, 3)).T
    torque = reaction @ np.array(airframe.joint_friction[:joints])
    return float(np.max(torque[:2] / np.array(m.inertia).reshape(3, 3).diagonal()[:2]))


def _px4_loops(config: FlightConfig, loop: Tube, others: list[Zone]) -> list[Finding]:
    """Whether PX4's loops are of any use, and what they leave of an end-effector beside walls."""
    px4, holds = config.px4, is_stable(config.px4)
    settles = _finding(
        "PX4's loops",
        0.0 if holds else -1.0,
        f"PX4's loops {'settle' if holds else 'do not settle'} as they are believed to be: "
        f"PX4_XY_P {px4.position_gain:g}, PX4_XY_V_P {px4.velocity_gain:g}, "
        f"PX4_TILT_KP {px4.tilt_kp:g}, PX4_TILT_KD {px4.tilt_kd:g}, a delay of "
        f"{1e3 * px4.delay:.0f} ms and {px4.cancelled:.0%} of the disturbance cancelled",
        "identify them anew, or cancel less by PX4_CANCEL",
    )
    return [settles, _end_effector_tube(config, loop)] if holds and others else [settles]


def _sampled(tuning: BarrierTuning, disturbance: float, period: float) -> Finding:
    least = sampled_robustness(tuning, disturbance, period)
    margin = (tuning.lambda_ - least) / tuning.slope
    return _finding(
        "sampled",
        tuning.lambda_ - least,
        f"rejecting {disturbance:g} m/s^2 by planning alone needs lambda >= "
        f"d (1 + k_S T/2) / gamma = {least:.3f} m/s and lambda is {tuning.lambda_:.3f}: margin "
        f"{margin * 1e3:+.0f} mm",
        f"lambda = {least:.3f} m/s is enough",
        refuses=False,
    )


def _finding(
    name: str, left: float, statement: str, remedy: str, *, refuses: bool = True
) -> Finding:
    found = Finding(name, left, statement, refuses)
    return found if found.holds else replace(found, statement=f"{statement}; {remedy}")
