"""The arm of ``paper`` in numbers of the tests' own, and how many its states and inputs are."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from fsw.autopilot.model.airframe import AIRFRAME, Airframe
from fsw.autopilot.model.prediction import inputs_of, states_of

JOINTS: Final = 2
LENGTHS: Final = (0.15, 0.15)  # m, of the links
LIMIT1, LIMIT12 = math.pi / 3.0, math.pi / 2.0  # rad, of joint 1 and of both joints' sum
STATES: Final = states_of(JOINTS)
INPUTS: Final = inputs_of(JOINTS)


def with_angle_limits(first: float, both: float) -> Airframe:
    """The airframe of paper with other limits of joint 1 and of both joints' sum [rad]."""
    pairs = zip(AIRFRAME.angle_limits, (first, both), strict=True)
    limits = [replace(limit, low=-most, high=most) for limit, most in pairs]
    return replace(AIRFRAME, angle_limits=tuple(limits))
