"""The same flight twice is the same flight, tick by tick."""

from __future__ import annotations

import copy

import pytest

from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import Flight


def flown(seed: int) -> Flight:
    flight = Flight(load_scenario("walls"), seed=seed)
    flight.follow()
    flight.run(2.0)
    return flight


def test_the_same_seed_gives_the_same_actuators_to_the_bit() -> None:
    one, two, other = flown(11), flown(11), flown(12)
    assert one.sent == two.sent
    assert one.sim.truth() == two.sim.truth()
    assert one.sent != other.sent


@pytest.mark.requirement("REQ-TIME-8")
def test_a_tick_depends_on_nothing_but_its_arguments_and_changes_neither() -> None:
    flight = Flight(load_scenario("workspace"), seed=3)
    flight.follow()
    for _ in range(120):
        before = flight.state
        copied = copy.deepcopy(before)
        flight.step()
        assert flight.inputs is not None
        again = flight.loop.tick(before, flight.inputs)
        assert again == (flight.state, flight.outputs)
        assert before == copied


def test_another_loop_continues_where_the_first_stopped() -> None:
    """All memory is in the state: a loop built anew flies on without a seam."""
    whole, split = flown(5), Flight(load_scenario("walls"), seed=5)
    split.follow()
    split.run(1.0)
    split.loop = type(split.loop)(split.config)
    split.run(1.0)
    assert whole.sent == split.sent
