"""The first state of a flight."""

from __future__ import annotations

import math

import numpy as np

from sitl.plant.parameters import Vehicle, level_reach
from sitl.plant.state import StateView, at_rest
from sitl.plant.trim import NoTrimError, Trim, level_hover, standing_height
from sitl.plant.vector import Array
from sitl.scenario import V3, Scenario
from sitl.scenario_file import ScenarioError


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
    view = StateView(state)
    view.p_WB[:] = (p_target[0] - c * x + s * y, p_target[1] - s * x - c * y, p_target[2] - z)
    view.q_WB[:] = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
    view.q_arm[:] = angles
    view.thrust[:] = trim.thrust
    return state, trim


def standing(vehicle: Vehicle, scenario: Scenario) -> tuple[Array, Trim]:
    """On its legs, disarmed: rotors off, arm limp and therefore straight down."""
    joints = len(vehicle.links)
    yaw = math.radians(scenario.start.yaw_deg)
    x, y = scenario.start.position_m
    state = at_rest(joints)
    view = StateView(state)
    view.p_WB[:] = (x, y, -standing_height(vehicle))
    view.q_WB[:] = (math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw))
    view.q_arm[:] = [-link.theta_offset for link in vehicle.links]
    return state, Trim((0.0, 0.0, 0.0, 0.0), tuple(float(t) for t in np.zeros(joints)))
