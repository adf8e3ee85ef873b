"""Everything the planner can be tuned by."""

from __future__ import annotations

from dataclasses import dataclass, field

from fsw.barriers.root import BarrierTuning
from fsw.model.airframe import AIRFRAME, Airframe
from fsw.model.prediction import LagModel
from fsw.mpc.costs import CostWeights
from fsw.mpc.program import InputLimits, SlackPrice


@dataclass(frozen=True, slots=True)
class PlannerConfig:
    """Horizon, weights, limits and barriers of the MPC."""

    horizon: int = 5  # n
    period: float = 0.1  # s, T
    sqp_iterations: int = 2
    airframe: Airframe = AIRFRAME
    lag: LagModel = field(default_factory=LagModel)
    weights: CostWeights = field(default_factory=CostWeights)
    limits: InputLimits = field(default_factory=InputLimits)
    walls: BarrierTuning = field(default_factory=lambda: BarrierTuning(robustness=0.4))
    workspace: BarrierTuning = field(default_factory=lambda: BarrierTuning(robustness=0.267))
    barrier_slack: SlackPrice = field(default_factory=lambda: SlackPrice(20.0))
    joint_slack: SlackPrice = field(default_factory=lambda: SlackPrice(50.0))
