"""A cost's quadratic model on its own."""

from __future__ import annotations

import numpy as np

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.mpc.costs import Cost, Quadratic


def quadratic(
    cost: Cost, horizon: Linearisation, guess: Array, targets: TargetPoints
) -> tuple[float, Array, Array]:
    """Value, slope and full Hessian at the guess."""
    hessian, gradient = np.zeros((len(guess), len(guess))), np.zeros(len(guess))
    value = cost.add(horizon, targets, Quadratic(guess, hessian, gradient))
    full = np.triu(hessian) + np.triu(hessian, 1).T
    return value, full @ guess + gradient, full
