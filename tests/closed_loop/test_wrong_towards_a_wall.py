"""An inertial unit that is wrong by little, in the direction that leads the vehicle into a wall."""

from __future__ import annotations

import pytest

from sitl.faults.keys import Fault
from studies.fault_matrix.flights import fly

in_long = pytest.mark.long
# Of the wrong gyro of the usual size of 0.3 rad/s about pitch.
LITTLE = (-0.3, -0.4, -0.5)


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("mode", "suite", "size", "seed"),
    [
        ("hold", "vio", -1.5, 0),
        *(
            pytest.param(mode, "vio", size, 2100 + seed, marks=in_long)
            for mode in ("hold", "mission", "offboard", "orbit", "land", "trajectory")
            for seed, size in enumerate((-1.1, -1.5, -2.2))
        ),
        *(
            pytest.param(mode, "rtk", size, 2200 + seed, marks=in_long)
            for mode in ("hold", "offboard")
            for seed, size in enumerate((-1.1, -1.3, -1.5))
        ),
    ],
)
def test_an_accelerometer_that_is_off_towards_a_wall_does_not_lead_into_it(
    mode: str, suite: str, size: float, seed: int
) -> None:
    """Innovations that lean one way say so before places have been compared for long enough."""
    flight = fly(mode, (Fault("accel", "wrong", axis=1.0, size=size),), suite, seed)
    assert flight.contact == "", flight.ended
    assert flight.warning is not None


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("mode", "size", "seed"),
    [
        ("hold", -0.5, 0),
        *(
            pytest.param(mode, size, 2300 + seed, marks=in_long)
            for mode in ("hold", "offboard")
            for seed, size in enumerate((*LITTLE, *LITTLE))
        ),
    ],
)
def test_a_gyro_that_tilts_towards_a_wall_with_satellites_does_not_lead_into_it(
    mode: str, size: float, seed: int
) -> None:
    """What it has tilted by the time that it is suspected is doubted as well as its bias."""
    flight = fly(mode, (Fault("gyro", "wrong", axis=2.0, size=size),), "rtk", seed)
    assert flight.contact == "", flight.ended
    assert flight.least_m is not None
    assert flight.least_m > 0.0
    assert flight.warning is not None
