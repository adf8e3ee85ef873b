"""Everything the planner can be tuned by."""

from __future__ import annotations

from dataclasses import dataclass, field

from fsw.autopilot.barriers.safe_approach import BarrierTuning
from fsw.autopilot.model.body import BodyName
from fsw.autopilot.mpc.costs import CostWeights
from fsw.autopilot.mpc.qp_data import InputLimits
from fsw.autopilot.periods import HORIZON_US, PLANNING_US


@dataclass(frozen=True, slots=True)
class SoftWeights:
    """Weights of Table II for eqs 29 and 30, and of our centring; all are flown for comparison."""

    wall: float = 5.0  # w_4
    wall_terminal: float = 20.0  # w_s4
    workspace: float = 5.0  # w_5
    workspace_terminal: float = 20.0  # w_s5
    centring: float = 100.0  # ours, for the like-for-like Naive


@dataclass(frozen=True, slots=True)
class PlannerConfig:
    """Horizon, weights, limits and barriers of the MPC."""

    controller: str = "blf"  # a name in variants.py; those that it is compared with in studies
    horizon: int = HORIZON_US // PLANNING_US  # n
    period_us: int = PLANNING_US  # T
    solver: str = "clarabel"  # a name in optimisers.py; slsqp is the paper's
    sqp_iterations: int = 2  # slsqp goes on until it converges
    body: BodyName = "full"  # what keeps clear; "points" are the paper's
    weights: CostWeights = field(default_factory=CostWeights)
    limits: InputLimits = field(default_factory=InputLimits)
    joint_slack: float = 50.0  # penalty of a rad outside the limits
    # blf
    # Beside walls the end-effector counts too, which swings more than the base wanders.
    walls: BarrierTuning = field(default_factory=lambda: BarrierTuning(lambda_=0.35))
    workspace: BarrierTuning = field(default_factory=BarrierTuning)
    # m/s, that lambda follows the disturbance down to beside walls; 0: it does not
    lambda_min: float = 0.0
    barrier_slack: float = 20.0  # penalty of a m/s less than the barrier requires
    # hc
    tightening: float = 0.0  # m, kept in addition to the safe set
    hard_slack: float | None = None  # penalty of a m outside; None: hard, as in the paper
    hard_skipped_nodes: int = 0
    hard_terminal: bool = False  # the last node is to be where braking suffices, as of the barrier
    # sc, and naive with centring
    soft: SoftWeights = field(default_factory=SoftWeights)
    centred: bool = False

    def __post_init__(self) -> None:
        if not self.period_us > 0:
            raise ValueError(f"the planner's period is {self.period_us} us; it must be positive")
        self.walls.check_sampling(self.period)
        self.workspace.check_sampling(self.period)

    @property
    def tunings(self) -> tuple[BarrierTuning, BarrierTuning]:
        """Of all zones, and of the sphere that follows the target."""
        return self.walls, self.workspace

    @property
    def period(self) -> float:
        """Of the planner, T [s]."""
        return self.period_us / 1e6
