r"""Gives Clarabel the dual of the planner's program, restricted to the rows that may be active.

An interior-point method pays for every unknown and every row in each iteration. A horizon has
30 to 120 inputs and a hundred rows or more, of which a few are active. So the inputs are
eliminated by one Cholesky factor of the Hessian, :math:`H = L L^T`, and only the rows of a
working set are kept. With :math:`U_0 = -H^{-1} c`, the optimum without any row, what is left is

.. math:: \min_z \tfrac12 z^T G H^{-1} G^T z + (b - G U_0)^T z, \quad z \ge 0,\;
          \sum_{i \in j} z_i \le \mathrm{penalty}_j

(z of a tilt cone in that cone), where the sum goes over the rows that share a slack: a slack
with a linear penalty is a bound on multipliers. Then :math:`U = U_0 - H^{-1} G^T z`. It is the
optimum of the whole if it satisfies the rows that were left out; this is checked after every
solve, and rows that are violated enter the working set and the program is solved again.

Source: docs/equations.md E17 and docs/decisions/0009; Boyd and Vandenberghe, Convex Optimization,
5.2 and 5.7.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf, dpotrs

from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.clarabel_solver import ClarabelSolver, QuadraticProgram, columns_of
from fsw.autopilot.mpc.qp_data import CONE, HARD, QpData, Solution
from fsw.autopilot.signals import SolverStatus

# Residual at the guess (m/s, rad, m/s^2) below which a row starts in the working set: the first
# always, the second if the optimum without any row violates it. Only speed depends on them.
_BINDS, _NEAR = 1e-3, 0.05
_TOLERANCE = 1e-6  # a left-out row may be missed by no more than the solver's own error
_SOLVES = 4  # after so many every row is in the working set
# Programs kept ready: so many, with so many entries of matrices, some 3 MB; a flight that is well
# needs half of both. Others are built when they occur: of a vehicle that is lost between walls each
# has a hundred rows, and 64 of them took 40 MB.
_PATTERNS, _ENTRIES = 64, 40_000
# Unknowns and costs of the order of one save the interior-point method a third of its iterations:
# multipliers are counted in a slack's penalty, and the cost so that its tolerance is fine enough.
_MULTIPLIER, _COST = 20.0, 0.25
_SPREAD = _MULTIPLIER / math.sqrt(_COST)


class DualSolver:
    """See ``QpSolver``; the optimum does not depend on the guess, which says where rows bind."""

    def __init__(self, program: QpData) -> None:
        self._program = program
        self._kept: dict[tuple[tuple[int, ...], int], _Multipliers] = {}  # used last comes last
        self._entries = 0  # of all that are kept

    def solve(self, guess: Array) -> Solution:
        """See ``QpSolver``; ``guess`` (inputs n,) [SI]."""
        program, rows = self._program, self._program.rows
        softened = np.zeros(len(program.penalty) + 1)  # by its slack, and 0 of rows without one
        factor, failed = dpotrf(program.hessian.T, lower=1, clean=0)
        if failed:
            return Solution(SolverStatus.NUMERICAL_ERROR, np.full(program.unknowns, np.nan), 0)
        inputs = free = -dpotrs(factor, program.linear, lower=1)[0]
        free_residual = rows.b - rows.g @ free
        distance = _distances(free_residual, rows.first_cone)
        at_guess = _distances(rows.b - rows.g @ guess, rows.first_cone)
        if distance.min() >= 0.0 and at_guess.min() >= _BINDS:
            return Solution(SolverStatus.SOLVED, np.concatenate((inputs, softened[:-1])), 0)
        # Comparisons are negated so that what is not a number counts as violated.
        working_set = ~((at_guess >= _NEAR) | (at_guess >= _BINDS) & (distance >= 0.0))
        status, iterations, solves = SolverStatus.SOLVED, 0, 0
        while True:
            chosen = np.flatnonzero(working_set)
            if len(chosen):
                # L^-1 G', scaled so that its square is the quadratic term.
                spread = dtrsm(_SPREAD, factor, rows.g[chosen].T, lower=1, overwrite_b=1)
                found = self._by_multipliers(chosen, spread, free_residual[chosen])
                status = found.status
                iterations += found.iterations
                if not found.usable:
                    break
                moved = spread @ (_MULTIPLIER / _SPREAD * found.x)
                inputs = free - dtrsv(factor, moved, lower=1, trans=1)
                residual = rows.b - rows.g @ inputs
                softened[:] = 0.0
                np.maximum.at(softened, rows.slack[chosen], -residual[chosen])
                softened[-1] = 0.0
                distance = _distances(residual, rows.first_cone) + softened[rows.slack]
            distance[chosen] = 0.0
            if distance.min() >= -_TOLERANCE:
                break
            solves += 1
            working_set |= ~(distance >= -_TOLERANCE) | (solves > _SOLVES)
        return Solution(status, np.concatenate((inputs, softened[:-1])), iterations)

    def _by_multipliers(self, chosen: NDArray[np.intp], spread: Array, residual: Array) -> Solution:
        """Multipliers of the chosen rows, counted in ``_MULTIPLIER``."""
        rows = self._program.rows
        slack = rows.slack[chosen[: chosen.searchsorted(rows.first_cone)]].tolist()
        softening = sorted(set(slack) - {HARD})
        number = {its: k for k, its in enumerate(softening)} | {HARD: HARD}
        same = self._multipliers(tuple([number[its] for its in slack]), len(chosen))
        return same.solve(spread.T @ spread, residual, self._program.penalty[softening])

    def _multipliers(self, slack: tuple[int, ...], size: int) -> _Multipliers:
        """The program of rows that share slacks in this way, kept or new."""
        found = self._kept.pop((slack, size), None)
        if found is None:
            found = _Multipliers(slack, size)
            self._entries += size * size
        self._kept[slack, size] = found
        while len(self._kept) > 1 and (self._entries > _ENTRIES or len(self._kept) > _PATTERNS):
            oldest = next(iter(self._kept))
            del self._kept[oldest]
            self._entries -= oldest[1] ** 2
        return found


def _distances(residual: Array, first_cone: int) -> Array:
    """``residual`` (rows,) [SI], where the three rows of a tilt cone have its distance."""
    distances = residual.copy()
    cones = distances[first_cone:].reshape(-1, CONE)
    cones[:] = (cones[:, 0] - np.hypot(cones[:, 1], cones[:, 2]))[:, None]
    return distances


class _Multipliers:
    """The dual program of rows that share slacks in one way, in Clarabel's form."""

    def __init__(self, slack: tuple[int, ...], size: int) -> None:
        """Lay it out for simple rows, each with the number of its slack or ``HARD``, and cones."""
        simple, slacks = len(slack), max(slack, default=HARD) + 1
        sums = np.zeros((slacks, size))
        sums[:, :simple] = np.arange(slacks)[:, None] == slack
        signs = -np.eye(size)
        upper = np.triu(np.ones((size, size)))
        self._upper = np.flatnonzero(upper.T)  # of the transpose, which is the same, row by row
        self._program = QuadraticProgram(
            p=columns_of(upper),
            q=np.zeros(size),
            a=columns_of(np.concatenate((signs[:simple], sums, signs[simple:]))),
            b=np.zeros(size + slacks),
            nonnegative_rows=simple + slacks,
            cones=(size - simple) // CONE,
        )
        self._penalty = self._program.b[simple : simple + slacks]
        self._solver = ClarabelSolver(self._program)

    def solve(self, gram: Array, residual: Array, penalty: Array) -> Solution:
        """Multipliers, simple rows before cones.

        ``gram`` (multipliers, multipliers) [SI] is G H^-1 G' as scaled by ``_SPREAD``, ``residual``
        (multipliers,) [SI] that at the optimum without any row, ``penalty`` (slacks,) [SI].
        """
        gram.take(self._upper, out=self._program.p.data)
        np.multiply(residual, _MULTIPLIER / _COST, out=self._program.q)
        np.divide(penalty, _MULTIPLIER, out=self._penalty)
        return self._solver.solve()
