"""A gain changed in flight acts on the next tick, whole; what breaks an inequality does not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.tuned_autopilot import TunedAutopilot
from fsw.autopilot.parameters.contradictions import contradictions
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.autopilot.signals import Mode, Plan
from fsw.autopilot.tuning import Tuning, part, tuned
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, SET_MODE, Flight, command, hover, on_the_ground
from tests.closed_loop.harness import real_planner as planner_of

SOFTER_JOINTS: Tuning = (("tuning.joint.kp", 380.0),)
EVERYTHING: Tuning = (
    ("planner.weights.tracking", 12.0),
    ("planner.walls.lambda_", 0.33),
    ("tuning.yaw.kp", 6.0),
    ("tuning.joint.kp", 380.0),
    ("tuning.tracking.input_weight", 1.7e-7),
    ("tuning.tracking.observer_bandwidth", 120.0),
    ("limits.mission_speed", 0.3),
    ("upset_distance", 0.2),
)
TOO_LITTLE_KEPT: Tuning = (("planner.walls.lambda_", 0.1),)


def beside_walls(seconds: float = 1.0) -> Flight:
    flight = Flight(load_scenario("walls"), seed=11)
    flight.follow()
    flight.run(seconds)
    return flight


@pytest.mark.parametrize("tuning", [SOFTER_JOINTS, EVERYTHING])
def test_a_change_acts_on_exactly_the_tick_it_is_given_to(tuning: Tuning) -> None:
    flight, other = beside_walls(), beside_walls()
    assert flight.state == other.state
    flight.step()
    other.step(tuning=tuning)
    assert len(flight.sent) == len(other.sent)
    assert flight.sent[:-1] == other.sent[:-1]
    assert flight.sent[-1] != other.sent[-1]


@pytest.mark.requirement("REQ-ARM-8")
def test_no_tick_mixes_old_and_new() -> None:
    """A tick after a change is that of a vehicle which has never had another tuning."""
    flight = beside_walls()
    flight.step(tuning=EVERYTHING)
    fresh = Autopilot(tuned(flight_config(body="points"), EVERYTHING))
    for _ in range(60):  # more than a planning period
        before = flight.state
        outputs = flight.step()
        assert flight.inputs is not None
        state, expected = fresh.tick(before, flight.inputs)
        if expected.plan_request is not None:
            request = replace(expected.plan_request, tuning=part(EVERYTHING, "planner"))
            expected = replace(expected, plan_request=request)
        assert (state, expected) == (flight.state, outputs)
    assert flight.state.tuning == EVERYTHING


def test_the_tick_of_the_change_itself_is_the_new_ones() -> None:
    flight = beside_walls()
    before = flight.state
    outputs = flight.step(tuning=EVERYTHING)
    assert flight.inputs is not None
    fresh = Autopilot(tuned(flight_config(body="points"), EVERYTHING))
    _, expected = fresh.tick(before, replace(flight.inputs, tuning=None))
    assert outputs.actuators == expected.actuators
    assert outputs.tuning_taken is True


def test_the_default_tuning_again_is_the_old_vehicle_again() -> None:
    flight, never_tuned = beside_walls(), beside_walls()
    flight.step(tuning=())
    never_tuned.step()
    assert flight.state == never_tuned.state


def test_the_planner_hears_of_a_change_with_the_question_of_that_tick() -> None:
    flight = beside_walls()
    tuned_planner = planner_of(tuned(flight_config(body="points"), EVERYTHING))
    outputs = flight.step(tuning=EVERYTHING)
    while outputs.plan_request is None:
        outputs = flight.step()
    request = outputs.plan_request
    assert dict(request.tuning) == {"weights.tracking": 12.0, "walls.lambda_": 0.33}
    assert flight.planner is not None
    answer, expected = flight.planner.plan(request), tuned_planner.plan(replace(request, tuning=()))
    untuned = planner_of(flight_config(body="points")).plan(replace(request, tuning=()))
    assert isinstance(answer, Plan)
    assert isinstance(expected, Plan)
    assert isinstance(untuned, Plan)
    assert answer.cost != untuned.cost
    # From another guess, so not to the last digit.
    for got, wanted in zip(answer.inputs, expected.inputs, strict=True):
        assert got.a == pytest.approx(wanted.a, abs=2e-3)


def test_a_planner_asked_without_a_tuning_again_is_the_old_planner() -> None:
    flight = beside_walls()
    while flight.step().plan_request is None:
        pass
    request = flight.outputs.plan_request
    assert request is not None
    planner, old = (
        planner_of(flight_config(body="points")),
        planner_of(flight_config(body="points")),
    )
    planner.plan(replace(request, tuning=(("weights.tracking", 50.0),)))
    back = planner.plan(replace(request, tuning=()))
    assert isinstance(back, Plan)
    first = old.plan(request)
    assert isinstance(first, Plan)
    assert back.cost == pytest.approx(first.cost, rel=1e-3)


@pytest.mark.requirement("REQ-SAFE-7")
def test_in_the_air_what_breaks_an_inequality_is_refused_with_it() -> None:
    flight = beside_walls()
    outputs = flight.step(tuning=TOO_LITTLE_KEPT)
    assert outputs.tuning_taken is False
    assert flight.state.tuning == ()
    (text,) = [text.text for text in outputs.texts]
    assert "refused while armed" in text
    assert "pushes the base further than 71 mm" in text
    assert "lambda >= 0.2" in text
    flight.run(0.2)
    assert flight.mode is Mode.TRAJECTORY


@pytest.mark.requirement("REQ-SAFE-7")
def test_on_the_ground_it_is_taken_and_keeps_the_vehicle_there() -> None:
    walls = load_scenario("walls").walls
    flight = Flight(replace(on_the_ground(), walls=walls))
    flight.step()
    outputs = flight.step(tuning=TOO_LITTLE_KEPT)
    assert outputs.tuning_taken is True
    flight.run(0.2)
    (told,) = [text for text in flight.texts if "pushes the base" in text]
    assert told.startswith("parameters contradict each other: ")
    flight.step(command(ARM, 1.0))
    assert flight.mode is Mode.DISARMED
    assert "pushes the base" in flight.texts[-1]
    flight.step(tuning=())
    flight.step(command(ARM, 1.0))
    assert flight.mode is not Mode.DISARMED


def test_a_soft_vehicle_is_warned_and_obeys() -> None:
    config = flight_config(body="points", soft=True)
    flight = Flight(load_scenario("walls"), config=config)
    flight.follow()
    outputs = flight.step(tuning=TOO_LITTLE_KEPT)
    assert outputs.tuning_taken is True
    assert any("pushes the base" in text.text for text in outputs.texts)


def test_what_is_broken_already_may_be_mended_in_steps() -> None:
    """Only an inequality that holds now can be broken: a change for the better is never refused."""
    config = flight_config(body="points", soft=True)
    flight = Flight(load_scenario("walls"), config=config)
    flight.follow()
    flight.step(tuning=TOO_LITTLE_KEPT)
    strict = TunedAutopilot(flight_config(body="points"))
    assert flight.inputs is not None
    _, outputs = strict.tick(
        flight.state, replace(flight.inputs, tuning=(("planner.walls.lambda_", 0.15),))
    )
    assert outputs.tuning_taken is True


@pytest.mark.long
def test_walls_are_kept_whatever_harmless_is_changed_in_flight() -> None:
    flight = Flight(load_scenario("walls"), seed=11)
    flight.follow()
    harmless: list[Tuning] = [
        (("planner.weights.tracking", 15.0), ("planner.weights.velocity", 3.0)),
        (("tuning.yaw.kp", 5.0), ("tuning.joint.kp", 450.0)),
        (("planner.walls.lambda_", 0.36), ("planner.limits.joint_acc", 8.0)),
        (("tuning.tracking.input_weight", 1.7e-7),),
        (("tuning.tracking.observer_bandwidth", 120.0),),
        (),
    ]
    for tuning in harmless:
        outputs = flight.step(tuning=tuning)
        assert outputs.tuning_taken is True
        flight.run(1.5)
    margins = flight.sim.result().margins_m
    assert min(margins.values()) > 0.0, margins
    assert flight.snapshot.counters.fallbacks == 0


@pytest.mark.long
@pytest.mark.parametrize("end", ["least", "most"])
def test_no_end_of_a_range_makes_a_tick_fail(end: str) -> None:
    """Not to be flown, but to be survived: one tick at each end of each range."""
    config = flight_config(body="points")
    flight = Flight(hover(), config=config)
    flight.step(command(ARM, 1.0))
    flight.step(command(SET_MODE, 1.0, 4.0, 3.0))
    assert flight.inputs is not None
    for parameter in PARAMETERS:
        value = getattr(parameter, end) * parameter.scale
        if contradictions(tuned(config, ((parameter.path, value),))):
            with pytest.raises(ValueError, match=parameter.name):
                flight.loop.prepare(((parameter.path, value),))
            continue
        flight.loop.prepare(((parameter.path, value),))
        inputs = replace(flight.inputs, tuning=((parameter.path, value),))
        state, outputs = flight.loop.tick(flight.state, inputs)
        assert outputs.tuning_taken is not None, parameter.name
        assert not state.output_replaced, parameter.name
