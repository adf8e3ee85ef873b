"""Which readings of the inertial unit are believed, each half for itself."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from fsw.autopilot.estimation.error_state import (
    FILTER,
    FORCE,
    FORCE_MADE,
    LOST,
    MISSED,
    MODELLED,
    NO_FORCE,
    NO_RATE,
    NOTHING,
    RATE,
    RATE_MADE,
    mean_of,
)
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.estimation.imu import BLOW, STAYS, STAYS_LONG, add_imu
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.signals import Vec3, Vec4
from fsw.compiled import packed

LAW = packed(EstimatorTuning()).view(np.recarray)[0]
TICK = 0.002


class Unit:
    """Readings of one unit on their way into a filter."""

    def __init__(self) -> None:
        self.x: Any = np.zeros(1, FILTER).view(np.recarray)[0]
        self.random = np.random.default_rng(1)
        self.now = 1.0
        for _ in range(300):
            self.read()

    def read(
        self,
        force: Vec3 | None = None,
        rate: Vec3 | None = None,
        model: Vec4 = (0.0, 0.0, 0.0, 0.0),
    ) -> SensorFault:
        """A noisy reading, or what is said in place of it; what is wrong with it."""
        self.now += TICK
        f = (0.0, 0.0, -9.81) + 0.3 * self.random.standard_normal(3)
        w = 0.01 * self.random.standard_normal(3)
        said = tuple(f.tolist()) if force is None else force
        turning = tuple(w.tolist()) if rate is None else rate
        return SensorFault(add_imu(self.x, LAW, self.now, self.now, said, turning, model))  # type: ignore[arg-type]

    @property
    def last(self) -> Any:
        return self.x.imu[(self.x.end - 1) % len(self.x.imu)]


def test_half_a_unit_that_repeats_itself_is_lost_alone() -> None:
    for half, said in (
        (NO_RATE, {"rate": (0.1, 0.0, 0.0)}),
        (NO_FORCE, {"force": (1.0, 0.0, -9.0)}),
    ):
        unit = Unit()
        faults = [unit.read(**said) for _ in range(8)]  # type: ignore[arg-type]
        assert faults[:5] == [SensorFault.NONE] * 5
        assert faults[5:] == [SensorFault.STUCK] * 3
        assert unit.last[LOST] == half
        assert unit.read() is SensorFault.NONE
        assert unit.last[LOST] == 0


def test_one_axis_that_repeats_itself_is_told_and_rest_on_a_grid_is_not() -> None:
    """With an axis of the accelerometer stuck a vehicle with satellites flew into a wall."""
    for half, axis in ((NO_RATE, 1), (NO_FORCE, 0)):
        unit = Unit()
        for _ in range(51):
            noisy = 0.05 * unit.random.standard_normal(3)
            noisy[axis] = 0.2
            said = {("rate" if half == NO_RATE else "force"): tuple(noisy.tolist())}
            fault = unit.read(**said)
        assert fault is SensorFault.STUCK
        assert unit.last[LOST] == half
    unit = Unit()
    for _ in range(3000):
        on_grid = tuple((1e-3 * np.rint(unit.random.standard_normal(3))).tolist())
        assert unit.read(rate=on_grid) is SensorFault.NONE


def test_garbage_is_never_believed_again_and_the_other_half_is() -> None:
    for size, at, half in ((50.0, FORCE, NO_FORCE), (10.0, RATE, NO_RATE)):
        unit = Unit()
        believed = 0
        for _ in range(500):
            said: Vec3 = tuple(unit.random.uniform(-size, size, 3).tolist())  # type: ignore[assignment]
            fault = unit.read(force=said) if half == NO_FORCE else unit.read(rate=said)
            believed += fault is SensorFault.NONE
            assert unit.last[LOST] in (0.0, half)
        assert believed <= 5, "before it was found"
        held = unit.last[at : at + 3].copy()
        unit.read(**{"force" if half == NO_FORCE else "rate": (-size, size, -size)})  # type: ignore[arg-type]
        np.testing.assert_array_equal(unit.last[at : at + 3], held)


def test_a_jump_is_believed_when_it_is_back_or_stays_and_the_next_one_must_stay_longer() -> None:
    unit, far = Unit(), (0.0, 8.0, 0.0)
    assert unit.read(rate=far) is SensorFault.JUMP
    assert unit.read() is SensorFault.NONE, "back"

    def stays() -> int:
        """How many readings it takes."""
        for count in range(1, 100):
            noise = 0.01 * unit.random.standard_normal(3)
            said: Vec3 = tuple((far + noise).tolist())  # type: ignore[assignment]
            if unit.read(rate=said) is SensorFault.NONE:
                return count
        return 0

    assert stays() == STAYS_LONG + 1
    unit = Unit()
    assert stays() == STAYS + 1


@pytest.mark.parametrize(
    ("at", "size"), [(0, 40.0), (1, 10.0), (0, 1e300), (1, -1e300)], ids=["force", "rate", "", "-"]
)
def test_what_is_refused_of_a_blow_may_have_moved_the_vehicle_by_its_integral(
    at: int, size: float
) -> None:
    unit, added = Unit(), []
    believed = unit.last[FORCE + 3 * at]
    shown = math.copysign(min(abs(size), (LAW.accel_range, LAW.gyro_range)[at]), size)
    for count in range(1, BLOW + 10):
        said = (size * (-1) ** count, 0.0, -9.81 if at == 0 else 0.0)
        unit.read(**{("force", "rate")[at]: said})  # type: ignore[arg-type]
        added.append(unit.last[MISSED + at])
        assert unit.last[MISSED + 1 - at] == 0.0
    one = TICK * (-shown - believed)
    assert added[0] == pytest.approx(one * one, rel=1e-3), "and the noise of other axes"
    assert added[1] == 0.0, "it may as well have come back"
    assert max(added[BLOW:]) == 0.0, "what lasts is no blow"
    unit = Unit()
    for _ in range(2):
        said = (size, 0.0, -9.81 if at == 0 else 0.0)
        unit.read(**{("force", "rate")[at]: said})  # type: ignore[arg-type]
    twice = 2.0 * TICK * (shown - unit.last[FORCE + 3 * at])
    assert unit.x.missed[3 * at] == pytest.approx(twice, rel=1e-6)
    unit.read()
    assert not unit.x.missed.any(), "over"
    assert unit.last[MISSED + at] == 0.0


def test_what_is_no_number_loses_its_half_alone() -> None:
    unit = Unit()
    assert unit.read(force=(float("nan"), 0.0, 0.0)) is SensorFault.NOT_FINITE
    assert unit.last[LOST] == NO_FORCE
    assert (
        unit.read(force=(0.0, 0.0, float("inf")), rate=(0.0, 99.0, 0.0)) is SensorFault.NOT_FINITE
    )
    assert unit.last[LOST] == NOTHING
    assert np.isfinite(unit.x.imu).all()


def test_a_model_stands_in_for_the_half_that_is_lost_alone() -> None:
    unit, none, model = Unit(), (float("nan"),) * 3, (3.0, -4.0, 0.5, 9.5)
    before = unit.last.copy()
    assert unit.read(rate=none, model=model) is SensorFault.NOT_FINITE
    assert unit.last[LOST] == NO_RATE + MODELLED + RATE_MADE
    expected = before[RATE : RATE + 3] + TICK * np.array([3.0, -4.0, 0.5])
    np.testing.assert_allclose(unit.last[RATE : RATE + 3], expected, rtol=0.0, atol=1e-15)
    assert unit.last[FORCE + 2] != -9.5, "the accelerometer is believed"
    unit.read(force=none, model=model)
    np.testing.assert_array_equal(unit.last[FORCE : FORCE + 3], (0.0, 0.0, -9.5))
    held = unit.last[FORCE : FORCE + 3].copy()
    unit.read(force=none)
    assert unit.last[LOST] == NO_FORCE, "nothing is known of the rotors"
    np.testing.assert_array_equal(unit.last[FORCE : FORCE + 3], held)
    assert unit.read(model=model) is SensorFault.NONE
    assert unit.last[LOST] == 0


FLIES: Vec4 = (0.0, 0.0, 0.0, 9.81)


@pytest.mark.parametrize("known", [False, True])
def test_a_modelled_force_is_what_the_rotors_give_and_leaves_the_mass_as_it_is(known: bool) -> None:
    """The mass goes by the force: with what was felt beside the rotors it ran away, blind."""
    unit = Unit()
    unit.x.baseline[6:9] = 0.3, -0.2, 0.15
    unit.x.bias[:3] = 0.05, -0.04, 0.02
    if known:  # the filter has come to the loss, and what it calls a bias is the model's error
        unit.x.kept_bias[:3], unit.x.lost = unit.x.bias[:3], NO_FORCE
        unit.x.bias[2] = 0.5
    unit.read(force=(float("nan"),) * 3, model=(0.0, 0.0, 0.0, 9.5))
    np.testing.assert_array_equal(unit.last[FORCE : FORCE + 2], (0.3, -0.2))
    assert unit.last[FORCE + 2] == pytest.approx(0.02 - 9.5)


def test_a_rate_that_rotors_made_leaves_no_bias_behind() -> None:
    """It ran away by 31 rad/s, and what the filter had found of it was left as legs touched."""
    unit, none, model = Unit(), (float("nan"),) * 3, (40.0, 0.0, 0.0, 9.5)
    for _ in range(300):
        unit.read(rate=none, model=model)
    unit.x.bias[3:] = unit.last[RATE : RATE + 3]  # poses say that it does not turn
    before = [row.copy() for row in unit.x.imu]
    assert abs(unit.x.bias[3]) > 20.0
    unit.x.out = NO_RATE
    for _ in range(STAYS + 1):  # on the ground: of one that is named the reading is used
        unit.read(rate=(-0.4 + 0.01 * unit.random.standard_normal(), 0.0, 0.0))
    assert unit.last[LOST] == NO_RATE
    np.testing.assert_allclose(unit.x.bias[3:], (-0.4, 0.0, 0.0), atol=0.05)
    rates = np.array([row[RATE : RATE + 3] for row in unit.x.imu])
    was = np.array([row[RATE : RATE + 3] for row in before])
    new = [k % len(rates) for k in range(unit.x.end - STAYS - 1, unit.x.end)]
    moved = np.delete(rates - was, new, axis=0)
    np.testing.assert_allclose(moved - moved[0], 0.0, atol=1e-9, err_msg="all of them alike")
    assert abs(moved[0, 0]) > 20.0
    unit.read(rate=none)
    assert not int(unit.last[LOST]) & RATE_MADE, "held, of one that was read"


@pytest.mark.requirement("REQ-EST-7")
@pytest.mark.parametrize("blow", [4.0, -3.0])
def test_a_rate_that_is_read_again_counts_from_its_own_zero_at_once(blow: float) -> None:
    """It counted from that of the rotors' until the filter came to it, which took the delay of vio.

    By then a blow of 4 rad/s, believed in time, had turned the vehicle over.
    """
    unit, none, model = Unit(), (float("nan"),) * 3, (300.0, 0.0, 0.0, 9.5)
    x = unit.x
    x.bias[3] = x.kept_bias[3] = 0.02
    for _ in range(5):
        unit.read(rate=none, model=model)
    made = unit.last[RATE]
    x.lost, x.bias[3] = NO_RATE, 0.5 * made  # the filter has come to the loss
    unit.read(rate=(blow, 0.0, 0.0))  # on the ground what stays is believed
    while unit.last[LOST]:
        unit.read(rate=(blow + 0.01 * unit.random.standard_normal(), 0.0, 0.0))
    before = x.imu[(x.end - 2) % len(x.imu)]
    assert int(before[LOST]) & NO_RATE
    _, (rate, _, _) = mean_of(x, unit.last, before)
    assert rate == pytest.approx(blow - 0.02, abs=0.05)
    assert x.bias[3] == 0.5 * made
    _, (rate, _, _) = mean_of(x, before, before)
    assert rate == pytest.approx(before[RATE] - 0.5 * made), "rotors' rates keep theirs"


@pytest.mark.parametrize(("half", "at", "size"), [(NO_FORCE, FORCE, 40.0), (NO_RATE, RATE, 8.0)])
def test_what_stays_where_it_jumped_to_in_flight_is_believed_when_others_say_so(
    half: int, at: int, size: float
) -> None:
    def said() -> Vec3:
        middle = (size, 0.0, -9.81) if half == NO_FORCE else (size, 0.0, 0.0)
        reading: Vec3 = tuple((middle + 0.01 * unit.random.standard_normal(3)).tolist())  # type: ignore[assignment]
        return reading

    name = "force" if half == NO_FORCE else "rate"
    unit = Unit()
    for _ in range(200):
        assert unit.read(**{name: said()}, model=FLIES) is SensorFault.JUMP  # type: ignore[arg-type]
    made = FORCE_MADE if half == NO_FORCE else RATE_MADE
    assert unit.last[LOST] == half | MODELLED | made
    unit.x.believed = half
    assert unit.read(**{name: said()}, model=FLIES) is SensorFault.NONE  # type: ignore[arg-type]
    unit.x.believed = 0
    assert unit.read(**{name: said()}, model=FLIES) is SensorFault.NONE, "and goes on"  # type: ignore[arg-type]
    assert unit.last[at] == pytest.approx(size, abs=0.1)


@pytest.mark.parametrize(("half", "size"), [(NO_FORCE, 50.0), (NO_RATE, 10.0)])
def test_garbage_in_flight_is_not_believed_because_rotors_are_to_blame(
    half: int, size: float
) -> None:
    """Beside a rotor that had failed each of its jumps was, and the estimate ran away."""
    unit, believed = Unit(), 0
    unit.x.believed = NOTHING
    for _ in range(500):
        said: Vec3 = tuple(unit.random.uniform(-size, size, 3).tolist())  # type: ignore[assignment]
        name = "force" if half == NO_FORCE else "rate"
        believed += unit.read(**{name: said}, model=FLIES) is SensorFault.NONE  # type: ignore[arg-type]
    assert believed <= 5, "before it was found"


@pytest.mark.parametrize(("half", "at"), [(NO_FORCE, FORCE), (NO_RATE, RATE)])
def test_a_half_that_is_out_is_replaced_and_of_a_suspect_only_the_bias_is_unknown(
    half: int, at: int
) -> None:
    unit = Unit()
    unit.x.suspect = half
    assert unit.read(force=(1.0, 2.0, -9.0), rate=(0.1, 0.2, 0.3), model=FLIES) is SensorFault.NONE
    assert unit.last[LOST] == half | MODELLED
    np.testing.assert_array_equal(unit.last[FORCE : FORCE + 6], (1.0, 2.0, -9.0, 0.1, 0.2, 0.3))
    unit.x.suspect, unit.x.out = 0, half
    unit.read(force=(3.0, 2.0, -9.0), rate=(0.3, 0.2, 0.3), model=FLIES)
    assert unit.last[LOST] == half | MODELLED | (FORCE_MADE if half == NO_FORCE else RATE_MADE)
    assert unit.last[at] != (3.0 if half == NO_FORCE else 0.3)
    other = FORCE if half == NO_RATE else RATE
    assert unit.last[other] == (3.0 if half == NO_RATE else 0.3), "the other half is used"


@pytest.mark.parametrize("half", [NO_FORCE, NO_RATE])
def test_where_the_ground_is_felt_a_suspect_s_bias_walks_no_faster_than_in_flight(
    half: int,
) -> None:
    """As that of a half of no use, it made the attitude unknown, and a landing a termination."""
    unit = Unit()
    unit.x.suspect = half
    unit.read()
    assert unit.last[LOST] == half | MODELLED
    unit.x.suspect, unit.x.out = 0, half
    unit.read()
    assert unit.last[LOST] == half
