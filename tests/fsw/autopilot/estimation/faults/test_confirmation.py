"""How long refused measurements must agree until they are believed."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.estimation.faults.confirmation import Run
from fsw.autopilot.measurements import PoseSample

LEAST = 0.5  # s


def run(place: float, turn: float, lasted: float, samples: int = 9) -> Run:
    """Poses off along north and about it."""
    return Run(PoseSample, 10.0, 10.0 + lasted, (place, 0.0, 0.0, turn, 0.0, 0.0), samples)


@given(
    place=st.floats(-20.0, 20.0),
    turn=st.floats(-3.0, 3.0),
    lasted=st.floats(0.0, 30.0),
    announced=st.booleans(),
)
def test_a_run_lasts_for_longer_the_more_it_would_move(
    place: float, turn: float, lasted: float, announced: bool
) -> None:
    believed = run(place, turn, lasted).is_believable(LEAST, announced=announced)
    small = abs(place) <= 0.5 and abs(turn) <= 0.2
    needs = max(abs(place), abs(turn) / 0.3)
    if announced and small:
        assert believed
    elif abs(lasted - needs) > 1e-6 and abs(lasted - LEAST) > 1e-6:
        assert believed == (lasted > needs and (announced or lasted > LEAST))


def test_one_sample_is_never_a_run() -> None:
    assert not run(0.1, 0.0, 0.0, samples=1).is_believable(0.0, announced=True)


@given(jump=st.floats(-20.0, 20.0), left=st.floats(-3.0, 3.0), lasted=st.floats(0.0, 30.0))
def test_a_jump_is_undone_as_fast_as_what_is_left_of_it(
    jump: float, left: float, lasted: float
) -> None:
    """What was believed wrongly must not be held on to for a second a metre."""
    back = run(left - jump, 0.0, lasted)
    needs = max(LEAST, min(abs(left), abs(left - jump)))
    if abs(lasted - needs) > 1e-6:
        assert back.is_believable(LEAST, jumped=(jump, 0.0, 0.0)) == (lasted > needs)
    aside = (0.0, abs(jump), 0.0)  # nothing of this one is undone
    assert back.is_believable(LEAST, jumped=aside) == back.is_believable(LEAST)
