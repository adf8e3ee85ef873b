"""The vehicle and the first state of a flight."""

from __future__ import annotations

import math
from dataclasses import replace

from sitl.air.load import SURFACES
from sitl.mission_clock import MissionClock
from sitl.plant.parameters import AirModel, Effects
from sitl.plant.state import P_WB, Q_WB, THRUST, V_WB, W_WB_B, at_rest
from sitl.plant.trim import NoTrimError, Trim, end_effector, level_hover, standing_height
from sitl.plant.vector import Array
from sitl.scenario import V3, Scenario, Start, start_angles, vehicle_of
from sitl.scenario_file import ScenarioError
from sitl.touch import surface_effects
from vehicles.description import V6, Vehicle


def flown_vehicle(scenario: Scenario) -> Vehicle:
    """The scenario's vehicle, scaled as it says."""
    vehicle, scale = vehicle_of(scenario), scenario.vehicle_scale

    def inertia(of: V6) -> V6:
        xx, yy, zz, xy, xz, yz = (scale.inertia * one for one in of)
        return (xx, yy, zz, xy, xz, yz)

    base = vehicle.base
    return replace(
        vehicle,
        base=replace(base, mass=scale.mass * base.mass, inertia=inertia(base.inertia)),
        rotors=tuple(replace(one, lag=scale.rotor_lag * one.lag) for one in vehicle.rotors),
        joints=tuple(
            replace(
                one,
                viscous=scale.joint_friction * one.viscous,
                coulomb=scale.joint_friction * one.coulomb,
                link=replace(
                    one.link,
                    mass=scale.mass * one.link.mass,
                    inertia=inertia(one.link.inertia),
                ),
            )
            for one in vehicle.joints
        ),
    )


def effects(scenario: Scenario) -> Effects:
    """What the vehicle meets in a scenario beside what its file says.

    Raises:
        TooStiffError: What the tool may touch is too stiff for the plant.
    """
    actuators = scenario.actuators
    return Effects(
        **surface_effects(scenario, flown_vehicle(scenario), actuators.motor_inertia_kg_m2),
        air=air_model(scenario),
        motor_inertia=actuators.motor_inertia_kg_m2,
        backlash=math.radians(actuators.backlash_deg),
        quadratic_thrust=actuators.quadratic_thrust,
    )


def air_model(scenario: Scenario) -> AirModel:
    """What the scenario's air does, with the ground and every plane that stands still.

    Raises:
        ScenarioError: More planes than the kernels have room for.
    """
    keys = scenario.air
    planes: list[tuple[V3, float]] = [((0.0, 0.0, -1.0), 0.0)]
    planes += [(wall.normal, wall.offset_m) for wall in scenario.walls]
    near = keys.ground_effect or keys.ceiling_effect or keys.wall_suction > 0.0
    if near and len(planes) > SURFACES:
        raise ScenarioError(
            f"air: {len(planes) - 1} walls are near the rotors, must be at most {SURFACES - 1}"
        )
    return AirModel(
        rotor_drag=keys.rotor_drag_1_s,
        drag_area=keys.body_drag_m2,
        ground=keys.ground_effect,
        ceiling=keys.ceiling_effect,
        suction=keys.wall_suction,
        surfaces=tuple(planes) if near else (),
    )


def on_the_ground(scenario: Scenario) -> Scenario:
    """The same scenario with the vehicle standing under the place where it would begin to fly.

    For an autopilot that takes off itself: no pilot asks it for anything.
    """
    pilot, start = replace(scenario.pilot, plan="none"), scenario.start
    if start.kind == "airborne":
        place, _ = hovering(
            flown_vehicle(scenario), scenario, MissionClock(scenario).target_at(0.0).p
        )
        x, y = (float(one) for one in place[P_WB : P_WB + 2])
        start = Start(kind="ground", yaw_deg=start.yaw_deg, position_m=(x, y))
    return replace(scenario, pilot=pilot, start=start)


def first_state(vehicle: Vehicle, scenario: Scenario, p_target: V3) -> tuple[Array, Trim]:
    """State vector and actuator values at t = 0; ``p_target`` [m, NED] is the first reference.

    Raises:
        ScenarioError: No equilibrium within the actuators' limits.
    """
    if scenario.start.kind == "ground":
        return standing(vehicle, scenario)
    return hovering(vehicle, scenario, p_target)


def hovering(vehicle: Vehicle, scenario: Scenario, p_target: V3) -> tuple[Array, Trim]:
    """At rest in the air with the end-effector at ``p_target`` [m, NED], actuators trimmed.

    Raises:
        ScenarioError: No equilibrium within the actuators' limits.
    """
    angles = start_angles(scenario)
    yaw = math.radians(scenario.start.yaw_deg)
    x, y, z = end_effector(vehicle, angles)
    c, s = math.cos(yaw), math.sin(yaw)
    try:
        trim = level_hover(vehicle, angles)
    except NoTrimError as error:
        # Where the scenario does not say it, the vehicle's posture is what can be changed.
        asked = scenario.start.arm_deg
        key, unit = ("start.arm_deg", math.radians(1.0)) if asked else ("home_posture", 1.0)
        shown = [round(angle / unit, 6) for angle in angles]
        raise ScenarioError(f"{key} = {shown}: {error}") from error
    place = (p_target[0] - c * x + s * y, p_target[1] - s * x - c * y, p_target[2] - z)
    return _level(vehicle, place, yaw, trim, angles), trim


def standing(vehicle: Vehicle, scenario: Scenario) -> tuple[Array, Trim]:
    """On its feet, disarmed: rotors and drives off, the arm in its posture of rest."""
    x, y = scenario.start.position_m
    place = (x, y, -standing_height(vehicle))
    off = Trim((0.0,) * len(vehicle.rotors), (0.0,) * len(vehicle.joints))
    yaw = math.radians(scenario.start.yaw_deg)
    return _level(vehicle, place, yaw, off, vehicle.rest_posture), off


def _level(vehicle: Vehicle, place: V3, yaw: float, trim: Trim, angles: tuple[float, ...]) -> Array:
    """State at rest at a place [m, NED] with a ``yaw`` [rad], trimmed, its joints at ``angles``."""
    rotors, joints = len(vehicle.rotors), len(vehicle.joints)
    state, arm = at_rest(rotors, joints), THRUST + rotors
    state[P_WB:V_WB] = place
    state[Q_WB:W_WB_B] = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
    state[THRUST:arm] = trim.thrust
    state[arm : arm + joints] = angles
    return state
