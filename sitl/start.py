"""The vehicle and the first state of a flight."""

from __future__ import annotations

import math
from dataclasses import replace

from sitl.air.load import SURFACES
from sitl.mission_clock import MissionClock
from sitl.plant.parameters import AirModel, Motors, Vehicle, level_reach
from sitl.plant.state import ARM, P_WB, Q_WB, THRUST, V_WB, W_WB_B, at_rest
from sitl.plant.trim import NoTrimError, Trim, level_hover, standing_height
from sitl.plant.vector import Array
from sitl.scenario import V3, Scenario, Start
from sitl.scenario_file import ScenarioError


def flown_vehicle(scenario: Scenario) -> Vehicle:
    """The default vehicle, scaled as the scenario says."""
    scale = scenario.vehicle_scale
    vehicle = Vehicle().scaled(scale.mass, scale.inertia)
    rotors, joints = vehicle.rotors, vehicle.joints
    return replace(
        vehicle,
        rotors=replace(
            rotors,
            lag=scale.rotor_lag * rotors.lag,
            quadratic=scenario.actuators.quadratic_thrust,
        ),
        joints=replace(
            joints,
            viscous=scale.joint_friction * joints.viscous,
            coulomb=scale.joint_friction * joints.coulomb,
        ),
        motors=Motors(
            inertia=scenario.actuators.motor_inertia_kg_m2,
            backlash=math.radians(scenario.actuators.backlash_deg),
        ),
        air=air_model(scenario),
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
    angles = tuple(math.radians(angle) for angle in scenario.start.arm_deg)
    yaw = math.radians(scenario.start.yaw_deg)
    x, y, z = level_reach(vehicle, angles)
    c, s = math.cos(yaw), math.sin(yaw)
    try:
        trim = level_hover(vehicle, angles)
    except NoTrimError as error:
        raise ScenarioError(f"start.arm_deg = {list(scenario.start.arm_deg)}: {error}") from error
    state = at_rest(len(angles))
    place = (p_target[0] - c * x + s * y, p_target[1] - s * x - c * y, p_target[2] - z)
    state[P_WB:V_WB] = place
    state[Q_WB:W_WB_B] = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
    state[ARM : ARM + len(angles)] = angles
    state[THRUST:ARM] = trim.thrust
    return state, trim


def standing(vehicle: Vehicle, scenario: Scenario) -> tuple[Array, Trim]:
    """On its legs, disarmed: rotors off, arm limp and therefore straight down."""
    joints = len(vehicle.links)
    yaw = math.radians(scenario.start.yaw_deg)
    x, y = scenario.start.position_m
    state = at_rest(joints)
    state[P_WB:V_WB] = (x, y, -standing_height(vehicle))
    state[Q_WB:W_WB_B] = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
    state[ARM : ARM + joints] = [-link.theta_offset for link in vehicle.links]
    return state, Trim((0.0, 0.0, 0.0, 0.0), (0.0,) * joints)
