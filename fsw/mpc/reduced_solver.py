"""Solves the program without the rows that cannot bind, exactly.

Near one wall the other two, the joint limits and most input bounds are far from active, and
every row costs time in an interior-point method. Groups of rows with room to spare at the
guess are left out, together with the slacks only they use. The optimum of what remains is
the optimum of the whole if it satisfies what was left out; that is checked after every
solve, and a group that turns out to be violated is put back and the program solved again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fsw.compiled import compiled
from fsw.model.prediction import Array
from fsw.mpc.active_set_solver import ActiveSetSolver
from fsw.mpc.clarabel_solver import ClarabelSolver
from fsw.mpc.program import Program, QuadraticProgram
from fsw.mpc.solution import Solution

_ROOM = 0.3  # least room of every row at the guess (m/s, rad, m/s^2) to be left out
_TOLERANCE = 1e-6  # a left-out row may be missed by no more than the solver's own error


class ReducedSolver:
    """Keeps one solver for every set of groups that has occurred."""

    def __init__(self, program: Program, tolerance: float, *, active_set: bool = False) -> None:
        """Build the smallest and the largest reduction; the others when they occur.

        Args:
            program: Filled, so that its pattern is known.
            tolerance: Of the interior-point method.
            active_set: Solve by the active-set method wherever there are no cones.
        """
        self._program = program
        self._tolerance = tolerance
        self._active_set = active_set
        self._reductions: dict[int, _Reduction] = {}
        everything = (1 << len(program.groups)) - 1
        for kept in (0, everything):
            self._reduction(kept)

    def solve(self, guess: Array) -> Solution:
        """Solve the program as filled now; ``guess`` (6 n,) decides what is left out first."""
        program = self._program
        at_guess = np.zeros(program.unknowns)
        at_guess[: len(guess)] = guess
        kept = self._groups_within(at_guess, _ROOM)
        iterations = 0
        while True:
            solution = self._reduction(kept).solve()
            iterations += solution.iterations
            if not solution.usable:
                return Solution(solution.status, solution.x, iterations)
            violated = self._groups_within(solution.x, -_TOLERANCE) & ~kept
            if not violated:
                return Solution(solution.status, solution.x, iterations)
            kept |= violated

    def _groups_within(self, x: Array, room: float) -> int:
        """Bit set of the groups that have less room than this at x."""
        whole = self._program.whole
        s = whole.b - whole.a @ x
        close = 0
        for bit, group in enumerate(self._program.groups):
            if not (_least_room(s, group.rows, group.are_cones, len(group.columns)) >= room):
                close |= 1 << bit
        return close

    def _reduction(self, kept: int) -> _Reduction:
        found = self._reductions.get(kept)
        if found is None:
            found = self._reductions[kept] = _Reduction(
                self._program, kept, self._tolerance, self._active_set
            )
        return found


class _Reduction:
    """One set of groups: a smaller program, gathered from the whole by fixed indices."""

    def __init__(self, program: Program, kept: int, tolerance: float, active_set: bool) -> None:
        whole = program.whole
        left_out = [group for bit, group in enumerate(program.groups) if not kept >> bit & 1]
        rows = _without(len(whole.b), [group.rows for group in left_out])
        self._columns = _without(len(whole.q), [group.columns for group in left_out])
        self._rows = rows
        self._whole = whole
        a, self._a_from = _part(whole.a, rows, self._columns)
        p, self._p_from = _part(whole.p, self._columns, self._columns)
        cones = 0 if any(group.are_cones for group in left_out) else whole.tilt_cones
        self._part = QuadraticProgram(
            p,
            whole.q[self._columns],
            a,
            whole.b[rows],
            int(np.searchsorted(rows, whole.general_rows)),
            len(rows) - 3 * cones,
            cones,
        )
        self._solver: ClarabelSolver | ActiveSetSolver
        if active_set and not cones:
            self._solver = ActiveSetSolver(self._part)
        else:
            self._solver = ClarabelSolver(self._part, tolerance)

    def solve(self) -> Solution:
        """Gather the numbers, solve, and put the unknowns back where they belong."""
        whole, part = self._whole, self._part
        whole.p.data.take(self._p_from, out=part.p.data)
        whole.a.data.take(self._a_from, out=part.a.data)
        whole.q.take(self._columns, out=part.q)
        whole.b.take(self._rows, out=part.b)
        solution = self._solver.solve()
        x = np.zeros(len(whole.q))
        x[self._columns] = solution.x
        return Solution(solution.status, x, solution.iterations)


def _without(length: int, left_out: list[NDArray[np.intp]]) -> NDArray[np.intp]:
    kept = np.ones(length, dtype=bool)
    for indices in left_out:
        kept[indices] = False
    return np.flatnonzero(kept)


def _part(
    matrix: sparse.csc_matrix, rows: NDArray[np.intp], columns: NDArray[np.intp]
) -> tuple[sparse.csc_matrix, NDArray[np.intp]]:
    """A sub-matrix, and where each of its entries is in the whole's data."""
    numbered = sparse.csc_matrix(
        (np.arange(1, matrix.nnz + 1), matrix.indices, matrix.indptr), shape=matrix.shape
    )
    part = numbered[rows][:, columns].tocsc()
    part.sort_indices()
    places = part.data.astype(np.intp) - 1
    return sparse.csc_matrix(
        (matrix.data[places], part.indices, part.indptr), shape=part.shape
    ), places


@compiled
def _least_room(s: Array, rows: NDArray[np.intp], are_cones: bool, slack_rows: int) -> float:
    """Smallest distance of a group's rows to their cones' boundaries; NaN counts as none.

    The last ``slack_rows`` rows say that slacks are not negative; left out, slacks are zero.
    """
    least = np.inf
    if are_cones:
        for k in range(0, len(rows), 3):
            s0, s1, s2 = s[rows[k]], s[rows[k + 1]], s[rows[k + 2]]
            room = s0 - np.sqrt(s1 * s1 + s2 * s2)
            if not (room >= least):
                least = room
        return least
    for k in range(len(rows) - slack_rows):
        if not (s[rows[k]] >= least):
            least = s[rows[k]]
    return least
