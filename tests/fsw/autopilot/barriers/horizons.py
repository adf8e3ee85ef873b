"""Horizons to hold a barrier against, and its h written out in numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fsw.autopilot.barriers.constraint_block import TargetPoints
from fsw.autopilot.barriers.safe_approach import BarrierTuning
from fsw.autopilot.barriers.zone_rows import ZoneRows
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.model.body import body_of
from fsw.autopilot.model.linearisation import Linearisation
from fsw.autopilot.model.prediction import Array, condense
from fsw.autopilot.signals import SafeSet, Zone
from tests.fsw.autopilot.model.geometry_by_rotation import moved_on, tips_of_prediction
from tests.fsw.paper_arm import INPUTS, LENGTHS
from tests.fsw.random_states import prediction_vector

NODES = 5
TUNING = BarrierTuning(alpha=2.0, slope=4.0, gamma=3.0, lambda_=0.3, skipped_nodes=1)
PERIOD = 0.1
BETA = 1.0 - TUNING.gamma * PERIOD
MODEL = condense(AIRFRAME, PERIOD, NODES)
POINTS = body_of("points", AIRFRAME)


@dataclass(frozen=True)
class Case:
    """A start, inputs and targets."""

    start: Array  # (19,)
    inputs: Array  # (6 n,)
    targets: TargetPoints

    def horizon(self, change: Array | float = 0.0) -> Linearisation:
        """The horizon of these inputs, or of changed ones."""
        horizon = Linearisation(MODEL)
        horizon.refill(self.start, self.inputs + change)
        return horizon


def random_case(random: np.random.Generator) -> Case:
    targets = TargetPoints(
        random.uniform(-1.0, 1.0, (NODES + 1, 3)),
        random.uniform(-0.5, 0.5, (NODES + 1, 3)),
        random.uniform(-3.0, 3.0, NODES + 1),
    )
    return Case(prediction_vector(random), random.uniform(-2.0, 2.0, INPUTS * NODES), targets)


def barrier_of(zones: tuple[Zone, ...], tuning: BarrierTuning = TUNING) -> ZoneRows:
    """Barriers of the paper's three points."""
    return ZoneRows(SafeSet(zones), POINTS, MODEL, (tuning, tuning))


def distances_of(
    zones: tuple[Zone, ...], tightening: float = 0.0, skipped_nodes: int = 0
) -> ZoneRows:
    """MPC-HC's rows of the paper's three points."""
    return ZoneRows(
        SafeSet(zones),
        POINTS,
        MODEL,
        (TUNING, TUNING),
        distances=True,
        tightening=tightening,
        skipped_nodes=skipped_nodes,
    )


def front_of(wall: Zone) -> tuple[Array, float]:
    """The normal of a wall, and the offset along it from which on its clearance is kept."""
    nx, ny, nz, offset = wall.shape.numbers
    return np.array([nx, ny, nz]), offset + wall.clearance


def safe_speed(d: float) -> float:
    """S(d), eqs 22 and 23 as amended: tangent below the knee, shifted root above it."""
    k, alpha = TUNING.slope, TUNING.alpha
    return k * d if d < alpha / k**2 else float(np.sqrt(2 * alpha * d - (alpha / k) ** 2))


def lowest_allowed(h_start: float, node: int) -> float:
    """What the decay of eq 25 leaves of h at a node."""
    return float(TUNING.lambda_ + BETA**node * (h_start - TUNING.lambda_))


def measured(horizon: Linearisation) -> tuple[Array, Array]:
    """Positions (n + 1, 3 points, 3) of every node and their rates, without the product's geometry.

    Base, joint 2 and end-effector by chained rotations from each node's state; the rate is the
    difference over a moment of the motion.
    """
    moment = 1e-4

    def places(x: Array) -> Array:
        return np.array([x[0:3], *tips_of_prediction(x, np.array(LENGTHS))])

    states = horizon.states
    before, after = (
        np.array([places(moved_on(x, t)) for x in states]) for t in (-moment, moment)
    )  # fmt: skip
    return np.array([places(x) for x in states]), (after - before) / (2.0 * moment)
