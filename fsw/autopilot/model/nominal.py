"""The prediction model at the tick's rate, in plain floats: where the plan is now.

Source: docs/equations.md E16.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.prediction import A, P, S, discretise
from fsw.autopilot.signals import PlanInput, PredictionState, Vec3
from fsw.autopilot.tick_record import Accelerations, PlanState, Tick
from fsw.compiled import compilable, kernel, machine_code, packed

_Row = tuple[float, ...]


@dataclass(frozen=True, slots=True)
class TickModel:
    """The discrete model, its zeros left out."""

    dt: float  # s
    horizontal: tuple[_Row, ...]  # of p, v, a, j, s: on all of them and on u
    vertical: tuple[_Row, ...]  # of p, v, a: on all of them and on u


class NominalModel:
    """Moves a PredictionState on by ticks under a held input."""

    def __init__(self, airframe: Airframe, dt: float) -> None:
        a, b = discretise(airframe, dt)
        horizontal = [P, P + 3, A, 9, S]  # p, v, a, j, s along x
        vertical = [P + 2, P + 5, A + 2]
        self.model = TickModel(
            dt,
            tuple((*a[row, horizontal].tolist(), float(b[row, 0])) for row in horizontal),
            tuple((*a[row, vertical].tolist(), float(b[row, 2])) for row in vertical),
        )
        self.packed = packed(self.model)
        self._move = machine_code(_move, self.packed, Tick().array, 1)

    def move(self, r: Tick, ticks: int) -> None:
        """Bring the plan's state of a record some ticks on. Reads plan, u; writes plan."""
        self._move(self.packed, r.array, ticks)

    def advance(self, x: PredictionState, u: PlanInput, ticks: int = 1) -> PredictionState:
        """The state some ticks later under one input."""
        r = Tick()
        r.joint_count = len(x.q_arm)
        r.plan_state, r.plan_input = x, u
        self.move(r, ticks)
        moved = r.plan_state
        assert moved is not None
        return moved


def rest_input(joints: int) -> PlanInput:
    """The input of a vehicle at rest, with so many ``joints`` [1]."""
    return PlanInput((0.0, 0.0, 0.0), 0.0, (0.0,) * joints)


def rest_state(joints: int) -> PredictionState:
    """A vehicle at rest at the origin, with so many ``joints`` [1] at angles of zero."""
    no2, no3, arm = (0.0, 0.0), (0.0, 0.0, 0.0), (0.0,) * joints
    return PredictionState(no3, no3, no3, no2, no2, 0.0, 0.0, arm, arm)


@kernel
def _move(models: NDArray[Any], records: NDArray[Any], ticks: int) -> None:
    model, r = models[0], records[0]
    for _ in range(ticks):
        move_plan(model, r.plan, r.u, r.joint_count)


@compilable
def move_plan(model: TickModel, x: PlanState, u: Accelerations, joints: int) -> None:
    """Bring the state of a plan of so many ``joints`` [1] on by a tick."""
    rows = model.horizontal
    for k in range(2):
        x.p[k], x.v[k], x.a[k], x.j[k], x.s[k] = _axis(
            rows, x.p[k], x.v[k], x.a[k], x.j[k], x.s[k], u.a[k]
        )
    x.p[2], x.v[2], x.a[2] = _climb(model.vertical, x.p[2], x.v[2], x.a[2], u.a[2])
    dt = model.dt
    half = 0.5 * dt * dt
    for k in range(3):
        x.p[k] += half * u.push[k]
        x.v[k] += dt * u.push[k]
    x.yaw = x.yaw + dt * x.yaw_rate + half * u.yaw_acc
    x.yaw_rate += dt * u.yaw_acc
    for k in range(joints):
        x.q_arm[k] = x.q_arm[k] + dt * x.qd_arm[k] + half * u.qdd_arm[k]
        x.qd_arm[k] += dt * u.qdd_arm[k]


@compilable
def _axis(
    rows: tuple[_Row, ...], p: float, v: float, a: float, j: float, s: float, u: float
) -> tuple[float, float, float, float, float]:
    rp, rv, ra, rj, rs = rows[0], rows[1], rows[2], rows[3], rows[4]
    return (
        rp[0] * p + rp[1] * v + rp[2] * a + rp[3] * j + rp[4] * s + rp[5] * u,
        rv[1] * v + rv[2] * a + rv[3] * j + rv[4] * s + rv[5] * u,
        ra[2] * a + ra[3] * j + ra[4] * s + ra[5] * u,
        rj[2] * a + rj[3] * j + rj[4] * s + rj[5] * u,
        rs[2] * a + rs[3] * j + rs[4] * s + rs[5] * u,
    )


@compilable
def _climb(rows: tuple[_Row, ...], p: float, v: float, a: float, u: float) -> Vec3:
    rp, rv, ra = rows[0], rows[1], rows[2]
    return (
        rp[0] * p + rp[1] * v + rp[2] * a + rp[3] * u,
        rv[1] * v + rv[2] * a + rv[3] * u,
        ra[2] * a + ra[3] * u,
    )
