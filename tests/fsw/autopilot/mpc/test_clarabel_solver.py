"""Clarabel on programs whose answers are known by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fsw.autopilot.mpc.clarabel_solver import (
    MAX_ITERATIONS,
    ClarabelSolver,
    QuadraticProgram,
    columns_of,
)
from fsw.autopilot.signals import SolverStatus


def program(wanted: tuple[float, float], bound: float, least: float = -9.0) -> QuadraticProgram:
    """The point (x, y) nearest to a wanted one with least <= x <= bound and |(x, y)| <= 5."""
    return QuadraticProgram(
        p=columns_of(np.diag([2.0, 2.0])),
        q=np.array([-2.0 * wanted[0], -2.0 * wanted[1]]),
        a=columns_of(np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0], [-1.0, 0.0], [0.0, -1.0]])),
        b=np.array([bound, -least, 5.0, 0.0, 0.0]),
        nonnegative_rows=2,
        cones=1,
    )


@pytest.mark.parametrize(
    ("wanted", "bound", "expected"),
    [
        ((1.0, -2.0), 3.0, (1.0, -2.0)),
        ((4.0, 1.0), 2.0, (2.0, 1.0)),
        ((-6.0, 8.0), 9.0, (-3.0, 4.0)),
    ],
)
def test_the_nearest_allowed_point_is_found_in_few_iterations(
    wanted: tuple[float, float], bound: float, expected: tuple[float, float]
) -> None:
    answer = ClarabelSolver(program(wanted, bound)).solve()
    assert answer.status is SolverStatus.SOLVED
    assert answer.x == pytest.approx(expected, abs=2e-3)
    assert 1 < answer.iterations <= 20 < MAX_ITERATIONS


def test_a_program_that_is_filled_anew_is_solved_anew() -> None:
    filled = program((4.0, 1.0), 2.0)
    solver = ClarabelSolver(filled)
    solver.solve()
    filled.q[:], filled.b[0] = (-2.0, 0.0), 0.5
    assert solver.solve().x == pytest.approx((0.5, 0.0), abs=1e-4)


def test_a_bound_that_was_infinite_may_be_set_later() -> None:
    filled = program((4.0, 1.0), math.inf)
    solver = ClarabelSolver(filled)
    filled.b[0] = 2.0
    assert solver.solve().x == pytest.approx((2.0, 1.0), abs=1e-4)


def test_a_contradiction_is_infeasible() -> None:
    answer = ClarabelSolver(program((0.0, 0.0), bound=-1.0, least=1.0)).solve()
    assert answer.status is SolverStatus.INFEASIBLE
    assert not answer.usable


def test_what_is_not_a_number_is_no_solution() -> None:
    filled = program((0.0, 0.0), 1.0)
    solver = ClarabelSolver(filled)
    filled.q[0] = math.nan
    answer = solver.solve()
    assert answer.status is SolverStatus.NUMERICAL_ERROR
    assert not answer.usable


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    ClarabelSolver(program((0.0, 0.0), 1.0)).solve()
    assert capfd.readouterr().out == ""
