"""The referee's limits: each is seen in every plant step, timed, and spoils the verdict."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.airframe import AIRFRAME
from sitl.limits import LimitRecord, limits, record_use
from sitl.plant.state import at_rest
from sitl.plant.vector import Array
from sitl.scenario_file import load_scenario
from sitl.simulation import Controls, Simulation
from tests.fsw.paper_arm import LIMIT1, LIMIT12
from tests.sitl.state_view import StateView
from tests.sitl.vehicles import PAPER, random_vehicle

KEYS = [limit.key for limit in limits(PAPER)]
STEP_S = 0.001


def state_with(key: str, value: float) -> tuple[Array, tuple[float, float]]:
    """A state, and commands, that use one limit that much and the others little."""
    state = at_rest(4, 2)
    view = StateView(state)
    torque = thrust = 0.01
    if key == "joint_1_angle":
        view.q_arm[:] = (value, -value)
    elif key == "link_2_angle":
        view.q_arm[:] = (0.3 * value, 0.7 * value)
    elif key in ("joint_1_rate", "joint_2_rate"):
        view.qd_arm[KEYS.index(key) - KEYS.index("joint_1_rate")] = value
    elif key == "tilt":
        x, y, z, w = Rotation.from_euler("ZYX", (2.0, 0.0, value)).as_quat()
        view.q_WB[:] = (w, x, y, z)
    elif key == "roll_pitch_rate":
        view.w_WB_B[:] = (0.6 * value, -0.8 * value, 0.0)
    elif key == "yaw_rate":
        view.w_WB_B[2] = value
    elif key == "joint_torque":
        torque = abs(value) / PAPER.joints[0].torque_max
    else:
        thrust = abs(value) / PAPER.rotors[0].thrust_max
    return state, (torque, thrust)


def add(
    record: LimitRecord, states: list[Array], sent: tuple[float, float], before_s: float
) -> None:
    """Take steps that followed ``before_s``."""
    bounds, use = record.arrays
    record_use(np.array(states), sent, bounds, (before_s, STEP_S), use)


@pytest.mark.requirement("REQ-ACT-9")
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("key", KEYS)
def test_each_limit_is_recorded_alone_timed_and_broken_beyond_its_tolerance(
    key: str, sign: float
) -> None:
    limit = limits(PAPER)[KEYS.index(key)]
    for value, kept in (
        (0.9 * limit.most, True),
        (limit.most + 0.9 * limit.tolerance, True),
        (limit.most + 1.1 * limit.tolerance, False),
    ):
        record = LimitRecord(PAPER)
        quiet, sent = state_with(key, 0.2 * sign * limit.most)
        loud, much = state_with(key, sign * value)
        add(record, [quiet, quiet], sent, 0.0)
        add(record, [loud, loud], much, 0.002)
        add(record, [quiet, quiet], sent, 0.004)
        uses = record.uses()
        assert uses[key].largest == pytest.approx(value, rel=1e-9)
        assert uses[key].at_s == pytest.approx(0.003)
        assert uses[key].beyond_s == pytest.approx(0.002 if value > limit.most else 0.0)
        assert uses[key].kept is kept
        others = [use for name, use in uses.items() if name != key]
        assert all(use.kept and use.beyond_s == 0.0 for use in others)
        assert [key.replace("_", " ") in flaw for flaw in record.flaws()] == (
            [] if kept else [True]
        )


def test_what_is_not_a_number_breaks_its_limit() -> None:
    state = at_rest(4, 2)
    StateView(state).q_arm[0] = math.nan
    record = LimitRecord(PAPER)
    assert not record.uses()
    add(record, [state], (0.0, 0.0), 0.0)
    assert not record.uses()["joint_1_angle"].kept
    assert record.uses()["tilt"].kept


@pytest.mark.requirement("REQ-ACT-9")
@pytest.mark.parametrize("armed", [True, False])
def test_limits_are_those_of_a_vehicle_that_is_armed(armed: bool) -> None:
    """The arm of one that has landed is limp: it falls, as fast as it likes."""
    simulation = Simulation(load_scenario("ground"), 0)
    simulation.advance(Controls((0.0,) * 4, (0.0, 0.0), armed=True))
    simulation._state[17:19] = (0.9, 0.5)  # rad; then nothing holds it
    for _ in range(200):
        simulation.advance(Controls((0.0,) * 4, (0.0, 0.0), armed=armed))
    result = simulation.result()
    assert ("joint 1 rate" in result.end_reason) is armed
    assert result.limits["joint_1_rate"].kept is not armed
    assert result.limits["joint_1_rate"].at_s == pytest.approx(0.4, abs=0.3) or not armed


@pytest.mark.requirement("REQ-ACT-9")
def test_a_run_in_which_a_joint_leaves_its_limit_is_not_completed() -> None:
    """Full torque on the first joint throws it against its stop."""
    simulation = Simulation(load_scenario("walls-calm"), 0)
    hover = 0.5
    for _ in range(60):
        simulation.advance(Controls((hover,) * 4, (1.0, 0.0), armed=True))
    result = simulation.result()
    use = result.limits["joint_1_angle"]
    assert use.largest > math.radians(60.5)
    assert use.largest < math.radians(63.0 + 8.0)
    assert not use.kept
    assert not result.completed
    assert "joint 1 angle reached" in result.end_reason


@pytest.mark.parametrize(
    ("thrust", "torque", "broken"),
    [((1.0,) * 4, 1.0, None), ((1.01, 0.5, 0.5, 0.5), 0.1, "rotor_thrust"),
     ((-0.01, 0.5, 0.5, 0.5), 0.1, "rotor_thrust"), ((0.5,) * 4, -1.01, "joint_torque")],
)  # fmt: skip
def test_commands_count_as_they_arrive(
    thrust: tuple[float, float, float, float], torque: float, broken: str | None
) -> None:
    simulation = Simulation(load_scenario("walls-calm"), 0)
    simulation.advance(Controls(thrust, (0.0, torque), armed=True))
    uses = simulation.result().limits
    assert [key for key, use in uses.items() if not use.kept] == ([broken] if broken else [])
    assert simulation.vehicle.rotors[0].thrust_max == uses["rotor_thrust"].most


def test_both_sides_have_the_same_limits() -> None:
    most = {limit.key: limit.most for limit in limits(PAPER)}
    assert most == pytest.approx(
        {
            "joint_1_angle": LIMIT1,
            "link_2_angle": LIMIT12,
            "joint_1_rate": AIRFRAME.joint_rate_max[0],
            "joint_2_rate": AIRFRAME.joint_rate_max[0],
            "tilt": AIRFRAME.tilt_max,
            "roll_pitch_rate": AIRFRAME.body_rate_max[0],
            "yaw_rate": AIRFRAME.body_rate_max[1],
            "joint_torque": AIRFRAME.joint_torque_max[0],
            "rotor_thrust": AIRFRAME.weakest_thrust,
        }
    )


def test_an_angle_that_is_limited_on_one_side_or_unevenly_has_a_limit_for_each() -> None:
    first, second = PAPER.joints
    vehicle = replace(
        PAPER,
        joints=(replace(first, position_min=-0.5), replace(second, position_max=1.5)),
        coupled_limits=(),
    )
    record = LimitRecord(vehicle)
    angles = {limit.key: limit.most for limit in record.limits if limit.key.endswith("e_max")}
    angles |= {limit.key: limit.most for limit in record.limits if limit.key.endswith("e_min")}
    top = first.position_max
    assert angles == {"joint_1_angle_max": top, "joint_1_angle_min": 0.5, "joint_2_angle_max": 1.5}
    state = at_rest(4, 2)
    StateView(state).q_arm[:] = (-0.6, -3.0)
    add(record, [state], (0.0, 0.0), 0.0)
    broken = [key for key, use in record.uses().items() if not use.kept]
    assert broken == ["joint_1_angle_min"]
    assert record.uses()["joint_1_angle_min"].largest == pytest.approx(0.6)


def test_a_joint_that_never_is_at_zero_keeps_its_limits() -> None:
    first, second = PAPER.joints
    below = replace(first, position_min=-2.0, position_max=-0.1)
    vehicle = replace(PAPER, joints=(below, second), coupled_limits=())
    record, state = LimitRecord(vehicle), at_rest(4, 2)
    StateView(state).q_arm[:] = (-0.5, 0.0)
    add(record, [state], (0.0, 0.0), 0.0)
    use = record.uses()["joint_1_angle_max"]
    assert (use.largest, use.kept, use.beyond_s) == (-0.5, True, 0.0)


def test_every_limit_is_judged_whatever_joints_are_named() -> None:
    names = ("yaw", "a1", "a_1")
    joints = tuple(replace(PAPER.joints[0], name=name) for name in names)
    sum_of_two = replace(PAPER.coupled_limits[0], name="yaw", row=(1.0, 1.0, 0.0))
    vehicle = replace(PAPER, joints=joints, coupled_limits=(sum_of_two,))
    record, state = LimitRecord(vehicle), at_rest(4, 3)
    StateView(state, 3).qd_arm[0] = 2.0 * joints[0].rate_max
    add(record, [state], (0.0, 0.0), 0.0)
    uses = record.uses()
    assert len(uses) == len(record.limits)
    assert uses["yaw_rate"].most == PAPER.limits.yaw_rate
    assert [key for key, use in uses.items() if not use.kept] == ["joint_yaw_rate"]


def test_a_slow_joint_may_not_turn_at_twice_its_rate() -> None:
    first, second = PAPER.joints
    vehicle = replace(PAPER, joints=(replace(first, rate_max=0.05), second))
    record, state = LimitRecord(vehicle), at_rest(4, 2)
    StateView(state).qd_arm[:] = 0.1, 5.09
    add(record, [state], (0.0, 0.0), 0.0)
    assert [key for key, use in record.uses().items() if not use.kept] == ["joint_1_rate"]


def test_drives_that_are_not_alike_are_judged_by_the_share_of_each() -> None:
    vehicle = random_vehicle(3, 5, np.random.default_rng(1))
    record, state = LimitRecord(vehicle), at_rest(5, 3)
    add(record, [state], (1.01, 0.4), 0.0)
    use = record.uses()
    assert (use["joint_torque"].largest, use["joint_torque"].most) == (1.01, 1.0)
    assert not use["joint_torque"].kept
    assert use["rotor_thrust"].kept
    assert "joint torque reached 1.01 of full of 1.00 of full" in record.flaws()[0]
