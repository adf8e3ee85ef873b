"""An estimate that jumps: what the loops see of plan and observer stays what it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.cascade import in_hover
from fsw.autopilot.estimation.dead_reckoning import moved_on
from fsw.autopilot.estimation.fusion_memory import Reset
from fsw.autopilot.flight.estimate.jump import all_along, held_along, on_return, without_answer
from fsw.autopilot.flight.plan_exchange import nominal_at_rest, with_plan_state
from fsw.autopilot.flight.setpoints.generator import PositionGoal, ReferenceState
from fsw.autopilot.flight.state import FlightState, PlanMemory, SetpointMemory
from fsw.autopilot.geometry.rotation import wrap_angle, yaw_of
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.signals import MotionSetpoint, StateEstimate
from tests.fsw.autopilot.flight.in_flight import flying
from tests.fsw.random_states import estimate_of

SEEN = 1e-9


def errors(state: FlightState, estimate: StateEstimate) -> np.ndarray:
    """Position [m] and yaw [rad] from the plan, velocity [m/s] from the observer: (7,)."""
    assert state.plan_state is not None
    return np.array(
        [
            *np.subtract(estimate.p_WB, state.plan_state.p),
            wrap_angle(yaw_of(estimate.R_WB) - state.plan_state.yaw),
            *np.subtract(estimate.v_WB, state.record.observed.v),
        ]
    )


def moving(random: np.random.Generator) -> tuple[FlightState, StateEstimate]:
    """In flight somewhere, off the plan, with an observer that is not quite right."""
    estimate = estimate_of(
        Rotation.from_euler("zyx", [random.uniform(-3.0, 3.0), 0.0, 0.0]),
        p_WB=tuple(random.uniform(-2.0, 2.0, 3).tolist()),
        v_WB=tuple(random.uniform(-1.0, 1.0, 3).tolist()),
    )
    record = with_plan_state(in_hover(AIRFRAME, estimate), nominal_at_rest(estimate))
    record.observed.v[:] = random.uniform(-1.0, 1.0, 3)
    return replace(flying(), record=record), estimate


def turned_and_moved(
    estimate: StateEstimate, shift: np.ndarray, faster: np.ndarray, yaw: float
) -> StateEstimate:
    turn = Rotation.from_rotvec([0.0, 0.0, yaw]) * Rotation.from_matrix(
        np.reshape(estimate.R_WB, (3, 3))
    )
    return estimate._replace(
        p_WB=tuple(np.add(estimate.p_WB, shift).tolist()),
        v_WB=tuple(np.add(estimate.v_WB, faster).tolist()),
        R_WB=tuple(turn.as_matrix().ravel().tolist()),
    )


@pytest.mark.requirement("REQ-EST-10")
@pytest.mark.parametrize("seed", range(20))
def test_plan_and_observer_come_along_when_positions_return(seed: int) -> None:
    random = np.random.default_rng(seed)
    state, before = moving(random)
    carried = moved_on(before, 0.002)._replace(t_us=before.t_us + 2_000)
    found = turned_and_moved(
        carried, random.uniform(-0.3, 0.3, 3), random.uniform(-0.3, 0.3, 3), random.uniform(-1, 1)
    )
    reset, _ = on_return(found, before)
    record, after, _ = all_along(state.record, state, state.plan, reset)
    after = replace(after, record=record)
    assert errors(after, found) == pytest.approx(errors(state, carried), abs=SEEN)


@pytest.mark.requirement("REQ-EST-10")
@pytest.mark.parametrize(("place", "texts"), [(0.019, 0), (0.021, 1)])
def test_a_jump_of_more_than_20_mm_is_reported(place: float, texts: int) -> None:
    _, before = moving(np.random.default_rng(1))
    still = before._replace(v_WB=(0.0, 0.0, 0.0))
    found = turned_and_moved(still, np.array([0.0, -place, 0.0]), np.zeros(3), 0.0)
    _, said = on_return(found, still)
    assert [text.text for text in said] == [
        "estimate moved by 21 mm, 0.000 rad: the plan moves along"
    ] * texts


@pytest.mark.requirement("REQ-EST-10")
def test_the_place_that_is_kept_comes_along_with_a_jump_that_nobody_expected() -> None:
    """The vehicle has not moved; where a goal leads it, it goes from where it is."""
    state, _ = moving(np.random.default_rng(2))
    goal = PositionGoal(MotionSetpoint(False, (4.0, 5.0, -6.0)))
    ahead = ReferenceState(False, (1.0, 2.0, -3.0), (0.1, 0.0, 0.0), 3.0)
    state = replace(state, setpoint=SetpointMemory(ahead, goal))
    half = np.pi / 12.0
    jump = Reset(1, (-1.0, 0.5, 0.25), turn=(np.cos(half), 0.0, 0.0, np.sin(half)), expected=False)
    after = held_along(state, jump)
    assert np.subtract(after.vehicle.mode_origin, state.vehicle.mode_origin) == pytest.approx(
        jump.position
    )
    assert after.vehicle.mode_yaw - state.vehicle.mode_yaw == pytest.approx(np.pi / 6.0)
    moved = after.setpoint.reference
    assert moved is not None
    assert moved.p == pytest.approx((0.0, 2.5, -2.75))
    assert moved.yaw == pytest.approx(3.0 + np.pi / 6.0 - 2.0 * np.pi)
    assert (moved.v, after.setpoint.goal) == (ahead.v, goal)
    assert held_along(state, jump._replace(expected=True)) is state, "it had drifted, and goes back"


@pytest.mark.requirement("REQ-EST-10")
@pytest.mark.parametrize(("place", "waits"), [(0.019, True), (0.021, False)])
def test_a_plan_that_began_where_the_vehicle_was_thought_to_be_is_not_flown(
    place: float, waits: bool
) -> None:
    """It led back by the whole jump, 14 ms after it."""
    asked = PlanMemory(awaited_id=7, awaited_us=1_000_000, next_id=8)
    after = without_answer(asked, Reset(1, (0.0, 0.0, -place)))
    assert after.awaited_id == (7 if waits else -1)
    assert after.next_id == 8
