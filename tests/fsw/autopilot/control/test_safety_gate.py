"""Nothing but finite values within limits ever leaves, and nothing while disarmed."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.control.safety_gate import gate, stopped
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.signals import ActuatorCommand

anything = st.floats(allow_nan=True, allow_infinity=True)
commands = st.builds(
    ActuatorCommand,
    rotor_thrust=st.tuples(*[anything] * 4),
    joint_torque=st.tuples(*[anything] * 2),
)
allowed = st.builds(
    ActuatorCommand,
    rotor_thrust=st.tuples(*[st.floats(0.0, AIRFRAME.weakest_thrust)] * 4),
    joint_torque=st.tuples(*[st.floats(-2.0, 2.0)] * 2),
)


@pytest.mark.requirement("REQ-ACT-7")
@given(commands, allowed, st.booleans())
def test_what_is_sent_is_finite_and_within_limits(
    wanted: ActuatorCommand, last: ActuatorCommand, armed: bool
) -> None:
    sent, _ = gate(AIRFRAME, wanted, last, armed)
    assert all(0.0 <= f <= AIRFRAME.weakest_thrust for f in sent.rotor_thrust)
    assert all(abs(t) <= AIRFRAME.joint_torque_max[0] for t in sent.joint_torque)


@pytest.mark.requirement("REQ-ACT-7")
@given(commands, allowed)
def test_disarmed_everything_stands_still(wanted: ActuatorCommand, last: ActuatorCommand) -> None:
    assert gate(AIRFRAME, wanted, last, armed=False) == (stopped(AIRFRAME), False)


@given(allowed, allowed)
def test_an_allowed_command_passes_unchanged(
    wanted: ActuatorCommand, last: ActuatorCommand
) -> None:
    assert gate(AIRFRAME, wanted, last, armed=True) == (wanted, False)


LAST = ActuatorCommand((1.0, 2.0, 3.0, 4.0), (0.1, 0.2))


@pytest.mark.requirement("REQ-ACT-7")
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(6))
def test_a_wish_that_is_no_number_repeats_the_last_and_is_reported(
    value: float, place: int
) -> None:
    values = [5.0, 5.0, 5.0, 5.0, 0.0, 0.0]
    values[place] = value
    f1, f2, f3, f4, t1, t2 = values
    wanted = ActuatorCommand((f1, f2, f3, f4), (t1, t2))
    assert gate(AIRFRAME, wanted, LAST, armed=True) == (LAST, True)


def test_opposite_infinities_do_not_cancel() -> None:
    wanted = ActuatorCommand((math.inf, -math.inf, 1.0, 1.0), (0.0, 0.0))
    assert gate(AIRFRAME, wanted, LAST, armed=True) == (LAST, True)
