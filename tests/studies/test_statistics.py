"""Wilson's interval against its definition and known values."""

from __future__ import annotations

import math

import pytest

from studies.statistics import wilson


@pytest.mark.parametrize(("passed", "total"), [(0, 20), (7, 20), (20, 20), (1, 1)])
def test_both_ends_solve_the_score_equation(passed: int, total: int) -> None:
    # |share - p| = z sqrt(p (1 - p) / n) is what the interval is the solution of.
    share = passed / total
    for p in wilson(passed, total):
        if 0.0 < p < 1.0:
            assert math.isclose(
                abs(share - p), 1.959963984540054 * math.sqrt(p * (1.0 - p) / total), rel_tol=1e-9
            )


def test_twenty_of_twenty_is_not_certainty() -> None:
    low, high = wilson(20, 20)
    assert 0.83 < low < 0.85
    assert high == 1.0


@pytest.mark.parametrize(("passed", "total"), [(0, 0), (3, 2), (-1, 5)])
def test_what_is_no_count_is_refused(passed: int, total: int) -> None:
    with pytest.raises(ValueError, match="not a valid count"):
        wilson(passed, total)
