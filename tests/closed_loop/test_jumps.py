"""Places that jump and stay, or again and again, beside a wall that nobody is to touch."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.measurements import PoseSample, Sample
from sitl.faults.keys import Fault
from sitl.scenario_file import parse_scenario
from studies.fault_matrix.flights import beside_the_wall_text, fly
from tests.closed_loop.harness import ARM, Flight, command

BEGIN = 4.0  # s
WAY = 0.3  # m, that a vehicle in Hold may be moved by what it is uncertain of
USED = 0.03  # m of 0.1 m of clearance
JUMPS = [
    (mode, suite, size)
    for mode in ("hold", "offboard", "mission", "trajectory")
    for suite in ("mocap", "vio", "rtk")
    for size in (-0.25, -0.6, -1.0, -1.4)  # with the place of satellites goes their velocity
]


@pytest.mark.requirement("REQ-EST-10")
@pytest.mark.parametrize(
    ("mode", "suite", "size"),
    [
        ("hold", "mocap", -0.8),
        *(pytest.param(*one, marks=pytest.mark.long) for one in JUMPS),
    ],
)
def test_a_place_that_jumps_away_from_a_wall_does_not_lead_into_it(
    mode: str, suite: str, size: float
) -> None:
    """It flew there at 0.75 m/s: the estimate had moved, and where it held had not."""
    fault = Fault("gps" if suite == "rtk" else "vio", "wrong", axis=1.0, size=size)
    flight = fly(mode, (fault,), suite, 42)
    assert flight.contact == "", flight.ended
    assert flight.least_m is not None
    assert flight.least_m > -USED
    if (mode, suite) == ("hold", "mocap"):
        assert flight.away_m is not None
        assert flight.away_m < WAY


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-4", "REQ-EST-10")
@pytest.mark.parametrize(
    ("suite", "step", "every"),
    # Of odometry smaller steps are within its noise: the safety manual has them.
    [("mocap", 0.06, 1.0), ("vio", 0.08, 1.0)]
    + [(suite, *one) for suite in ("mocap", "vio") for one in ((0.12, 0.8), (0.3, 1.5))],
)
@pytest.mark.parametrize("seed", [51, 52])
def test_a_place_that_jumps_again_and_again_is_told_and_does_not_lead_into_a_wall(
    suite: str, step: float, every: float, seed: int
) -> None:
    def moved(samples: tuple[Sample, ...]) -> tuple[Sample, ...]:
        return tuple([lower(one) if isinstance(one, PoseSample) else one for one in samples])

    def lower(pose: PoseSample) -> PoseSample:
        x, y, z = pose.position
        steps = max(int((pose.time - first - BEGIN) / every), 0)
        return replace(pose, position=(x - step * steps, y, z))

    scenario = parse_scenario(beside_the_wall_text("airborne", "none"), "wall", suite)
    flight = Flight(scenario, seed=seed, spoil_samples=moved)
    first = 1e-6 * flight.sim.t_us
    flight.step(command(ARM, 1.0, 21196.0))
    flight.run(BEGIN + 12.0)
    assert flight.sim.ended is None, flight.sim.ended
    assert any(text.startswith("failsafe: position uncertain") for text in flight.texts)
