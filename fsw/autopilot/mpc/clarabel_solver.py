"""Clarabel behind one call; the only importer of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.qp_data import Solution
from fsw.autopilot.signals import SolverStatus

_STATUS = {
    clarabel.SolverStatus.Solved: SolverStatus.SOLVED,
    clarabel.SolverStatus.AlmostSolved: SolverStatus.ALMOST_SOLVED,
    clarabel.SolverStatus.PrimalInfeasible: SolverStatus.INFEASIBLE,
    clarabel.SolverStatus.DualInfeasible: SolverStatus.INFEASIBLE,
    clarabel.SolverStatus.AlmostPrimalInfeasible: SolverStatus.INFEASIBLE,
    clarabel.SolverStatus.AlmostDualInfeasible: SolverStatus.INFEASIBLE,
    clarabel.SolverStatus.MaxIterations: SolverStatus.TIME_LIMIT,
    clarabel.SolverStatus.MaxTime: SolverStatus.TIME_LIMIT,
}

_TOLERANCE = 1e-6

# A solve is bounded in iterations, not in time: a few microseconds each at n = 5, and the same
# answer on a slow machine as on a fast one. Feasible programs need 8 to 15.
MAX_ITERATIONS = 50


@cache
def _settings() -> clarabel.DefaultSettings:
    """Those of every program."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_iter = MAX_ITERATIONS
    settings.direct_solve_method = "qdldl"  # of one thread
    # The program is small, dense and scaled by its author; these stages cost more than
    # they give here (docs/decisions/0004-clarabel-settings.md) and presolve would
    # forbid updates in place.
    settings.equilibrate_enable = False
    settings.iterative_refinement_enable = False
    settings.presolve_enable = False
    settings.chordal_decomposition_enable = False
    settings.input_sparse_dropzeros = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
    return settings


class Columns(NamedTuple):
    """A sparse matrix, column by column: what Clarabel reads of SciPy's class.

    That class checks all it is given, which made a step with a new pattern take twice as long.
    """

    data: Array  # (entries,)
    indices: NDArray[np.intp]  # (entries,) rows
    indptr: NDArray[np.intp]  # (columns + 1,) where each column begins
    shape: tuple[int, ...]
    has_canonical_format: bool = True  # rows in order, none twice


def columns_of(matrix: Array) -> Columns:
    """The entries of a ``matrix`` (rows, columns) [any] that are not zero."""
    column, row = np.nonzero(matrix.T)
    begins = column.searchsorted(np.arange(matrix.shape[1] + 1))
    return Columns(matrix[row, column], row, begins, matrix.shape)


@dataclass(frozen=True)
class QuadraticProgram:
    """Clarabel's form: minimise ``1/2 x' P x + q' x`` where ``b - A x`` lies in the cones.

    The data of P, q and b may change; patterns and A may not.
    """

    p: Columns  # upper triangle
    q: Array
    a: Columns
    b: Array
    nonnegative_rows: int  # the first
    cones: int  # second-order, of three rows each, after the non-negative ones


class ClarabelSolver:
    """Solves one program again and again with new P, q and b; A stays as it is."""

    def __init__(self, program: QuadraticProgram) -> None:
        cones = [
            clarabel.NonnegativeConeT(program.nonnegative_rows),
            *[clarabel.SecondOrderConeT(3)] * program.cones,
        ]
        self._program = program
        self._solver = clarabel.DefaultSolver(
            program.p, program.q, program.a, program.b, cones, _settings()
        )

    def solve(self) -> Solution:
        """Solve the program as it is filled now."""
        program = self._program
        # Memoryviews: the binding copies them three times as fast as arrays.
        self._solver.update(P=program.p.data.data, q=program.q.data, b=program.b.data)
        answer = self._solver.solve()
        status = _STATUS.get(answer.status, SolverStatus.NUMERICAL_ERROR)
        x = np.array(answer.x)
        if not np.isfinite(x).all():
            status = SolverStatus.NUMERICAL_ERROR
        return Solution(status, x, int(answer.iterations))
