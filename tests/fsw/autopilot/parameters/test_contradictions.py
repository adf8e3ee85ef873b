"""Pairs of parameters that contradict each other are named, and refused before they fly."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.flight.tuned_autopilot import TunedAutopilot
from fsw.autopilot.parameters.contradictions import contradictions
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.tuning import tuned

CONFIG = flight_config(body="points")


def test_the_defaults_do_not_contradict_each_other() -> None:
    assert contradictions(FlightConfig()) == ()


@pytest.mark.requirement("REQ-ARM-7")
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"battery_low": 0.09}, "BAT_CRIT_THR 0.1 is to be below BAT_LOW_THR, 0.09"),
        ({"battery_low": 0.1}, "BAT_CRIT_THR 0.1 is to be below BAT_LOW_THR, 0.1"),
        ({"battery_emergency": 0.1}, "BAT_EMERGEN_THR 0.1 is to be below BAT_CRIT_THR, 0.1"),
        ({"position_low": 0.6}, "COM_POS_LOW_EPH 0.6 is to be at most COM_POS_FS_EPH, 0.5"),
        ({"takeoff_climb_most": 0.9}, "MIS_TAKEOFF_ALT 1 is to be at most TKO_CLIMB_MAX, 0.9"),
        ({"landed_height": 0.4}, "LND_HEIGHT 0.4 is to be at most LND_AIRBORNE, 0.3"),
    ],
)
def test_a_contradiction_is_a_sentence_with_both_names(
    changes: dict[str, float], words: str
) -> None:
    config = replace(CONFIG, limits=replace(CONFIG.limits, **changes))  # type: ignore[arg-type]
    assert contradictions(config) == (words,)
    tuning = tuple((f"limits.{name}", value) for name, value in changes.items())
    with pytest.raises(ValueError, match=words):
        TunedAutopilot(CONFIG).prepare(tuning)
    assert contradictions(replace(config, limits=replace(CONFIG.limits, position_low=0.5))) == ()


@pytest.mark.parametrize(
    ("track", "at_the_end", "refused"),
    [(200.0, 10.0, False), (201.0, 10.0, True), (1000.0, 50.0, False), (10.0, 0.1, True)],
)
def test_a_plan_whose_end_damps_too_little_is_refused(
    track: float, at_the_end: float, refused: bool
) -> None:
    """Flown: it swung at up to 4.8 m/s from 800 on, and at 16 m/s at 10 with no weight there."""
    wanted = (("PLN_W_TRACK", track), ("PLN_W_VEL_N", at_the_end))
    tuning = tuple((BY_NAME[name].path, value) for name, value in wanted)
    words = f"PLN_W_TRACK {track:g} is to be at most 20 times PLN_W_VEL_N, {at_the_end:g}"
    assert contradictions(tuned(CONFIG, tuning)) == ((words,) if refused else ())


@pytest.mark.requirement("REQ-ARM-7")
@pytest.mark.parametrize("name", ["FD_FAIL_R", "FD_FAIL_P"])
@pytest.mark.parametrize(
    ("degrees", "tilt", "refused"),
    [
        (5.0, 18.0, "is to be 0 or at least 15 deg above the 25 deg of the loops"),
        (39.0, 18.0, "is to be 0 or at least 15 deg above the 25 deg of the loops"),
        (44.0, 30.0, "is to be 0 or at least 15 deg above PLN_TILT_MAX, 30"),
        (40.0, 18.0, ""),
        (45.0, 30.0, ""),
        (60.0, 30.0, ""),
        (0.0, 30.0, ""),
    ],
)
def test_an_attitude_failure_that_a_usual_flight_reaches_is_refused_and_zero_is_none(
    name: str, degrees: float, tilt: float, refused: str
) -> None:
    wanted = ((BY_NAME[name], degrees), (BY_NAME["PLN_TILT_MAX"], tilt))
    tuning = tuple((one.path, value * one.scale) for one, value in wanted)
    found = contradictions(tuned(CONFIG, tuning))
    assert found == ((f"{name} {degrees:g} {refused}",) if refused else ())
    if refused:
        with pytest.raises(ValueError, match=refused):
            TunedAutopilot(CONFIG).prepare(tuning)
