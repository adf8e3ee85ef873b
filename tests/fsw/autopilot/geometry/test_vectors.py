"""Vector arithmetic, against NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.geometry.vectors import (
    add_scaled,
    clamp,
    clamp_magnitude,
    dot,
    limit_norm,
    norm,
    subtract,
)

_numbers = st.floats(-1e3, 1e3)
_vectors = st.tuples(_numbers, _numbers, _numbers)


@given(_vectors, _vectors, _numbers)
def test_arithmetic_agrees_with_numpy(a, b, scale):
    assert dot(a, b) == pytest.approx(float(np.dot(a, b)), abs=1e-8)
    assert add_scaled(a, b, scale) == pytest.approx(tuple(np.array(a) + scale * np.array(b)))
    assert subtract(a, b) == pytest.approx(tuple(np.array(a) - np.array(b)))
    assert norm(a) == pytest.approx(float(np.linalg.norm(a)))


@given(_vectors, st.floats(0.1, 100.0))
def test_a_limited_vector_keeps_its_direction(a, most):
    limited = limit_norm(a, most)
    assert norm(limited) == pytest.approx(min(norm(a), most))
    assert dot(a, limited) == pytest.approx(norm(a) * norm(limited), abs=1e-9)


@pytest.mark.parametrize(
    ("value", "expected"), [(-3.0, -1.0), (-0.5, -0.5), (0.0, 0.0), (1.5, 1.5), (3.0, 2.0)]
)
def test_clamp_keeps_both_bounds(value, expected):
    assert clamp(value, -1.0, 2.0) == expected


@pytest.mark.parametrize(("value", "expected"), [(-3.0, -2.0), (-0.5, -0.5), (3.0, 2.0)])
def test_a_magnitude_is_limited_on_both_sides(value, expected):
    assert clamp_magnitude(value, 2.0) == expected
    assert math.copysign(1.0, clamp_magnitude(value, 2.0)) == math.copysign(1.0, value)
