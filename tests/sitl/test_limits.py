"""The referee's limits: each is seen in every plant step, timed, and spoils the verdict."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.airframe import AIRFRAME
from sitl.limits import LimitRecord, limits, record_use
from sitl.plant.parameters import EndStops, Vehicle
from sitl.plant.state import ARM, at_rest
from sitl.plant.vector import Array
from sitl.scenario_file import load_scenario
from sitl.simulation import Controls, Simulation
from tests.sitl.state_view import StateView

KEYS = [limit.key for limit in limits(Vehicle())]
STEP_S = 0.001


def state_with(key: str, value: float) -> tuple[Array, tuple[float, float]]:
    """A state, and commands, that use one limit that much and the others little."""
    state = at_rest(2)
    view = StateView(state)
    torque = thrust = 0.1
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
        torque = abs(value)
    else:
        thrust = abs(value)
    return state, (torque, thrust)


def add(
    record: LimitRecord, states: list[Array], sent: tuple[float, float], before_s: float
) -> None:
    """Take steps that followed ``before_s``."""
    most, use = record.arrays
    record_use(np.array(states), sent, most, (before_s, STEP_S), use)


@pytest.mark.requirement("REQ-ACT-9")
@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("key", KEYS)
def test_each_limit_is_recorded_alone_timed_and_broken_beyond_its_tolerance(
    key: str, sign: float
) -> None:
    limit = limits(Vehicle())[KEYS.index(key)]
    for value, kept in (
        (0.9 * limit.most, True),
        (limit.most + 0.9 * limit.tolerance, True),
        (limit.most + 1.1 * limit.tolerance, False),
    ):
        record = LimitRecord(Vehicle())
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
    state = at_rest(2)
    StateView(state).q_arm[0] = math.nan
    record = LimitRecord(Vehicle())
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
    simulation._state[ARM : ARM + 2] = (0.9, 0.5)  # rad; then nothing holds it
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
    assert use.largest < EndStops().angle[0] + math.radians(8.0)
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
    assert simulation.vehicle.rotors.thrust_max == uses["rotor_thrust"].most


def test_both_sides_have_the_same_limits() -> None:
    most = {limit.key: limit.most for limit in limits(Vehicle())}
    assert most == pytest.approx(
        {
            "joint_1_angle": AIRFRAME.joint1_limit,
            "link_2_angle": AIRFRAME.joint12_limit,
            "joint_1_rate": AIRFRAME.joint_rate_max,
            "joint_2_rate": AIRFRAME.joint_rate_max,
            "tilt": AIRFRAME.tilt_max,
            "roll_pitch_rate": AIRFRAME.body_rate_max[0],
            "yaw_rate": AIRFRAME.body_rate_max[1],
            "joint_torque": AIRFRAME.joint_torque_max,
            "rotor_thrust": AIRFRAME.rotor_thrust_max,
        }
    )
