"""Optimisers of the planner, by name: one signature and one table.

An optimiser finds the inputs of one request. The one that flies asks a ``QpSolver`` for each
quadratic program, the ``DualSolver``, which asks Clarabel.

Another one is a function and a row in ``OPTIMISERS`` (and in
``fsw.autopilot.parameters.control_choice``, which names it for the command line without importing
it). The paper's own is that of ``studies.flight.rival_planners``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.qp_data import Solution

Stopwatch = Callable[[], float]
"""Monotonic time [us], for the reported stage times only."""


class Question(NamedTuple):
    """What is to be optimised for one request."""

    ocp: Ocp  # of the safe set; holds the program around the optimum afterwards
    start: Array  # (states,) SI, prediction state at node 0
    targets: TargetPoints  # at the nodes
    guess: Array  # (inputs n,) SI, the last solution moved on by one period, or zeros


@dataclass(frozen=True, slots=True)
class Search:
    """How one request was answered; the plan is usable where the last solution is."""

    solution: Solution
    sqp_iterations: int
    solver_iterations: int
    linearise_us: float
    solve_us: float


def by_programs(asked: Question, config: PlannerConfig, stopwatch_us: Stopwatch) -> Search:
    """From the guess on linearise, refill and solve a fixed number of times, two as configured."""
    ocp, start, targets, inputs = asked
    linearise_us = solve_us = 0.0
    iterations = done = 0
    while done < config.sqp_iterations:
        mark = stopwatch_us()
        ocp.linearise(start, inputs, targets)
        linearised = stopwatch_us()
        solution = ocp.solve()
        linearise_us += linearised - mark
        solve_us += stopwatch_us() - linearised
        iterations += solution.iterations
        done += 1
        if not solution.usable:
            break
        inputs = solution.x[: len(inputs)]
    return Search(solution, done, iterations, linearise_us, solve_us)


OPTIMISERS: dict[str, Callable[[Question, PlannerConfig, Stopwatch], Search]] = {
    "clarabel": by_programs,  # what users name: the library that solves its programs
}
