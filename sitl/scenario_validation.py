"""Checks that involve several keys of a scenario."""

from __future__ import annotations

import itertools
import math

from sitl.faults.keys import EXACT, Fault, problem
from sitl.plant.state import SURFACES_MAX
from sitl.ranges import normal_problem
from sitl.scenario import (
    ActuatorKeys,
    Circle,
    Lissajous,
    Payload,
    Pilot,
    Points,
    Polynomial,
    Push,
    Scenario,
    ScenarioZone,
    Start,
    Trajectory,
    start_angles,
    vehicle_of,
)
from sitl.scenario_file import ScenarioError, checked_vehicle
from sitl.sensors.keys import MeasuredSensors
from vehicles.vehicle_file import posture_problem

MAX_POINTS = 20_000  # of a trajectory
MAX_PLACES = 50  # that one presses on
_OFF_SURFACE_M = 0.001
_ROUNDING = 1e-12  # kg·m²
_MIN_APART_S = 0.002  # two points of a trajectory
_MAX_POWERS = 12  # coefficients of a polynomial
ZONES_MAX = 64  # in a set of OBSTACLE_SHAPE
_MIN_INERTIA = 1e-4  # kg·m²; a lighter motor crosses its gap within a step of the plant


def check(scenario: Scenario) -> None:
    """Refuse a scenario whose parts contradict each other.

    Raises:
        ScenarioError: With the key, the value and what is allowed.
    """
    _check_vehicle(scenario)
    _check_start(scenario.start)
    _check_walls(scenario)
    _check_zones(scenario)
    _check_names(scenario)
    _check_gears(scenario.actuators)
    _check_payload(scenario.payload)
    _check_grip(scenario.pilot)
    _check_faults(scenario)
    check_trajectory(scenario.trajectory)
    hop, ground = scenario.pilot.plan == "hop", scenario.start.kind == "ground"
    if hop != ground and scenario.pilot.plan != "none":
        raise ScenarioError(
            f'pilot.plan = "{scenario.pilot.plan}": start.kind = "{scenario.start.kind}" needs '
            f'"{"hop" if ground else "trajectory"}" or "none"'
        )


def check_trajectory(curve: Trajectory) -> None:
    """Refuse a reference whose numbers contradict each other.

    Raises:
        ScenarioError: With the key, the value and what is allowed.
    """
    if isinstance(curve, Lissajous | Circle) and not (2.0 * curve.ramp_s <= curve.duration_s):
        raise ScenarioError(
            f"trajectory.ramp_s = {curve.ramp_s:g}: must be at most half of "
            f"trajectory.duration_s = {curve.duration_s:g}"
        )
    if isinstance(curve, Polynomial):
        for name in ("north", "east", "down"):
            if not 0 < len(getattr(curve, name)) <= _MAX_POWERS:
                raise ScenarioError(
                    f"trajectory.{name}: must have 1 to {_MAX_POWERS} coefficients, has "
                    f"{len(getattr(curve, name))}"
                )
    if isinstance(curve, Points):
        _check_points(curve)
    if isinstance(curve, Push):
        _check_push(curve)


def _check_push(curve: Push) -> None:
    count = len(curve.position_m)
    if not 1 <= count <= MAX_PLACES:
        raise ScenarioError(f"trajectory.position_m: must have 1 to {MAX_PLACES}, has {count}")
    for name in ("force_n", "hold_s", "slide_m"):
        given = len(getattr(curve, name))
        if given != count and not (name == "slide_m" and given == 0):
            raise ScenarioError(f"trajectory.{name}: {given} entries for {count} places")
    if (wrong := normal_problem(curve.normal)) is not None:
        raise ScenarioError(f"trajectory.{wrong}")
    for k, slide in enumerate(curve.slide_m):
        off = sum(n * d for n, d in zip(curve.normal, slide, strict=True))
        if not abs(off) <= _OFF_SURFACE_M:
            raise ScenarioError(
                f"trajectory.slide_m[{k}] = {list(slide)}: must be along the surface, is "
                f"{1000.0 * off:.1f} mm along the normal"
            )


def _check_points(curve: Points) -> None:
    count = len(curve.time_s)
    if not 2 <= count <= MAX_POINTS:
        raise ScenarioError(f"trajectory.time_s: must have 2 to {MAX_POINTS} times, has {count}")
    for name in ("position_m", "yaw_deg"):
        given = len(getattr(curve, name))
        if given != count and not (name == "yaw_deg" and given == 0):
            raise ScenarioError(f"trajectory.{name}: {given} entries for {count} times")
    for k, (time_s, next_s) in enumerate(itertools.pairwise(curve.time_s), start=1):
        if not next_s - time_s >= _MIN_APART_S:
            raise ScenarioError(
                f"trajectory.time_s[{k}] = {next_s:g}: must be at least {_MIN_APART_S:g} s after "
                f"{time_s:g}, the one before"
            )


def _check_vehicle(scenario: Scenario) -> None:
    problem = posture_problem(checked_vehicle(scenario), start_angles(scenario), math.radians(1.0))
    if problem is not None:
        raise ScenarioError(f"start.arm_deg{problem}")


def _check_start(start: Start) -> None:
    given = Start(kind=start.kind, yaw_deg=start.yaw_deg)
    if start.kind == "airborne" and start.position_m != given.position_m:
        raise ScenarioError(
            f"start.position_m = {list(start.position_m)}: only for a start on the ground, in the "
            "air the trajectory's first point decides"
        )
    if start.kind == "ground" and start.arm_deg:
        raise ScenarioError(
            f"start.arm_deg = {list(start.arm_deg)}: only for a start in the air, on the ground "
            "the arm is limp"
        )


def _check_gears(keys: ActuatorKeys) -> None:
    if keys.backlash_deg > 0.0 and not (keys.motor_inertia_kg_m2 >= _MIN_INERTIA):
        raise ScenarioError(
            f"actuators.backlash_deg = {keys.backlash_deg:g}: needs the inertia of a motor that "
            f"crosses the gap, actuators.motor_inertia_kg_m2 of at least {_MIN_INERTIA:g}"
        )


def _check_grip(keys: Pilot) -> None:
    grab_s, release_s = keys.grab_s, keys.release_s
    if math.isfinite(release_s) and not release_s > grab_s:
        raise ScenarioError(
            f"pilot.release_s = {release_s:g}: must be later than grab_s, {grab_s:g}"
        )


def _check_payload(keys: Payload | None) -> None:
    if keys is None:
        return
    if not keys.attach_at_s < keys.release_at_s:
        raise ScenarioError(
            f"payload.release_at_s = {keys.release_at_s:g}: must be after attach_at_s = "
            f"{keys.attach_at_s:g}"
        )
    if keys.gripper and (keys.attach_at_s > 0.0 or keys.release_at_s < math.inf):
        raise ScenarioError("payload.gripper: in place of attach_at_s and release_at_s")
    a, b, c = sorted(keys.inertia_kg_m2)
    if not c <= a + b + _ROUNDING:
        raise ScenarioError(
            f"payload.inertia_kg_m2 = {list(keys.inertia_kg_m2)}: none of a rigid body is more "
            "than the other two together"
        )


def _check_walls(scenario: Scenario) -> None:
    for i, wall in enumerate(scenario.walls):
        if (wrong := normal_problem(wall.normal)) is not None:
            raise ScenarioError(f"walls[{i}].{wrong}")


def _check_zones(scenario: Scenario) -> None:
    for i, zone in enumerate(scenario.zones):
        problem = zone.problem() or _touch_problem(zone)
        if problem is not None:
            raise ScenarioError(f"zones[{i}].{problem}")
        times = [point.time_s for point in zone.way_points]
        if zone.way_points and any(zone.velocity_m_s):
            raise ScenarioError(
                f"zones[{i}].velocity_m_s: cannot be given together with way_points"
            )
        for k, (time_s, next_s) in enumerate(itertools.pairwise(times), start=1):
            if not next_s > time_s:
                raise ScenarioError(
                    f"zones[{i}].way_points[{k}].time_s = {next_s:g}: must be after {time_s:g}, "
                    "the one before"
                )
    touched = sum(zone.touch is not None for zone in scenario.zones)
    if touched > SURFACES_MAX:
        raise ScenarioError(f"zones: {touched} have touch, must be at most {SURFACES_MAX}")
    count = len(scenario.walls) + len(scenario.obstacles) + len(scenario.zones)
    count += scenario.workspace is not None
    if count > ZONES_MAX:
        raise ScenarioError(
            f"walls, obstacles, zones and workspace are {count}: must be at most {ZONES_MAX}"
        )


def _touch_problem(zone: ScenarioZone) -> str | None:
    """Key, value and what is allowed, where a zone cannot be touched as it says."""
    touch = zone.touch
    if touch is None:
        return None
    if zone.keep_in:
        return "touch: only of a zone to stay out of, without keep_in"
    low, high = touch.stiffness_range_n_m
    if not low <= high:
        return f"touch.stiffness_range_n_m = [{low:g}, {high:g}]: must be the least, then the most"
    return None


def _check_names(scenario: Scenario) -> None:
    walls = [wall.name for wall in scenario.walls]
    obstacles = [one.name for one in scenario.obstacles]
    taken = [*walls, *obstacles, *(["workspace"] if scenario.workspace is not None else [])]
    for key, others, names in (
        ("walls", [], walls),
        ("obstacles", walls, obstacles),
        ("zones", taken, [zone.name for zone in scenario.zones]),
        ("disturbances", [], [item.name for item in scenario.disturbances]),
    ):
        for i, name in enumerate(names):
            if not name or len(name) > 24 or "/" in name or not name.isprintable():
                raise ScenarioError(
                    f'{key}[{i}].name = {name!r}: must be 1 to 24 printable characters without "/"'
                )
            if name in (*others, *names[:i]):
                raise ScenarioError(f'{key}[{i}].name = "{name}": must differ from the others')


def _check_faults(scenario: Scenario) -> None:
    for i, fault in enumerate(scenario.faults):
        found = fault_problem(fault, scenario)
        if found is not None:
            raise ScenarioError(f"faults[{i}].{found}")


def fault_problem(fault: Fault, scenario: Scenario) -> str | None:
    """Why a fault cannot be flown in a scenario; None if it can."""
    exact = not isinstance(scenario.sensors, MeasuredSensors)
    return problem(fault, units_aboard(scenario), vehicle_of(scenario), exact=exact)


def units_aboard(scenario: Scenario) -> tuple[str, ...]:
    """Sensors of a scenario that can fail; cameras of either kind are ``vio``."""
    sensors = scenario.sensors
    return sensors.units if isinstance(sensors, MeasuredSensors) else EXACT


def check_start(keys: tuple[str, ...], margins: tuple[float, ...]) -> None:
    """Refuse a start outside the safe set.

    Raises:
        ScenarioError: With the constraint and its margin at t = 0.
    """
    for key, margin in zip(keys, margins, strict=True):
        if not (margin > 0.0):
            raise ScenarioError(
                f"the scenario starts outside its safe set: margin {key} = "
                f"{1000.0 * margin:.1f} mm at t = 0, must be above 0: move what is near, or begin "
                "in another posture (start.arm_deg, or home_posture of the vehicle)"
            )
