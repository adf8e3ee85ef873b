"""The sequence of programs: how many, around what, and what is reported of them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np
import pytest

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.ocp import Ocp
from fsw.autopilot.mpc.optimisers import Question, Search, by_programs
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.autopilot.mpc.qp_data import Solution
from fsw.autopilot.signals import SolverStatus

INPUTS, SLACKS = 6, 2
START, GUESS = np.arange(19.0), np.full(INPUTS, 0.5)
TARGETS = TargetPoints(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros(2))


@dataclass
class Programs:
    """Answers program after program with inputs 1, 2, ..., slacks of 9 and 10, 20, ... steps."""

    bad: int = 0  # the number of the one without an answer
    guesses: list[float] = field(default_factory=list)

    def linearise(self, start: Array, guess: Array, targets: TargetPoints) -> None:
        assert start is START
        assert targets is TARGETS
        assert len(guess) == INPUTS
        self.guesses.append(float(guess[0]))

    def solve(self) -> Solution:
        number = len(self.guesses)
        status = SolverStatus.INFEASIBLE if number == self.bad else SolverStatus.SOLVED
        x = np.concatenate((np.full(INPUTS, float(number)), np.full(SLACKS, 9.0)))
        return Solution(status, x, 10 * number)


def searched(programs: Programs, count: int, times: Any = None) -> Search:
    question = Question(cast(Ocp, programs), START, TARGETS, GUESS)
    stopwatch = (lambda: 0.0) if times is None else lambda: float(next(times))
    return by_programs(
        question, replace(PlannerConfig(body="points"), sqp_iterations=count), stopwatch
    )


@pytest.mark.parametrize("count", [1, 2, 5])
def test_each_program_is_around_the_inputs_of_the_one_before(count: int) -> None:
    programs = Programs()
    search = searched(programs, count)
    assert programs.guesses == [0.5, 1.0, 2.0, 3.0, 4.0][:count]
    assert search.solution.x[0] == count
    assert search.sqp_iterations == count
    assert search.solver_iterations == 10 * sum(range(1, count + 1))


def test_a_program_without_an_answer_is_the_last() -> None:
    programs = Programs(bad=2)
    search = searched(programs, 5)
    assert not search.solution.usable
    assert (search.sqp_iterations, search.solver_iterations) == (2, 30)


def test_both_stages_are_timed_over_all_programs() -> None:
    # Linearised after 1, solved after 2 more, and so on: the marks are 0 1 3, 6 10 15, 21 28 36.
    search = searched(Programs(), 3, itertools.accumulate(range(9)))
    assert search.linearise_us == 1.0 + 4.0 + 7.0
    assert search.solve_us == 2.0 + 5.0 + 8.0
