"""Off the plan and outside the safe set: when an episode begins, how it ends, what is counted."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.autopilot.control.tube import base_reach
from fsw.autopilot.flight.plan_exchange import nominal_at_rest
from fsw.autopilot.flight.safety.safety_watch import NOISE_ROOM, SafetyWatch
from fsw.autopilot.flight.state import SafetyMemory
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import ConstraintReport, SafetyCounters, StateEstimate, Vec3
from tests.fsw.autopilot.flight.in_flight import CONFIG, GROUND_Z, vehicle_at
from tests.fsw.random_states import estimate_of

TUBE = loop_tube(CONFIG)
WATCH = SafetyWatch(CONFIG, TUBE)
R = WATCH.radius
HERE: Vec3 = (1.0, -2.0, -3.0)
CALM = SafetyMemory()
TICK_US = 2_000


def away(memory: SafetyMemory, offset: Vec3, t_s: float = 1.0, here: Vec3 = HERE) -> SafetyMemory:
    """The memory after a tick with the vehicle off its plan."""
    plan = nominal_at_rest(vehicle_at(here))
    p = (here[0] + offset[0], here[1] + offset[1], here[2] + offset[2])
    return WATCH.off_plan(memory, vehicle_at(p, t_us=round(1e6 * t_s)), plan)


def margins(memory: SafetyMemory, least: float, t_s: float = 1.0) -> SafetyMemory:
    report = ConstraintReport(margins=(0.5, least, 0.3))
    return WATCH.breach(memory, vehicle_at(HERE, t_us=round(1e6 * t_s)), report, 1, flies=True)


@pytest.mark.requirement("REQ-SAFE-3")
def test_the_tube_has_room_for_wind_that_begins_or_turns_and_for_noise() -> None:
    wind = CONFIG.tuning.tracking.wind_limit
    pushed = CONFIG.surroundings.disturbance + wind
    assert pytest.approx(base_reach(TUBE, pushed) + NOISE_ROOM) == R
    still = replace(CONFIG, surroundings=replace(CONFIG.surroundings, disturbance=0.0))
    assert SafetyWatch(still, TUBE).radius == pytest.approx(base_reach(TUBE, wind) + NOISE_ROOM)
    calm = replace(TUBE, base_wind=0.0, wind=0.0, wind_beyond=0.0)
    assert SafetyWatch(still, calm).radius == pytest.approx(0.05)
    pid = flight_config(inner="pid")
    assert SafetyWatch(pid, TUBE).radius == pid.upset_distance


@pytest.mark.requirement("REQ-SAFE-3")
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_it_has_left_the_tube_beyond_its_radius_on_any_axis(axis: int, sign: float) -> None:
    def offset(by: float) -> Vec3:
        x, y, z = (sign * by if k == axis else 0.0 for k in range(3))
        return x, y, z

    assert away(CALM, offset(0.999 * R)) is CALM
    left = away(CALM, offset(1.001 * R))
    assert left.off_plan_us == 1_000_000
    assert left.off_plan_by == pytest.approx(1.001 * R)
    assert left.replan
    assert left.counters == SafetyCounters(departures=1)


def test_what_is_no_number_has_left_it() -> None:
    assert away(CALM, (float("nan"), 0.0, 0.0)).off_plan_us >= 0


def test_on_the_ground_the_plan_may_be_lower() -> None:
    assert away(CALM, (0.0, 0.0, -2.0 * R), here=(0.0, 0.0, GROUND_Z + R)) is CALM
    assert away(CALM, (2.0 * R, 0.0, 0.0), here=(0.0, 0.0, GROUND_Z)).off_plan_us >= 0


def test_an_episode_is_one_until_it_has_been_on_its_plan_for_a_while() -> None:
    memory = away(CALM, (1.1 * R, 0.0, 0.0), 1.0)
    for t_s, by in ((1.1, 0.9), (1.2, 1.2), (1.3, 0.4), (1.7, 0.6), (1.9, 0.1)):
        memory = away(memory, (by * R, 0.0, 0.0), t_s)
        assert memory.off_plan_us >= 0
    assert memory.counters.departures == 1
    memory = away(memory, (0.1 * R, 0.0, 0.0), 2.19)
    assert memory.off_plan_us >= 0, "0.5 s from when it was last away"
    memory = away(memory, (0.1 * R, 0.0, 0.0), 2.2)
    assert memory.off_plan_us == -1
    assert away(memory, (1.1 * R, 0.0, 0.0), 3.0).counters.departures == 2


@pytest.mark.requirement("REQ-SAFE-3")
def test_each_time_it_is_out_it_plans_anew() -> None:
    memory = replace(away(CALM, (1.1 * R, 0.0, 0.0), 1.0), replan=False)
    assert not away(memory, (0.9 * R, 0.0, 0.0), 1.1).replan
    assert away(memory, (1.1 * R, 0.0, 0.0), 1.1).replan


def test_without_a_plan_there_is_nothing_to_leave() -> None:
    assert WATCH.off_plan(CALM, vehicle_at(HERE), None) is CALM
    left = away(CALM, (1.1 * R, 0.0, 0.0))
    assert WATCH.off_plan(left, vehicle_at(HERE), None).off_plan_us == -1


@pytest.mark.requirement("REQ-SAFE-4")
def test_a_negative_margin_is_a_breach_and_counted_once() -> None:
    assert margins(CALM, 0.0) is CALM
    memory = margins(CALM, -0.003)
    assert (memory.breach_us, memory.breach_by) == (1_000_000, 0.003)
    for t_s, least in ((1.1, 0.002), (1.2, -0.02), (1.3, 0.009), (1.4, 0.011), (1.7, 0.02)):
        memory = margins(memory, least, t_s)
        assert memory.breach_us >= 0
    assert memory.counters == SafetyCounters(breaches=1)
    memory = margins(memory, 0.011, 1.8)
    assert memory.breach_us == -1
    assert margins(memory, -0.001, 2.0).counters.breaches == 2


def test_a_margin_that_is_no_number_is_a_breach() -> None:
    assert margins(CALM, float("nan")).breach_us >= 0


@pytest.mark.parametrize(("report", "flies"), [((-0.1,), False), ((), True)])
def test_on_the_ground_or_without_zones_there_is_no_breach(
    report: tuple[float, ...], flies: bool
) -> None:
    constraints = ConstraintReport(margins=report)
    assert WATCH.breach(CALM, vehicle_at(HERE), constraints, 1, flies=flies) is CALM
    outside = margins(CALM, -0.1)
    assert WATCH.breach(outside, vehicle_at(HERE), constraints, 1, flies=flies).breach_us == -1


# ---------------------------------------------------------------- attitude, fences, time


def rolled(degrees: float, axis: str = "x", t_us: int = 0) -> StateEstimate:
    return estimate_of(Rotation.from_euler(axis, degrees, degrees=True))._replace(t_us=t_us)


@pytest.mark.requirement("REQ-EST-9")
@pytest.mark.parametrize("degrees", [-179.0, -61.0, 61.0, 90.0, 179.0])
def test_a_roll_beyond_its_limit_is_noted_since_when_and_forgotten_when_it_is_over(
    degrees: float,
) -> None:
    memory = WATCH.attitude(SafetyMemory(), rolled(degrees, t_us=5), flies=True)
    assert (memory.rolled_us, memory.pitched_us) == (5, -1)
    memory = WATCH.attitude(memory, rolled(degrees, t_us=9), flies=True)
    assert memory.rolled_us == 5
    assert WATCH.attitude(memory, rolled(59.0, t_us=11), flies=True).rolled_us == -1
    assert WATCH.attitude(memory, rolled(degrees, t_us=11), flies=False).rolled_us == -1


@pytest.mark.requirement("REQ-EST-9")
@pytest.mark.parametrize("degrees", [-61.0, 61.0, 89.0])
def test_a_pitch_beyond_its_limit_is_one_of_its_own(degrees: float) -> None:
    memory = WATCH.attitude(SafetyMemory(), rolled(degrees, "y", t_us=5), flies=True)
    assert (memory.rolled_us, memory.pitched_us) == (-1, 5)


def test_an_attitude_that_is_no_number_is_beyond_both_limits() -> None:
    lost = rolled(0.0, t_us=5)._replace(R_WB=(math.nan,) * 9)
    memory = WATCH.attitude(SafetyMemory(), lost, flies=True)
    assert (memory.rolled_us, memory.pitched_us) == (5, 5)


@given(st.floats(-math.pi, math.pi), st.floats(-1.57, 1.57), st.floats(0.02, math.pi))
def test_what_is_upright_needs_no_look(roll: float, pitch: float, limit: float) -> None:
    config = replace(CONFIG, limits=replace(CONFIG.limits, roll_failure=limit))
    watch = SafetyWatch(config, TUBE)
    tilted = estimate_of(Rotation.from_euler("ZYX", (0.3, pitch, roll)))
    memory = watch.attitude(SafetyMemory(), tilted, flies=True)
    if tilted.R_WB[8] > watch.upright:
        assert (memory.rolled_us, memory.pitched_us) == (-1, -1)


def test_a_limit_of_zero_is_no_check() -> None:
    config = replace(CONFIG, limits=replace(CONFIG.limits, roll_failure=0.0, pitch_failure=0.0))
    watch = SafetyWatch(config, loop_tube(config))
    assert watch.attitude(SafetyMemory(), rolled(180.0), flies=True) == SafetyMemory()


def of_both(
    memory: SafetyMemory, margins: tuple[float, ...], t_s: float = 1.0, seen: float = math.inf
) -> SafetyMemory:
    """The memory after a look at two announced zones and one of the fence, two parts each."""
    report = ConstraintReport(margins=margins, per_zone=(2, 2, 2))
    now = vehicle_at(HERE, t_us=round(1e6 * t_s))
    return WATCH.breach(memory, now, report, 2, flies=True, seen=seen)


@pytest.mark.requirement("REQ-SAFE-4")
@pytest.mark.parametrize(
    ("margins", "of_set", "of_fence"),
    [
        ((0.1, 0.2, 0.3, -0.1, 0.1, 0.1), 0.1, None),
        ((0.1, 0.2, 0.3, 0.1, 0.1, -0.2), None, 0.2),
        ((-0.1, 0.2, 0.3, 0.1, 0.1, -0.2), 0.1, 0.2),
        ((-0.2, 0.2, 0.3, 0.1, 0.1, -0.1), 0.2, 0.1),
        ((0.1, 0.2, 0.3, 0.1, math.nan, 0.1), None, math.inf),
    ],
)
def test_what_is_outside_the_fence_and_outside_the_rest_are_breaches_of_their_own(
    margins: tuple[float, ...], of_set: float | None, of_fence: float | None
) -> None:
    memory = of_both(CALM, margins)
    assert (memory.breach_us >= 0, memory.fence_us >= 0) == (
        of_set is not None,
        of_fence is not None,
    )
    assert (memory.breach_by, memory.fence_by) == (of_set or 0.0, of_fence or 0.0)
    assert memory.counters.breaches == 1, "it is outside once"


@pytest.mark.requirement("REQ-SAFE-4")
def test_a_breach_of_one_hides_neither_the_beginning_nor_the_end_of_the_other() -> None:
    memory = of_both(CALM, (0.2, 0.2, 0.2, 0.2, 0.2, -0.1))
    memory = of_both(memory, (0.2, -0.3, 0.2, 0.2, 0.2, -0.4), 2.0)
    assert (memory.breach_us, memory.breach_by) == (2_000_000, 0.3)
    assert (memory.fence_us, memory.fence_by) == (2_000_000, 0.1), "as it began"
    memory = of_both(memory, (0.2, -0.3, 0.2, 0.2, 0.2, 0.1), 2.5)
    assert (memory.breach_us, memory.fence_us) == (2_500_000, -1)
    assert of_both(memory, (0.2,) * 6, 3.0).breach_us == -1


def test_what_only_the_safety_filter_sees_is_of_the_nearest_zone() -> None:
    first = of_both(CALM, (0.2, 0.01, 0.2, 0.2, 0.2, 0.1), seen=-0.003)
    assert (first.breach_by, first.fence_us) == (0.003, -1)
    last = of_both(CALM, (0.2, 0.02, 0.2, 0.2, 0.2, 0.01), seen=math.nan)
    assert (last.breach_us, last.fence_us) == (-1, 1_000_000)
    both = of_both(CALM, (0.2, 0.01, 0.2, 0.2, 0.2, -0.2), seen=-0.2)
    assert (both.breach_us, both.fence_by) == (-1, 0.2), "the report has it already"


def test_a_jump_of_time_is_noted_with_its_length() -> None:
    memory = WATCH.jumped(SafetyMemory(), 700_000, -600_000)
    assert (memory.jump_us, memory.jumped_us) == (-600_000, 700_000)
