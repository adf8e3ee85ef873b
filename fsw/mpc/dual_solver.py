r"""Solves the planner's program for the multipliers of the few rows that can bind, exactly.

An interior-point method pays for every unknown and every row in each iteration. A horizon has
30 to 120 inputs and a hundred rows or more, of which a few matter. So the inputs are
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
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf, dpotrs

from fsw.compiled import compiled
from fsw.model.prediction import Array
from fsw.mpc.clarabel_solver import ClarabelSolver
from fsw.mpc.qp_data import CONE, QpData, QuadraticProgram
from fsw.mpc.solution import Solution
from fsw.signals import SolverStatus

# Residual at the guess (m/s, rad, m/s^2) below which a row starts in the working set: the first
# always, the second if the optimum without any row violates it. Only speed depends on them.
_BINDS, _NEAR = 1e-3, 0.05
_TOLERANCE = 1e-6  # a left-out row may be missed by no more than the solver's own error
_SOLVES = 4  # after so many every row is in the working set
_PATTERNS = 64  # programs kept ready; others are built when they occur
# Unknowns and costs of the order of one save the interior-point method a third of its iterations:
# multipliers are counted in a slack's penalty, and the cost so that its tolerance is fine enough.
_MULTIPLIER, _COST = 20.0, 0.25
_SPREAD = _MULTIPLIER / math.sqrt(_COST)

WorkingSet = NDArray[np.bool_]


class DualSolver:
    """Solves one program again and again with new numbers."""

    def __init__(self, program: QpData) -> None:
        self._program = program
        self._multipliers = lru_cache(maxsize=_PATTERNS)(_Multipliers)

    def solve(self, guess: Array) -> Solution:
        """Inputs and slacks that solve the program as filled now.

        The inputs ``guess`` (6 n,) [SI] say where rows may be active; the optimum does not depend
        on them. Where the multipliers have no optimum (rows that contradict each other, a Hessian
        that is not positive) Clarabel solves the whole program and has the last word.
        """
        program, rows = self._program, self._program.rows
        factor, failed = dpotrf(program.hessian.T, lower=1, clean=0)
        if failed:
            return ClarabelSolver(program.whole()).solve()
        free = -dpotrs(factor, program.linear, lower=1)[0]
        residual_free = rows.b - rows.g @ free
        working_set = np.zeros(len(rows.b), dtype=np.bool_)
        _add_near(residual_free, rows.b - rows.g @ guess, rows.first_cone, working_set)
        inputs, residual = free, residual_free
        slacks = np.zeros(len(program.penalty))
        status, iterations = SolverStatus.SOLVED, 0
        for solves in range(len(rows.b)):
            chosen = np.flatnonzero(working_set)
            if len(chosen):
                # L^-1 G', scaled so that its square is the quadratic term.
                spread = dtrsm(_SPREAD, factor, rows.g[chosen].T, lower=1, overwrite_b=1)
                solution = self._by_multipliers(chosen, spread, residual_free[chosen])
                status = solution.status
                iterations += solution.iterations
                if not solution.usable:
                    break
                moved = spread @ (_MULTIPLIER / _SPREAD * solution.x)
                inputs = free - dtrsv(factor, moved, lower=1, trans=1)
                residual = rows.b - rows.g @ inputs
            if not _add_violated(residual, rows.slack, rows.first_cone, working_set, slacks):
                return Solution(status, np.concatenate((inputs, slacks)), iterations)
            if solves >= _SOLVES:
                working_set[:] = True
        return ClarabelSolver(program.whole()).solve()

    def _by_multipliers(self, chosen: NDArray[np.intp], spread: Array, residual: Array) -> Solution:
        """Multipliers of the chosen rows, counted in ``_MULTIPLIER``."""
        program = self._program
        simple = int(chosen.searchsorted(program.rows.first_cone))
        softening, held = _numbered(program.rows.slack[chosen[:simple]], len(program.penalty))
        same = self._multipliers(tuple(held.tolist()), (len(chosen) - simple) // CONE)
        return same.solve(spread.T @ spread, residual, program.penalty[softening])


class _Multipliers:
    """The dual program of rows that share slacks in one way, in Clarabel's form."""

    def __init__(self, held: tuple[int, ...], cones: int) -> None:
        """Lay it out for simple rows, each with the number of its slack or -1, and for cones."""
        simple, slacks, size = len(held), max(held, default=-1) + 1, len(held) + CONE * cones
        p, self._upper = _upper_triangle(size)
        a = _signs_and_sums(held, slacks, size)
        self._program = QuadraticProgram(
            p, np.zeros(size), a, np.zeros(size + slacks), simple + slacks, cones
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


@dataclass(frozen=True, slots=True)
class _Columns:
    """A sparse matrix, column by column: what Clarabel reads of SciPy's class.

    That class checks all it is given, which took longer than all else in a new pattern, in flight
    twice as long as a solve.
    """

    data: Array  # (entries,)
    indices: NDArray[np.intp]  # (entries,) rows
    indptr: NDArray[np.intp]  # (columns + 1,) where each column begins
    shape: tuple[int, int]
    has_canonical_format: bool = True  # rows in order, none twice


@lru_cache(maxsize=_PATTERNS)
def _triangle(size: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Rows, beginnings of columns, and places in the flat square of a full upper triangle."""
    column, row = np.tril_indices(size)
    ends = np.arange(size + 1)
    found = (row, ends * (ends + 1) // 2, row * size + column)
    for one in found:
        one.flags.writeable = False
    return found


def _upper_triangle(size: int) -> tuple[_Columns, NDArray[np.intp]]:
    """A full upper triangle, and where its entries are in the flat square, column by column."""
    row, begins, flat = _triangle(size)
    return _Columns(np.ones(len(row)), row, begins, (size, size)), flat


def _signs_and_sums(held: tuple[int, ...], slacks: int, size: int) -> _Columns:
    """Rows for the signs of simple multipliers, for their sums by slack, and for the cones'.

    A column has -1 for its own sign and, in a row that shares a slack, 1 in the sum for it.
    """
    simple = len(held)
    data, rows, begins = list[float](), list[int](), [0]
    for k in range(size):
        data.append(-1.0)
        rows.append(k if k < simple else slacks + k)
        if k < simple and held[k] >= 0:
            data.append(1.0)
            rows.append(simple + held[k])
        begins.append(len(data))
    return _Columns(np.array(data), np.array(rows), np.array(begins), (size + slacks, size))


@compiled
def _residual(residual: Array, row: int, first_cone: int) -> float:
    """Distance of a row, or of the cone that begins there, to its boundary."""
    if row < first_cone:
        return float(residual[row])
    return float(residual[row] - np.hypot(residual[row + 1], residual[row + 2]))


@compiled
def _add_near(at_free: Array, at_guess: Array, first_cone: int, working_set: WorkingSet) -> None:
    """Mark the rows that probably bind; what is not a number counts as violated."""
    row = 0
    while row < len(working_set):
        rows = 1 if row < first_cone else CONE
        near = _residual(at_guess, row, first_cone)
        if not (near >= _BINDS) or (
            near < _NEAR and not (_residual(at_free, row, first_cone) >= 0.0)
        ):
            working_set[row : row + rows] = True
        row += rows


@compiled
def _add_violated(
    residual: Array,
    slack: NDArray[np.intp],
    first_cone: int,
    working_set: WorkingSet,
    slacks: Array,
) -> bool:
    """Fill the slacks of the working set, add violated rows to it; whether there are any."""
    slacks[:] = 0.0
    for row in range(first_cone):
        if working_set[row] and slack[row] >= 0 and -residual[row] > slacks[slack[row]]:
            slacks[slack[row]] = -residual[row]
    more = False
    row = 0
    while row < len(working_set):
        rows = 1 if row < first_cone else CONE
        softened = slacks[slack[row]] if slack[row] >= 0 else 0.0
        if not working_set[row] and not (
            _residual(residual, row, first_cone) + softened >= -_TOLERANCE
        ):
            working_set[row : row + rows] = True
            more = True
        row += rows
    return more


@compiled
def _numbered(slack: NDArray[np.intp], slacks: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The slacks of these rows in the order they come, and which of them each row has, or -1."""
    number = np.full(slacks, -1)
    softening, held = np.empty(len(slack), dtype=np.intp), np.full(len(slack), -1)
    count = 0
    for row, its in enumerate(slack):
        if its >= 0:
            if number[its] < 0:
                number[its] = count
                softening[count] = its
                count += 1
            held[row] = number[its]
    return softening[:count], held
