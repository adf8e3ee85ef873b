r"""Solves the planner's program for the multipliers of the few rows that can bind, exactly.

An interior-point method pays for every unknown and every row in each iteration. A horizon has
30 to 120 inputs and a hundred rows or more, of which a few matter. So the inputs are
eliminated by one Cholesky factor of the Hessian, :math:`H = L L^T`, and the rows by asking for
the wanted ones only. With :math:`U_0 = -H^{-1} c`, the optimum without any row, what is left is

.. math:: \min_z \tfrac12 z^T G H^{-1} G^T z + (b - G U_0)^T z, \quad z \ge 0,\;
          \sum_{i \in j} z_i \le \mathrm{price}_j

(z of a tilt cone in that cone), where the sum goes over the rows that share a slack: a slack
with a linear price is a bound on multipliers. Then :math:`U = U_0 - H^{-1} G^T z`. It is the
optimum of the whole if it satisfies the rows that were left out; this is checked after every
solve, and rows that are violated are wanted as well and the program is solved again.

Source: docs/equations.md E17 and docs/decisions/0009; Boyd and Vandenberghe, Convex Optimization,
5.2 and 5.7.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg.blas import dtrsm, dtrsv
from scipy.linalg.lapack import dpotrf, dpotrs

from fsw.compiled import compiled
from fsw.model.prediction import Array
from fsw.mpc.clarabel_solver import ClarabelSolver
from fsw.mpc.program import CONE, Program, QuadraticProgram
from fsw.mpc.solution import Solution
from fsw.signals import SolverStatus

# Room at the guess (m/s, rad, m/s^2) below which a row is wanted from the start: the first
# always, the second if the optimum without any row violates it. Only speed depends on them.
_BINDS, _NEAR = 1e-3, 0.05
_TOLERANCE = 1e-6  # a left-out row may be missed by no more than the solver's own error
_SOLVES = 4  # after so many every row is wanted
_PATTERNS = 64  # programs kept ready; others are built when they occur
# Unknowns and costs of the order of one save the interior-point method a third of its iterations:
# multipliers are counted in a slack's price, and the cost so that its tolerance is fine enough.
_MULTIPLIER, _COST = 20.0, 0.25
_SPREAD = _MULTIPLIER / math.sqrt(_COST)

Wanted = NDArray[np.bool_]


class DualSolver:
    """Solves one program again and again with new numbers."""

    def __init__(self, program: Program) -> None:
        self._program = program
        self._multipliers = lru_cache(maxsize=_PATTERNS)(_Multipliers)

    def solve(self, guess: Array) -> Solution:
        """Solve the program as filled now.

        Args:
            guess: Inputs (6 n,) that say where rows may bind; the optimum does not depend on
                them.

        Returns:
            Inputs and slacks. Where the multipliers have no optimum (rows that contradict each
            other, a Hessian that is not positive) Clarabel solves the whole program and has
            the last word.
        """
        program, rows = self._program, self._program.rows
        factor, failed = dpotrf(program.hessian.T, lower=1, clean=0)
        if failed:
            return ClarabelSolver(program.whole()).solve()
        free = -dpotrs(factor, program.linear, lower=1)[0]
        room_free = rows.b - rows.g @ free
        wanted = np.zeros(len(rows.b), dtype=np.bool_)
        _want_near(room_free, rows.b - rows.g @ guess, rows.first_cone, wanted)
        inputs, room = free, room_free
        slacks = np.zeros(len(program.price))
        status, iterations = SolverStatus.SOLVED, 0
        for solves in range(len(rows.b)):
            chosen = np.flatnonzero(wanted)
            if len(chosen):
                # L^-1 G', scaled so that its square is the quadratic term.
                spread = dtrsm(_SPREAD, factor, rows.g[chosen].T, lower=1, overwrite_b=1)
                solution = self._by_multipliers(chosen, spread, room_free[chosen])
                status = solution.status
                iterations += solution.iterations
                if not solution.usable:
                    break
                moved = spread @ (_MULTIPLIER / _SPREAD * solution.x)
                inputs = free - dtrsv(factor, moved, lower=1, trans=1)
                room = rows.b - rows.g @ inputs
            if not _want_violated(room, rows.slack, rows.first_cone, wanted, slacks):
                return Solution(status, np.concatenate((inputs, slacks)), iterations)
            if solves >= _SOLVES:
                wanted[:] = True
        return ClarabelSolver(program.whole()).solve()

    def _by_multipliers(self, chosen: NDArray[np.intp], spread: Array, room: Array) -> Solution:
        """Multipliers of the chosen rows, counted in ``_MULTIPLIER``."""
        program = self._program
        simple = int(chosen.searchsorted(program.rows.first_cone))
        softening, held = _numbered(program.rows.slack[chosen[:simple]], len(program.price))
        same = self._multipliers(tuple(held.tolist()), (len(chosen) - simple) // CONE)
        return same.solve(spread.T @ spread, room, program.price[softening])


class _Multipliers:
    """The dual program of rows that share slacks in one way, in Clarabel's form."""

    def __init__(self, held: tuple[int, ...], cones: int) -> None:
        """Lay it out.

        Args:
            held: The slack of each simple row, numbered as they come; -1: none.
            cones: How many follow.
        """
        simple, slacks, size = len(held), max(held, default=-1) + 1, len(held) + CONE * cones
        column, row = np.tril_indices(size)  # of the upper triangle, column by column
        self._upper = row * size + column
        ends = np.arange(size + 1)
        p = sparse.csc_matrix((np.ones(len(row)), row, ends * (ends + 1) // 2), shape=(size, size))
        # A column has -1 for its own sign and, in a row that shares a slack, 1 in the sum for it.
        entries = [((k, -1.0), (simple + its, 1.0))[: 1 + (its >= 0)] for k, its in enumerate(held)]
        entries += [((slacks + k, -1.0),) for k in range(simple, size)]
        a = sparse.csc_matrix(
            (
                np.array([value for column in entries for _, value in column]),
                np.array([row for column in entries for row, _ in column], dtype=np.intp),
                np.cumsum([0, *map(len, entries)]),
            ),
            shape=(size + slacks, size),
        )
        self._program = QuadraticProgram(
            p, np.zeros(size), a, np.zeros(size + slacks), simple + slacks, cones
        )
        self._price = self._program.b[simple : simple + slacks]
        self._solver = ClarabelSolver(self._program)

    def solve(self, gram: Array, room: Array, price: Array) -> Solution:
        """Multipliers, simple rows before cones.

        Args:
            gram: G H^-1 G', (multipliers, multipliers), as scaled by ``_SPREAD``.
            room: Of the rows at the optimum without any, (multipliers,).
            price: Of the slacks.
        """
        gram.take(self._upper, out=self._program.p.data)
        np.multiply(room, _MULTIPLIER / _COST, out=self._program.q)
        np.divide(price, _MULTIPLIER, out=self._price)
        return self._solver.solve()


@compiled
def _room(room: Array, row: int, first_cone: int) -> float:
    """Distance of a row, or of the cone that begins there, to its boundary."""
    if row < first_cone:
        return float(room[row])
    return float(room[row] - np.hypot(room[row + 1], room[row + 2]))


@compiled
def _want_near(at_free: Array, at_guess: Array, first_cone: int, wanted: Wanted) -> None:
    """Mark the rows that probably bind; what is not a number counts as violated."""
    row = 0
    while row < len(wanted):
        rows = 1 if row < first_cone else CONE
        near = _room(at_guess, row, first_cone)
        if not (near >= _BINDS) or (near < _NEAR and not (_room(at_free, row, first_cone) >= 0.0)):
            wanted[row : row + rows] = True
        row += rows


@compiled
def _want_violated(
    room: Array, slack: NDArray[np.intp], first_cone: int, wanted: Wanted, slacks: Array
) -> bool:
    """Fill the slacks that the wanted rows need, mark violated rows; whether there are any."""
    slacks[:] = 0.0
    for row in range(first_cone):
        if wanted[row] and slack[row] >= 0 and -room[row] > slacks[slack[row]]:
            slacks[slack[row]] = -room[row]
    more = False
    row = 0
    while row < len(wanted):
        rows = 1 if row < first_cone else CONE
        softened = slacks[slack[row]] if slack[row] >= 0 else 0.0
        if not wanted[row] and not (_room(room, row, first_cone) + softened >= -_TOLERANCE):
            wanted[row : row + rows] = True
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
