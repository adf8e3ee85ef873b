"""DAQP, a dual active-set method, behind one call; the only importer of it.

At the optimum of these programs a handful of rows bind, and an active-set method pays for those
alone: a tenth of an interior-point method's time, and no tolerance in what it holds. It knows
no second-order cones, and where it stops for any other reason than an optimum Clarabel solves
the same program and has the last word.

Source: Arnström, Bemporad and Axehill, A dual active-set solver for embedded quadratic
programming using recursive LDL' updates, IEEE TAC 67(8), 2022; docs/decisions/0009.
"""

from __future__ import annotations

from typing import Final

import daqp
import numpy as np

from fsw.mpc.clarabel_solver import ClarabelSolver
from fsw.mpc.program import QuadraticProgram
from fsw.mpc.solution import Solution
from fsw.signals import SolverStatus

_OPTIMAL: Final = 1  # DAQP's exit flag
_UNBOUNDED: Final = 1e30  # DAQP's infinity


class ActiveSetSolver:
    """Solves one program without cones again and again with new numbers in the same pattern."""

    def __init__(self, program: QuadraticProgram) -> None:
        self._program = program
        self._clarabel: ClarabelSolver | None = None
        n, general = len(program.q), program.general_rows
        rows = max(general, 1)  # its update wants a matrix, be it of one row that says nothing
        p = program.p
        row, column = p.indices, np.repeat(np.arange(n), np.diff(p.indptr))
        self._hessian = np.zeros((n, n))
        self._upper, self._lower = row * n + column, column * n + row
        a = program.a
        row, column = a.indices, np.repeat(np.arange(n), np.diff(a.indptr))
        self._from = np.flatnonzero(row < general)
        self._to = row[self._from] * n + column[self._from]
        self._matrix = np.zeros((rows, n))
        self._most = np.full(n + rows, _UNBOUNDED)
        self._least = np.full(n + rows, -_UNBOUNDED)
        for entry in np.flatnonzero(row >= general):
            limit = program.b[row[entry]] / a.data[entry]
            if a.data[entry] > 0.0:
                self._most[column[entry]] = limit
            else:
                self._least[column[entry]] = limit
        self._general = slice(n, n + general)
        # Every solve starts from no active row: the answer then depends on the program alone.
        self._none_active = np.zeros(n + rows, dtype=np.int32)
        self._fill()
        self._model = daqp.Model()
        self._model.setup(
            self._hessian, program.q, self._matrix, self._most, self._least, self._none_active
        )

    def solve(self) -> Solution:
        """Solve the program as it is filled now."""
        self._fill()
        self._model.update(
            H=self._hessian,
            f=self._program.q,
            A=self._matrix,
            bupper=self._most,
            blower=self._least,
            sense=self._none_active,
        )
        x, _, flag, info = self._model.solve()
        if flag == _OPTIMAL and np.isfinite(x).all():
            return Solution(SolverStatus.SOLVED, x, int(info["iterations"]))
        if self._clarabel is None:
            self._clarabel = ClarabelSolver(self._program)
        return self._clarabel.solve()

    def _fill(self) -> None:
        program = self._program
        hessian = self._hessian.ravel()
        hessian[self._upper] = hessian[self._lower] = program.p.data
        self._matrix.ravel()[self._to] = program.a.data.take(self._from)
        self._most[self._general] = program.b[: program.general_rows]
