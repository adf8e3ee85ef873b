"""Optimisers of the planner, by name: one interface and one table.

Another one is a class with ``solve`` and a row in ``SOLVERS`` (and in
``fsw.parameters.control_choice``, which names it for the command line without importing it).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from fsw.barriers.constraint_block import TargetPoints
from fsw.model.prediction import Array
from fsw.mpc.ocp import Ocp
from fsw.mpc.planner_config import PlannerConfig
from fsw.mpc.slsqp_solver import NonlinearProgram, minimise
from fsw.mpc.solution import Solution

Stopwatch = Callable[[], float]
"""Monotonic time [us], for the reported stage times only."""


@dataclass(frozen=True, slots=True)
class Search:
    """How one request was answered; the plan is usable where the last solution is."""

    solution: Solution
    sqp_iterations: int
    solver_iterations: int
    linearise_us: float
    solve_us: float


class Solver(Protocol):
    """Minimises an optimal control problem."""

    def solve(self, ocp: Ocp, start: Array, targets: TargetPoints, guess: Array) -> Search:
        """Solve one request from the prediction state ``start`` (19,) [SI] at node 0.

        The ``guess`` (6 n,) [SI] is the last solution moved on by one period, or zeros. The
        problem is the one of the safe set; it holds the program around the optimum afterwards.
        """
        ...


class SqpSolver:
    """A fixed number of quadratic programs from the guess on."""

    def __init__(self, config: PlannerConfig, stopwatch_us: Stopwatch) -> None:
        self._iterations, self._stopwatch_us = config.sqp_iterations, stopwatch_us

    def solve(self, ocp: Ocp, start: Array, targets: TargetPoints, guess: Array) -> Search:
        """See ``Solver``: ``start`` (19,) [SI], ``guess`` (6 n,) [SI]."""
        inputs = guess
        linearise_us = solve_us = 0.0
        iterations = done = 0
        while done < self._iterations:
            mark = self._stopwatch_us()
            ocp.linearise(start, inputs, targets)
            linearised = self._stopwatch_us()
            solution = ocp.solve()
            linearise_us += linearised - mark
            solve_us += self._stopwatch_us() - linearised
            iterations += solution.iterations
            done += 1
            if not solution.usable:
                break
            inputs = solution.x[: len(inputs)]
        return Search(solution, done, iterations, linearise_us, solve_us)


class PaperSolver:
    """The paper's optimiser, from rest whatever was planned before."""

    def __init__(self, config: PlannerConfig, stopwatch_us: Stopwatch) -> None:
        self._stopwatch_us = stopwatch_us

    def solve(self, ocp: Ocp, start: Array, targets: TargetPoints, guess: Array) -> Search:
        """See ``Solver``: ``start`` (19,) [SI]; ``guess`` (6 n,) [SI] is not used."""
        mark = self._stopwatch_us()
        solution = minimise(NonlinearProgram(ocp, start, targets))
        solve_us = self._stopwatch_us() - mark
        return Search(solution, solution.iterations, solution.iterations, 0.0, solve_us)


SOLVERS: dict[str, Callable[[PlannerConfig, Stopwatch], Solver]] = {
    "clarabel": SqpSolver,
    "slsqp": PaperSolver,
}
