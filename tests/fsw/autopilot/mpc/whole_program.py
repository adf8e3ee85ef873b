"""The planner's program with all unknowns and rows, in Clarabel's form, to hold ours against."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.clarabel_solver import QuadraticProgram, columns_of
from fsw.autopilot.mpc.qp_data import CONE, QpData


class WholeProgram(NamedTuple):
    """Minimise ``1/2 x' P x + q' x`` where ``b - A x`` lies in the cones; dense."""

    p: Array  # upper triangle
    q: Array
    a: Array
    b: Array
    nonnegative_rows: int

    def sparse(self) -> QuadraticProgram:
        """The same, as Clarabel is handed it."""
        rows = self.nonnegative_rows
        cones = (len(self.b) - rows) // CONE
        return QuadraticProgram(columns_of(self.p), self.q, columns_of(self.a), self.b, rows, cones)


def whole(program: QpData) -> WholeProgram:
    """All of it as filled now, unknowns (U, s), with a row for every slack >= 0."""
    rows, slacks, cut = program.rows, len(program.penalty), program.rows.first_cone
    softened = np.flatnonzero(rows.slack >= 0)
    holds = np.zeros((len(rows.b), slacks))
    holds[softened, rows.slack[softened]] = -1.0
    inside, size = np.hstack((rows.g, holds)), program.unknowns
    hessian = np.zeros((size, size))
    hessian[: program.inputs, : program.inputs] = np.triu(program.hessian)
    return WholeProgram(
        hessian,
        np.concatenate((program.linear, program.penalty)),
        np.vstack((inside[:cut], -np.eye(size)[program.inputs :], inside[cut:])),
        np.concatenate((rows.b[:cut], np.zeros(slacks), rows.b[cut:])),
        cut + slacks,
    )
