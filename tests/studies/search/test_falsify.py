"""The search finds the defect that was flown once, and nothing beyond the bound that is printed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fsw.autopilot.control.tube import WIND_COVERED
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from sitl.scenario import Push, Scenario, vehicle_of
from sitl.scenario_file import load_scenario, parse_scenario
from sitl.scenario_text import scenario_text
from studies.flight.closed_loop import simulate
from studies.search.falsify import (
    Outcome,
    Search,
    as_scenario,
    bounds,
    each_with,
    replay,
    search,
    search_and_fly,
)
from studies.search.plan_record import PlanRecord, record
from studies.search.surfaces import WITHIN, Met, met_by, unclaimed
from studies.search.tracked_flight import Disturbance
from studies.search.whole_flight import WholeFlight

# Its kernel is compiled for ten seconds in each process.
pytestmark = pytest.mark.long

SCENARIO = replace(load_scenario("workspace"), duration_s=9.0)
NOW = flight_config(body="points")


def _of_one_plan(config: FlightConfig) -> FlightConfig:
    """Without clearances that grow in wind: a flight's plans are then the record's, as in a search.

    What they grow by is for the flight: a search that knows nothing of it finds less room.
    """
    tracking = replace(config.tuning.tracking, wind_limit=WIND_COVERED)
    return replace(config, tuning=replace(config.tuning, tracking=tracking))


def _silent(_: str, __: float, ___: float) -> None:
    """No progress."""


def _before() -> FlightConfig:
    """The loop of the day on which 94 mm were measured for a bound of 69."""
    tracking = replace(
        NOW.tuning.tracking,
        input_weight=1.2e-7,
        vertical_input_weight=1e-6,
        vertical_disturbance_limit=0.0,
        stopping_snap=30.0,
        wind_limit=0.15,
        position_error_limit=0.07,
    )
    return replace(NOW, tuning=replace(NOW.tuning, tracking=tracking))


@cache
def _flown() -> PlanRecord:
    return record(SCENARIO, NOW, lambda _, __: None)


@cache
def _found() -> Outcome:
    return search(SCENARIO, NOW, 0.8, 120, 3, _silent).outcome()


def _chase(config: FlightConfig, amplitude: float, axes: tuple[int, int, int]) -> Outcome:
    hunt = Search(SCENARIO, config, _flown(), amplitude)
    for lead in ((0.0, 1.0, 0.0), (3.0, 1.0, 0.05), (3.0, 1.0, 0.2)):
        for every in (1, 50):
            hunt.adversary(hunt.starts[-1], every, np.outer(axes, lead))
    return hunt.outcome()


def _of_the_push(outcome: Outcome) -> float:
    """What a push on one axis makes of the bound [m], without the memory of wind at its limit."""
    return outcome.bounds.one_axis - bounds(NOW, 0.0).one_axis


@pytest.mark.parametrize("axes", [(1, 0, 0), (0, 1, 0)])
def test_the_old_loop_breaks_its_bound_on_one_axis(axes: tuple[int, int, int]) -> None:
    outcome = _chase(_before(), 0.8, axes)
    assert outcome.worst_of_one_axis is not None
    assert max(outcome.worst_of_one_axis.off_m) > 1.03 * outcome.bounds.one_axis
    assert not outcome.bounds.claims_one_axis  # it would not be claimed today
    assert replace(outcome, bounds=replace(outcome.bounds, claims_one_axis=True)).breaks_one_axis


@pytest.mark.requirement("REQ-SAFE-2")
@pytest.mark.parametrize("amplitude", [0.1, 0.2, 0.4, 0.6, 0.8])
@pytest.mark.parametrize("axes", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)])
def test_the_loop_keeps_its_bound_at_every_amplitude(
    amplitude: float, axes: tuple[int, int, int]
) -> None:
    outcome = _chase(NOW, amplitude, axes)
    assert outcome.holds, outcome.worst
    assert outcome.worst.share <= 1.0  # these adversaries do not break what is not claimed either
    assert outcome.bounds.claims_one_axis
    assert outcome.bounds.claims_all_axes == (amplitude < 0.48)
    if sum(axes) == 1 and axes[2] == 0:
        assert outcome.worst.axes == 1
        assert max(outcome.worst.off_m) > 0.6 * _of_the_push(outcome)  # the adversary comes near


@pytest.mark.requirement("REQ-SAFE-2")
def test_a_search_finds_nothing_beyond_the_bound_and_repeats_itself() -> None:
    outcome = _found()
    assert outcome.evaluations >= 120
    assert outcome.holds, outcome.worst
    assert outcome.worst_of_one_axis is not None
    assert outcome.worst_of_one_axis.axes == 1
    assert max(outcome.worst.off_m) > 0.7 * _of_the_push(outcome)
    again = search(SCENARIO, NOW, 0.8, 120, 3, _silent).outcome()
    assert again.worst.off_m == outcome.worst.off_m


def test_what_was_found_flies_the_same_with_planner_and_referee() -> None:
    worst = _found().worst
    flown = replay(SCENARIO, NOW, worst.start.step, worst.pushes, _silent)
    assert flown.off_m == pytest.approx(worst.off_m, abs=1e-4)
    assert flown.margin_m == pytest.approx(worst.margin_m, abs=1e-3)


def test_what_was_found_is_a_scenario_that_reproduces_the_margin() -> None:
    worst = _found().worst
    text = scenario_text(as_scenario(SCENARIO, worst))
    warned = replace(NOW, limits=replace(NOW.limits, breach_action=1))  # as the search flies
    truth = simulate(parse_scenario(text, "worst"), 0, warned).truth
    calm = simulate(replace(SCENARIO, disturbances=()), 0, warned).truth
    assert truth.min_margin_m is not None
    assert calm.min_margin_m is not None
    assert truth.min_margin_m == pytest.approx(min(worst.margin_m, calm.min_margin_m), abs=1e-3)
    assert truth.min_margin_m < calm.min_margin_m - 0.01


@pytest.mark.parametrize(
    ("name", "vehicle"), [("shelf", None), ("crossing", None), ("workspace", "hexa-3r")]
)
def test_the_margins_are_those_of_the_referee(name: str, vehicle: str | None) -> None:
    """Of a full body, and of another vehicle."""
    scenario = replace(load_scenario(name, None, vehicle), duration_s=7.0)
    config = _of_one_plan(flight_config(body=scenario.body, vehicle=vehicle_of(scenario)))
    worst = search(scenario, config, 0.8, 8, 1, _silent).outcome().min_margin
    flown = replay(scenario, config, worst.start.step, worst.pushes, _silent)
    assert flown.off_m == pytest.approx(worst.off_m, abs=1e-4)
    assert flown.margin_m == pytest.approx(worst.margin_m, abs=1e-3)
    assert flown.margin_m < 3.0


def test_the_whole_stack_flies_a_stretch_as_the_replay_does_and_forgets_it() -> None:
    # A replay only reports a breach.
    warned = replace(NOW, limits=replace(NOW.limits, breach_action=1))
    flight = WholeFlight(SCENARIO, warned)
    flight.go_to(700, lambda _, __: None)
    chase = Disturbance(0.8, 50, np.zeros((0, 3)), np.outer((1, 1, 1), (0.0, 1.0, 0.0)))
    first, again = flight.stretch(1500, chase), flight.stretch(1500, chase)
    assert first == again
    assert first.contact is None
    assert max(first.off_m) > 0.05
    flown = replay(SCENARIO, NOW, 700, first.pushes, _silent)
    assert flown.off_m == pytest.approx(first.off_m, abs=1e-4)
    assert flown.margin_m == pytest.approx(first.margin_m, abs=1e-4)


def test_contact_of_the_whole_stack_is_a_broken_claim() -> None:
    walls = replace(load_scenario("walls"), duration_s=9.0)
    flight = WholeFlight(walls, NOW)
    flight.go_to(800, lambda _, __: None)
    north = Disturbance(6.0, 50, np.ones((1, 3)) * (1.0, 0.0, 0.0), np.zeros((3, 3)))
    flown = flight.stretch(2500, north)
    assert flown.contact is not None
    assert "wall" in flown.contact
    assert flown.margin_m < -0.05
    assert flown.departures > 0
    assert flown.breaches > 0


@pytest.mark.long
def test_a_search_flies_a_tenth_with_the_whole_stack() -> None:
    outcome, whole = search_and_fly(SCENARIO, NOW, 0.8, 80, 3, _silent)
    assert 72 <= outcome.evaluations < 90
    assert 4 <= whole.evaluations <= 8
    assert whole.holds
    assert whole.furthest.flown.off_m
    assert max(whole.furthest.flown.off_m) > 0.04


def test_the_safety_filter_of_the_search_is_the_one_that_flies() -> None:
    # It acts in every swing, instead of hardly ever.
    steady = _of_one_plan(NOW)
    eager = replace(steady, safety_filter=replace(NOW.safety_filter, allowance=0.5))
    hunt = Search(SCENARIO, eager, _flown(), 0.8)
    hunt.adversary(hunt.starts[-1], 50, np.outer((1, 0, 0), (0.0, 1.0, 0.0)))
    found = hunt.outcome().worst
    assert found.filtered_ticks > 10
    flown = replay(SCENARIO, eager, found.start.step, found.pushes, _silent)
    assert flown.off_m == pytest.approx(found.off_m, abs=1e-4)


def _pressing() -> Scenario:
    """One place of ``probe``, pressed on for a shorter time."""
    whole = load_scenario("probe")
    assert isinstance(whole.trajectory, Push)
    one = replace(
        whole.trajectory, position_m=whole.trajectory.position_m[:1], force_n=(5.0,), hold_s=(2.0,)
    )
    return replace(whole, trajectory=one, duration_s=10.0, disturbances=())


@cache
def _hardest() -> Outcome:
    return search(_pressing(), _config_of(_pressing()), 0.8, 60, 3, _silent).outcome()


def _config_of(scenario: Scenario) -> FlightConfig:
    return flight_config(body=scenario.body, vehicle=vehicle_of(scenario))


@pytest.mark.requirement("REQ-SAFE-13")
def test_no_push_and_no_surface_in_the_range_makes_the_tool_press_too_hard() -> None:
    outcome = _hardest()
    worst = outcome.worst_force
    assert outcome.bounds.claims_force
    assert worst is not None
    assert 0.55 < worst.force_share <= 1.0  # 5.5 N of 10 N: an adversary finds more than is asked
    assert not outcome.breaks_force
    assert replace(outcome, worst_force=replace(worst, force_share=1.01)).breaks_force
    none = search(SCENARIO, NOW, 0.8, 20, 3, _silent).outcome()
    assert none.worst_force is None  # nothing is to be touched


def test_the_force_that_was_found_flies_with_the_whole_stack() -> None:
    scenario, worst = _pressing(), _hardest().worst_force
    assert worst is not None
    met = worst.disturbance.met
    flown = replay(
        scenario, _config_of(scenario), worst.start.step, worst.pushes, _silent, met
    )  # fmt: skip
    assert 0.5 < flown.force_share <= 1.0
    changed = as_scenario(scenario, worst)
    (panel,), (before,) = changed.zones, scenario.zones
    assert (panel.touch == before.touch) == (met is None)


@pytest.mark.requirement("REQ-SAFE-14")
@pytest.mark.parametrize("first_step", [300, 1400])
def test_beyond_what_is_claimed_the_vehicle_says_what_it_does(first_step: int) -> None:
    """A wall that comes by 0.1 m/s: where the tool is about to touch, and where nobody looks."""
    scenario = _pressing()
    flight = WholeFlight(scenario, _config_of(scenario))
    flight.go_to(first_step, lambda _, __: None)
    known = {met.name: met for met in unclaimed(scenario)}
    still = np.zeros((1, 3))
    flown = flight.stretch(2500, Disturbance(0.8, 50, still, np.zeros((3, 3)), known["comes"]))
    assert any("surface not where announced" in text for text in flown.told), flown.told
    assert flown.contact is None
    assert flown.force_share <= 1.0
    calm = flight.stretch(2500, Disturbance(0.8, 50, still, np.zeros((3, 3))))
    assert not calm.left
    assert 0.4 < calm.force_share < 0.7


def test_a_surface_is_as_stiff_and_as_rough_as_the_search_says() -> None:
    scenario = _pressing()
    low, high = (met_by(scenario, Met("", hardness, 0.5)).zones[0].touch for hardness in (0.0, 1.0))
    assert low is not None
    assert high is not None
    assert (low.stiffness_n_m, high.stiffness_n_m) == (500.0, 2000.0)
    assert low.friction == 0.25
    twice = met_by(scenario, Met("", 2.0, 1.0)).zones[0].touch
    assert twice is not None
    assert twice.stiffness_n_m == 4000.0
    assert not any("as stiff" in met.name and met in WITHIN for met in unclaimed(scenario))


def test_what_is_not_claimed_is_met_from_everywhere_before_anything_is_flown_twice() -> None:
    """As many finds as kinds would else meet the same, each time round."""
    found = _hardest().worst_force
    assert found is not None
    kinds = unclaimed(_pressing())
    for count in (3, len(kinds), 12):
        finds = [replace(found, margin_m=float(k)) for k in range(count)]
        flown = each_with(finds, kinds, 30)
        assert len({(one.margin_m, str(one.disturbance.met)) for one in flown}) == 30
    assert each_with([], kinds, 30) == []


def test_a_process_flies_both_bodies_alike() -> None:
    scenario = replace(load_scenario("shelf"), duration_s=1.0)
    for body in ("points", "full"):
        truth = simulate(scenario, 0, flight_config(body=body)).truth
        assert truth.completed, truth.end_reason
