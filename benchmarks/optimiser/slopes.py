"""Our gradients for the paper's optimiser, which flies with SciPy's differences."""

from __future__ import annotations

import numpy as np

from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.qp_data import CONE
from studies.flight.slsqp_solver import NonlinearProgram, Slopes


def slopes_of(problem: NonlinearProgram) -> Slopes:
    """Gradients of cost and margins, from the program around the point."""

    def cost_slope(x: Array) -> Array:
        """The quadratic model around a point has the true slope there."""
        program = problem.at(x)
        upper, inputs = program.hessian, x[: program.inputs]
        slope = upper @ inputs + upper.T @ inputs - upper.diagonal() * inputs + program.linear
        return np.concatenate((slope, program.penalty))

    def margin_slopes(x: Array) -> Array:
        """(margins, unknowns)."""
        program = problem.at(x)
        rows, soft = program.rows, program.block_rows
        g, b = rows.g[rows.first_cone :], rows.b[rows.first_cone :]
        cones = (b - g @ x[: program.inputs]).reshape(-1, CONE)
        signed = 2.0 * cones * np.array([-1.0, 1.0, 1.0])
        tilt = np.einsum("ca,cak->ck", signed, g.reshape(-1, CONE, program.inputs))
        unfelt = np.zeros((len(tilt), len(program.penalty)))
        return np.block([[-rows.g[:soft], problem.holds], [tilt, unfelt]])

    return cost_slope, margin_slopes
