"""The plant under the stand-in for PX4: lockstep, format, a hover."""

from __future__ import annotations

import socket
import time
from contextlib import closing

import numpy as np
import pytest

from command_line.process import StopRequest
from sitl.earth import DEFAULT_ORIGIN
from sitl.link.exchange import SimulatorError
from sitl.link.px4_messages import Px4Encoder
from sitl.link.px4_server import STALL_S, Px4Exchange, wait_for_px4
from sitl.scenario_file import load_scenario, scenario_names
from sitl.simulation import Simulation
from sitl.start import on_the_ground
from tests.px4_stand_in import Connected, Px4StandIn, Wish
from tests.sitl.px4_flight import fly, listening
from tests.sitl.test_px4_recordings import AIRFRAME
from tests.sitl.vehicles import PAPER

ODOMETRY, HIL_GPS, HIL_SENSOR, DISTANCE_SENSOR = 331, 113, 107, 132


def flight_plan(time_s: float) -> Wish:
    """Take off, hover, move the arm, land."""
    if not 0.5 < time_s < 14.0:
        return Wish()
    climbing = -max(min(0.5 * (time_s - 0.5), 1.5), 0.0)
    height = climbing if time_s < 9.5 else min(-1.5 + 0.4 * (time_s - 9.5), -0.2)
    return Wish(True, (0.0, 0.0, height), (0.5, -0.5) if time_s > 7.0 else (0.0, 0.0))


@pytest.mark.long
@pytest.mark.parametrize(("suite", "rate_hz"), [("mocap", 250), ("vio", 500)])
def test_the_plant_takes_off_hovers_moves_its_arm_and_lands(suite: str, rate_hz: int) -> None:
    flight = fly("ground", flight_plan, suite=suite, seconds=15.0, rate_hz=rate_hz)
    result = flight.simulation.result()
    assert result.end_reason == "flew 15.0 s"
    assert flight.exchange.answered_from is not None
    assert 10 <= flight.exchange.answered_from <= 60  # an answer may take longer than a step
    # Every step but the first ones is answered with its own stamp, and waited for.
    assert flight.stand_in.steps == 15 * rate_hz
    assert flight.stand_in.answered == flight.stand_in.steps - 10
    assert flight.exchange.counts.missed == flight.exchange.answered_from
    t = flight.times_s
    hovering = flight.places[(t > 5.5) & (t < 7.0)]
    assert hovering.mean(axis=0) == pytest.approx((0.0, 0.0, -1.5), abs=0.08)
    assert hovering.std(axis=0).max() < 0.02
    folded = flight.angles[(t > 8.5) & (t < 9.5)]
    assert np.degrees(folded.mean(axis=0)) == pytest.approx((30.0, -45.0), abs=0.5)
    assert flight.places[-1, 2] == pytest.approx(-0.318, abs=0.005)  # on its legs


@pytest.mark.long
def test_two_flights_with_the_same_answers_are_the_same() -> None:
    first, second = (fly("ground", flight_plan, seconds=2.0) for _ in range(2))
    assert np.array_equal(first.places, second.places)


def test_sensors_have_the_noise_of_the_suite_and_their_own_rates() -> None:
    flight = fly("ground", lambda _: Wish(), suite="gnss", seconds=4.0)
    updated = flight.stand_in.updated
    assert {ODOMETRY} & flight.stand_in.seen == set()
    assert flight.stand_in.seen >= {HIL_GPS, HIL_SENSOR, DISTANCE_SENSOR}
    assert all(one & 0x3F == 0x3F for one in updated)
    for bits in (0x1C0, 0x1A00):
        assert sum(one & bits == bits for one in updated) == pytest.approx(4 * 50, abs=3)


@pytest.mark.drawn(2)
@pytest.mark.parametrize("skipped", [0, 8, 14])
def test_steps_go_on_in_real_time_until_px4_answers(skipped: int) -> None:
    flight = fly("ground", lambda _: Wish(), seconds=0.5, skipped=skipped)
    assert flight.exchange.answered_from is not None
    assert skipped <= flight.exchange.answered_from <= skipped + 50
    assert flight.stand_in.answered == 125 - skipped


@pytest.mark.parametrize("name", [one for one in scenario_names() if "calm" not in one])
def test_every_scenario_can_begin_on_the_ground(name: str) -> None:
    scenario = on_the_ground(load_scenario(name, "mocap"))
    simulation = Simulation(scenario, 0)
    stands = Simulation(load_scenario("ground", "mocap", scenario.vehicle), 0).truth().p_WB[2]
    assert stands < -0.3
    assert simulation.truth().p_WB[2] == pytest.approx(stands, abs=0.003)
    assert simulation.ended is None


def test_a_px4_that_leaves_ends_the_run_with_the_step() -> None:
    stop = StopRequest()
    with listening() as (stream, port):
        peer = socket.create_connection(("127.0.0.1", port))
        assert wait_for_px4(stream, 5.0, stop)
        exchange = Px4Exchange(stream, PAPER, 0.004, stop)
        exchange.step(0, 1_000_000, b"", lambda: None)
        peer.close()
        with pytest.raises(SimulatorError, match="PX4 closed the connection at step 1"):
            exchange.step(1, 1_004_000, b"", lambda: None)


def test_a_px4_that_does_not_answer_any_more_ends_the_run(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sitl.link.px4_server.STALL_S", 0.3)
    stand_in, stop = Px4StandIn(AIRFRAME, skipped=0), StopRequest()
    with listening() as (stream, port):
        connected = Connected(stand_in, port)
        connected.start()
        assert wait_for_px4(stream, 5.0, stop)
        exchange = Px4Exchange(stream, PAPER, 0.004, stop)
        encoder = Px4Encoder(DEFAULT_ORIGIN)
        for step in range(500):  # the first ones are not waited for
            t_us = 1_000_000 + 4_000 * step
            if exchange.step(step, t_us, encoder.step(t_us, []), lambda: None) is not None:
                break
        begin = time.monotonic()
        # Without a HIL_SENSOR there is nothing to answer.
        with pytest.raises(SimulatorError, match=rf"not answer step {step + 1} within 0\.3 s"):
            exchange.step(step + 1, t_us + 4_000, b"", lambda: None)
        assert time.monotonic() - begin < 2.0
    assert STALL_S == 5.0


def test_only_the_first_client_is_served() -> None:
    with listening() as (stream, port), closing(socket.create_connection(("127.0.0.1", port))):
        assert wait_for_px4(stream, 5.0, StopRequest())
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.1", port))
        assert stream.connected
