"""The PID loop by its symptoms."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.control.pid import PidGains, pid_step

GAINS = PidGains(kp=2.0, ki=1.0, kd=0.5, limit=1.0)
DT = 0.01


def test_saturated_output_leaves_the_limit_as_soon_as_the_error_flips() -> None:
    integral = 0.0
    for _ in range(1000):
        output, integral = pid_step(GAINS, integral, 5.0, 0.0, DT)
    assert output == GAINS.limit
    output, _ = pid_step(GAINS, integral, -0.1, 0.0, DT)
    assert output < GAINS.limit


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_each_term_acts_with_the_sign_of_its_error(sign: float) -> None:
    assert pid_step(PidGains(1.0, 0.0, 0.0, 9.0), 0.0, sign, 0.0, DT)[0] == sign
    assert sign * pid_step(PidGains(0.0, 1.0, 0.0, 9.0), 0.0, sign, 0.0, DT)[0] > 0.0
    assert pid_step(PidGains(0.0, 0.0, 1.0, 9.0), 0.0, 0.0, sign, DT)[0] == sign


def test_the_integral_removes_a_constant_load() -> None:
    """A first-order plant under a constant push settles on its reference."""
    position, integral = 0.0, 0.0
    for _ in range(5000):
        output, integral = pid_step(GAINS, integral, 0.2 - position, 0.0, DT)
        position += DT * (output - 0.3)
    assert position == pytest.approx(0.2, abs=1e-3)


def test_a_long_saturation_is_not_paid_back_by_an_overshoot() -> None:
    position, integral, highest = 0.0, 0.0, 0.0
    for _ in range(5000):
        output, integral = pid_step(GAINS, integral, 3.0 - position, 0.0, DT)
        position += DT * output
        highest = max(highest, position)
    # The same plant started next to its reference, never saturated, overshoots as well.
    small, integral, least = 2.9, 0.0, 0.0
    for _ in range(5000):
        output, integral = pid_step(GAINS, integral, 3.0 - small, 0.0, DT)
        small += DT * output
        least = max(least, small)
    assert highest - 3.0 < 0.15
    assert least > 3.0


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_output_never_leaves_its_limit(integral: float, error: float, rate: float) -> None:
    assert abs(pid_step(GAINS, integral, error, rate, DT)[0]) <= GAINS.limit


@pytest.mark.parametrize("error", [1e-3, -1e-3, 0.3, -0.3])
@pytest.mark.parametrize("rate", [10.0, -10.0])
def test_while_saturated_only_an_error_that_pulls_back_is_integrated(
    error: float, rate: float
) -> None:
    """The rate alone saturates the output; however small the error, its sign decides."""
    output, integral = pid_step(GAINS, 0.25, error, rate, DT)
    assert output == (GAINS.limit if rate > 0.0 else -GAINS.limit)
    pulls_back = error * rate < 0.0
    assert integral == (pytest.approx(0.25 + error * DT) if pulls_back else 0.25)
