"""What describes the vehicle is written once, in the airframe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fsw.model.airframe import AIRFRAME
from fsw.model.prediction import LagModel, discretise
from fsw.parameters.flight_config import flight_config


@given(st.floats(0.01, 0.2))
def test_the_planner_believes_in_the_airframe_that_flies(rotor_lag: float) -> None:
    airframe = replace(AIRFRAME, rotor_lag=rotor_lag, joint1_limit=0.5)
    config = replace(flight_config(), airframe=airframe)
    assert config.planner.airframe == airframe
    assert config.planner.lag == replace(LagModel(), rotor_lag=rotor_lag)
    # A vertical acceleration follows its command as the rotors do.
    a, _ = discretise(config.planner.lag, 0.1)
    assert np.isclose(a[8, 8], np.exp(-0.1 / rotor_lag))


def test_a_planner_with_a_vehicle_of_its_own_is_corrected() -> None:
    config = flight_config()
    other = replace(config.planner, airframe=replace(AIRFRAME, link_length=(0.1, 0.1)))
    assert replace(config, planner=other) == config


def test_the_papers_own_model_keeps_its_lack_of_lag() -> None:
    config = flight_config()
    printed = replace(config.planner, lag=LagModel(at_once=True))
    assert replace(config, planner=printed).planner.lag.at_once
