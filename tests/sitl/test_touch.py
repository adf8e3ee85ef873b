"""A tool that strikes a surface: energy, impact time, and its motion beside MuJoCo's."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from sitl.plant.integrator import held, integrate
from sitl.plant.parameters import Effects, Surface, plant
from sitl.plant.places import rows_of
from sitl.plant.stiffness import STEPS_MAX, TooStiffError, steps_of_touch
from sitl.plant.tool import balls_of, tip_radius
from sitl.plant.vector import Array
from sitl.shapes import KINDS
from sitl.shapes.ball import KIND as BALL
from sitl.shapes.half_space import KIND as WALL
from tests.sitl.free_motion import tumbling
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from tests.sitl.state_view import StateView
from tests.sitl.test_against_mujoco import mjcf
from tests.sitl.test_conservation import weigh
from tests.sitl.vehicles import PAPER, frictionless, inputs, random_vehicle
from vehicles.description import BodyPart, Vehicle

N: Array = np.array([-0.6, 0.64, -0.48])  # out of the wall, NED
PLACE: Array = np.array([0.0, 0.0, -50.0])  # on it, m, NED, far above the ground
SPEED = 1.0  # m/s, with which the tip strikes it


def _with_tip(vehicle: Vehicle) -> Vehicle:
    last = vehicle.joints[-1].name
    tip = BodyPart(name="tip", on=last, position=vehicle.end_effector.position, radius=0.03)
    # Pinocchio's energy leaves out what turns behind a gear; other parts could be in the wall.
    joints = tuple(replace(one, armature=0.0) for one in vehicle.joints)
    return replace(vehicle, joints=joints, parts=(tip,))


SMOOTH = _with_tip(frictionless())
SPATIAL = _with_tip(frictionless(random_vehicle(6, 8, np.random.default_rng(6))))
ONE = _with_tip(frictionless(random_vehicle(1, 4, np.random.default_rng(1))))
ALL = pytest.mark.parametrize(
    "vehicle", [SMOOTH, SPATIAL, ONE], ids=["paper", "six joints", "one joint"]
)


class Struck(NamedTuple):
    """How a vehicle was after each step, and the surface's numbers at the end."""

    states: Array
    surfaces: Any
    depth: Array  # m, of the tip after each step, by Pinocchio


def _tool(vehicle: Vehicle, state: Array) -> tuple[Array, Array]:
    """Place [m, NED] and Jacobian (3, 6 + j) to its velocity [NED] of the end-effector."""
    model = pinocchio_model(vehicle, 0.0)
    data, view = model.createData(), StateView(state, len(vehicle.joints))
    pin.computeJointJacobians(model, data, configuration(view.p_WB, view.q_WB, view.q_arm))
    frame = model.getFrameId("tool")
    pin.updateFramePlacements(model, data)
    whole = pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
    return np.array(data.oMf[frame].translation), whole[:3]


def _velocity(vehicle: Vehicle, state: Array) -> Array:
    view = StateView(state, len(vehicle.joints))
    turned = pin.Quaternion(*view.q_WB).toRotationMatrix().T @ view.v_WB
    return np.concatenate([turned, view.w_WB_B, view.qd_arm])


def _before(vehicle: Vehicle) -> Array:
    """Tumbling towards the wall, the tip just in front of it."""
    state = tumbling(vehicle)
    view = StateView(state, len(vehicle.joints))
    place, jacobian = _tool(vehicle, state)
    view.p_WB[:] += PLACE + (tip_radius(vehicle) + 1e-6) * N - place
    view.v_WB[:] -= (N @ (jacobian @ _velocity(vehicle, state)) + SPEED) * N
    return state


def _wall(stiffness: float, dissipation: float, friction: float) -> Surface:
    return Surface(
        KINDS.index(WALL), (*N.tolist(), float(N @ PLACE)), stiffness, dissipation, friction
    )


def _strike(
    vehicle: Vehicle,
    surface: Surface,
    seconds: float,
    *,
    start: Array | None = None,
    step: float = 0.001,
    velocity: Array | None = None,
    finer: int = 8,
) -> Struck:
    effects = Effects(gravity=0.0, surfaces=(surface,), finer=finer)
    numbers: Any = plant(vehicle, effects)
    if velocity is not None:
        numbers.surfaces.velocity[0] = velocity
    state = _before(vehicle) if start is None else start.copy()
    places = np.empty((round(seconds / step), rows_of(vehicle), 3))
    states = np.empty((len(places), len(state)))
    integrate(numbers, state, inputs(), step, places, states, held())
    tips = places[:, 1 + len(vehicle.joints)]
    moved = 0.0 if velocity is None else N @ velocity * step * np.arange(1, len(tips) + 1)
    return Struck(states, numbers.surfaces, tip_radius(vehicle) - ((tips - PLACE) @ N - moved))


@ALL
def test_without_dissipation_and_friction_an_impact_keeps_the_energy(vehicle: Vehicle) -> None:
    surface = _wall(4000.0, 0.0, 0.0)
    struck = _strike(vehicle, surface, 0.3)
    assert struck.depth.max() > 1e-3
    before = weigh(vehicle, _before(vehicle), 0.0)[0]
    for state, depth in zip(struck.states[::10], struck.depth[::10], strict=True):
        stored = 0.5 * surface.stiffness * max(depth, 0.0) ** 2
        assert weigh(vehicle, state, 0.0)[0] + stored == pytest.approx(before, rel=1e-5)


@ALL
def test_an_impact_never_gains_energy(vehicle: Vehicle) -> None:
    surface = _wall(4000.0, 4.0, 0.5)
    struck = _strike(vehicle, surface, 0.3)
    assert struck.depth.max() > 1e-3
    stored = 0.5 * surface.stiffness * np.maximum(struck.depth, 0.0) ** 2
    energy = np.array([weigh(vehicle, state, 0.0)[0] for state in struck.states]) + stored
    before = weigh(vehicle, _before(vehicle), 0.0)[0]
    assert np.diff(energy, prepend=before).max() <= 1e-6 * before
    assert energy[-1] < 0.99 * before


@ALL
def test_a_stiff_impact_lasts_half_a_period_of_its_effective_mass(vehicle: Vehicle) -> None:
    stiffness, start = 40_000.0, _before(vehicle)
    jacobian = N @ _tool(vehicle, start)[1]
    model = pinocchio_model(vehicle, 0.0)
    data, view = model.createData(), StateView(start, len(vehicle.joints))
    mass = pin.crba(model, data, configuration(view.p_WB, view.q_WB, view.q_arm))
    effective = 1.0 / (jacobian @ np.linalg.solve(mass, jacobian))  # kg
    lasts = math.pi * math.sqrt(effective / stiffness)
    surfaces = _strike(vehicle, _wall(stiffness, 0.0, 0.0), 2.0 * lasts, start=start).surfaces
    assert surfaces.contacts[0] == 1.0
    assert surfaces.contact_s[0] == pytest.approx(lasts, rel=0.03)
    hardest = SPEED * math.sqrt(effective * stiffness)  # N
    assert surfaces.force_max[0] == pytest.approx(hardest, rel=0.02)


@ALL
def test_a_wall_that_comes_strikes_like_one_that_waits(vehicle: Vehicle) -> None:
    surface, start = _wall(4000.0, 4.0, 0.5), _before(vehicle)
    coming = np.array([-0.2, 0.1, 0.15])
    waiting = _strike(vehicle, surface, 0.1, start=start)
    slower = start.copy()
    StateView(slower, len(vehicle.joints)).v_WB[:] += coming
    met = _strike(vehicle, surface, 0.1, start=slower, velocity=coming)
    assert met.surfaces.force_max[0] == pytest.approx(waiting.surfaces.force_max[0], rel=1e-6)
    assert met.surfaces.path[0] == pytest.approx(waiting.surfaces.path[0], rel=1e-6)
    ours = StateView(met.states[-1], len(vehicle.joints))
    theirs = StateView(waiting.states[-1], len(vehicle.joints))
    np.testing.assert_allclose(ours.v_WB - coming, theirs.v_WB, atol=1e-6)
    np.testing.assert_allclose(ours.qd_arm, theirs.qd_arm, atol=1e-5)


@ALL
def test_the_motion_after_an_impact_is_that_of_mujoco(vehicle: Vehicle) -> None:
    surface, seconds = _wall(4000.0, 4.0, 0.5), 0.1
    struck = _strike(vehicle, surface, seconds)
    model = mujoco.MjModel.from_xml_string(mjcf(vehicle, 0.0))
    model.opt.timestep, model.opt.gravity[:] = 1e-5, 0.0
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    data, joints = mujoco.MjData(model), len(vehicle.joints)
    start = StateView(_before(vehicle), joints)
    data.qpos[:] = np.concatenate([start.p_WB, start.q_WB, start.q_arm])
    data.qvel[:] = np.concatenate([start.v_WB, start.w_WB_B, start.qd_arm])
    tip, last = np.array(vehicle.end_effector.position), model.nbody - 1
    linear, angular = np.empty((3, model.nv)), np.empty((3, model.nv))
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_forward(model, data)
        centre = data.xpos[last] + data.xmat[last].reshape(3, 3) @ tip
        depth = tip_radius(vehicle) - N @ (centre - PLACE)
        data.qfrc_applied[:] = 0.0
        if depth > 0.0:
            # Friction acts where the ball touches, not at its centre.
            mujoco.mj_jac(model, data, linear, angular, centre - (N @ (centre - PLACE)) * N, last)
            v = linear @ data.qvel
            normal = max(surface.stiffness * depth * (1.0 - surface.dissipation * N @ v), 0.0)
            across = v - (N @ v) * N
            grip = surface.friction * normal / math.sqrt(across @ across + 0.01**2)
            data.qfrc_applied[:] = linear.T @ (normal * N - grip * across)
        mujoco.mj_Euler(model, data)
    ours = StateView(struck.states[-1], joints)
    motion = np.concatenate([ours.v_WB, ours.w_WB_B, ours.qd_arm])
    free = StateView(_strike(vehicle, replace(surface, stiffness=1e-9), seconds).states[-1], joints)
    turned = np.abs(ours.qd_arm - free.qd_arm).max()
    assert turned > 0.5  # rad/s, what the impact has done
    np.testing.assert_allclose(motion, data.qvel, atol=2e-3 * turned)


def test_a_ball_is_felt_along_its_own_normal() -> None:
    vehicle, radius = SMOOTH, 4.0
    round_one = Surface(
        KINDS.index(BALL), (*(PLACE - radius * N).tolist(), radius), 4000.0, 0.0, 0.0
    )
    flat = _strike(vehicle, _wall(4000.0, 0.0, 0.0), 0.01).surfaces
    curved = _strike(vehicle, round_one, 0.01).surfaces
    assert curved.force_max[0] == pytest.approx(flat.force_max[0], rel=0.005)


def test_finer_steps_change_nothing_but_the_error() -> None:
    surface = _wall(4000.0, 4.0, 0.5)
    coarse = _strike(SMOOTH, surface, 0.05, finer=8).states[-1]
    fine = _strike(SMOOTH, surface, 0.05, finer=64).states[-1]
    np.testing.assert_allclose(coarse, fine, atol=2e-4)


def test_stiff_contact_takes_finer_steps_and_too_stiff_a_one_is_refused() -> None:
    soft, hard = _wall(100.0, 0.1, 0.0), _wall(2000.0, 4.0, 0.5)
    assert steps_of_touch(PAPER, (soft,), 10.0) == 1
    assert 1 < steps_of_touch(PAPER, (hard,), 20.0) <= STEPS_MAX
    with pytest.raises(TooStiffError, match=r"lower stiffness, friction or force_max of zones"):
        steps_of_touch(PAPER, (_wall(1e5, 4.0, 2.0),), 400.0)


def test_the_tip_is_the_first_ball_and_no_place_has_two() -> None:
    balls = balls_of(PAPER)
    assert balls[0] == (2, PAPER.end_effector.position, 0.025)
    places = [(on, place) for on, place, _ in balls]
    assert len(set(places)) == len(places)
    assert (0, (0.0, 0.0, 0.0), 0.08) in balls
    assert (1, (0.0, 0.0, 0.0), 0.02) in balls  # where the first link begins
