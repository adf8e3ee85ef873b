"""Blocks of a covariance along other axes, against the product of matrices."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.autopilot.estimation.error_state import ERRORS
from fsw.autopilot.estimation.turned_covariance import turned_covariance


@given(seed=st.integers(0, 2**32 - 1))
def test_both_vectors_are_turned_and_what_is_added_with_them(seed: int) -> None:
    random = np.random.default_rng(seed)
    root = random.normal(size=(ERRORS, ERRORS))
    covariance, more = root @ root.T, random.uniform(0.0, 2.0, 6)
    first, second = random.permutation([0, 3, 6, 9, 12])[:2].tolist()
    A, B = Rotation.random(2, random).as_matrix()
    kept = [first, first + 1, first + 2, second, second + 1, second + 2]
    turn = np.zeros((6, 6))
    turn[:3, :3], turn[3:, 3:] = A, B
    expected = turn @ (covariance[np.ix_(kept, kept)] + np.diag(more)) @ turn.T
    turns = tuple(A.ravel().tolist()), tuple(B.ravel().tolist())
    found = turned_covariance(covariance, (first, second), turns, tuple(more.tolist()))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
