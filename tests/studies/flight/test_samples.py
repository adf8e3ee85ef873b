"""Samples without a link are those that the link hands over, but for its digits."""

from __future__ import annotations

import dataclasses

import pytest

from fsw.autopilot.measurements import GnssSample, RangeSample, Sample
from fsw.link.inbox import Inbox
from fsw.link.wire.decode_sensors import SampleDecoder
from messages.frames import split
from sitl.link.encode import StepEncoder
from sitl.scenario_file import load_scenario
from sitl.simulation import Controls, Simulation
from studies.flight.samples import sample


def numbers(one: Sample) -> list[float]:
    """Every number of a sample."""
    found: list[float] = []
    for value in dataclasses.astuple(one):
        found += value if isinstance(value, tuple) else [value]
    return found


@pytest.mark.parametrize("suite", ["mocap", "vio", "rtk", "gnss"])
def test_the_link_and_the_studies_make_the_same_samples(suite: str) -> None:
    simulation = Simulation(load_scenario("walls", suite), 1)
    encoder = StepEncoder(lockstep=True, measured=True)
    decoder = SampleDecoder(Inbox().locate, 2)
    kinds = set()
    for _ in range(150):
        said = simulation.measurements()
        assert said is not None
        ahead, step = encoder.measured_datagrams(simulation.t_us, said, ())
        frames = [frame for datagram in (*ahead, step) for frame in split(datagram)]
        received = decoder.samples(frames)
        direct = [sample(one) for one in said]
        assert len(received) == len(direct)
        for one in direct:
            same = (k for k in received if type(k) is type(one))
            other = next(k for k in same if k.time == pytest.approx(one.time))
            coarse = isinstance(one, GnssSample | RangeSample)
            # A centimetre, and variances in whole centimetres.
            assert numbers(other) == pytest.approx(numbers(one), abs=0.09 if coarse else 0.02)
            kinds.add(type(one))
        simulation.advance(Controls((0.5, 0.5, 0.5, 0.5), (0.0, 0.0), armed=True))
    assert len(kinds) >= 3
