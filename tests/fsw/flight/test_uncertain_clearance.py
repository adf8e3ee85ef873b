"""How far clearances grow."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsw.estimation.error_state import ERRORS, TH
from fsw.flight.uncertain_clearance import widened
from fsw.geometry.rotation import yaw_of
from fsw.shapes.half_space import wall
from fsw.signals import SafeSet, StateEstimate
from tests.fsw.random_states import mat3

LINKS = (0.15, 0.15)
NORTH, EAST = wall((-1.0, 0.0, 0.0), -5.0, 0.1), wall((0.0, -1.0, 0.0), -5.0, 0.2)


def vehicle() -> StateEstimate:
    """A vehicle at the origin, its arm straight ahead."""
    R = mat3(Rotation.identity())
    none = (0.0, 0.0, 0.0)
    return StateEstimate(1_000_000, none, none, R, none, yaw_of(R), (np.pi / 2, 0.0), (0.0, 0.0))


def test_each_clearance_grows_by_the_deviation_along_its_normal() -> None:
    P = np.zeros((ERRORS, ERRORS))
    P[0, 0], P[1, 1] = 0.01**2, 0.02**2
    found = widened(SafeSet((NORTH, EAST)), vehicle(), P, 3.0, LINKS)
    assert [zone.clearance for zone in found.zones] == pytest.approx([0.13, 0.26], abs=1.1e-3)
    assert [zone.shape for zone in found.zones] == [NORTH.shape, EAST.shape]


def test_an_unknown_heading_moves_the_end_effector_sideways() -> None:
    P = np.zeros((ERRORS, ERRORS))
    P[TH + 2, TH + 2] = 0.1**2
    found = widened(SafeSet((NORTH, EAST)), vehicle(), P, 2.0, LINKS)
    assert [zone.clearance for zone in found.zones] == pytest.approx([0.1, 0.26], abs=1.1e-3)


def test_a_place_that_is_lost_leaves_a_bounded_clearance() -> None:
    P = np.eye(ERRORS) * 1e6
    found = widened(SafeSet((NORTH,)), vehicle(), P, 3.0, LINKS)
    assert found.zones[0].clearance == pytest.approx(0.6)


def test_what_is_less_than_a_step_is_the_same_safe_set() -> None:
    P = np.zeros((ERRORS, ERRORS))
    P[0, 0] = 1e-4**2
    first = widened(SafeSet((NORTH,)), vehicle(), P, 3.0, LINKS)
    assert first == widened(SafeSet((NORTH,)), vehicle(), 2.0 * P, 3.0, LINKS)
