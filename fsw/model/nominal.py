"""The prediction model at the tick's rate, in plain floats: where the plan is now.

Source: docs/equations.md E16.
"""

from __future__ import annotations

from fsw.model.prediction import A, LagModel, P, S, discretise
from fsw.signals import PlanInput, PredictionState, Vec3

REST_INPUT = PlanInput((0.0, 0.0, 0.0), 0.0, (0.0, 0.0))

_Row = tuple[float, ...]


class NominalModel:
    """Moves a PredictionState on by one tick under a held input."""

    def __init__(self, lag: LagModel, dt: float) -> None:
        a, b = discretise(lag, dt)
        horizontal = [P, P + 3, A, 9, S]  # p, v, a, j, s along x
        vertical = [P + 2, P + 5, A + 2]
        self._dt = dt
        self._horizontal: tuple[_Row, ...] = tuple(
            (*a[row, horizontal].tolist(), float(b[row, 0])) for row in horizontal
        )
        self._vertical: tuple[_Row, ...] = tuple(
            (*a[row, vertical].tolist(), float(b[row, 2])) for row in vertical
        )

    def step(self, x: PredictionState, u: PlanInput) -> PredictionState:
        """The state one tick later."""
        px, vx, ax, jx, sx = self._axis(x.p[0], x.v[0], x.a[0], x.j[0], x.s[0], u.a[0])
        py, vy, ay, jy, sy = self._axis(x.p[1], x.v[1], x.a[1], x.j[1], x.s[1], u.a[1])
        pz, vz, az = self._climb(x.p[2], x.v[2], x.a[2], u.a[2])
        dt = self._dt
        half = 0.5 * dt * dt
        (q1, q2), (qd1, qd2), (qdd1, qdd2) = x.q_arm, x.qd_arm, u.qdd_arm
        return PredictionState(
            (px, py, pz),
            (vx, vy, vz),
            (ax, ay, az),
            (jx, jy),
            (sx, sy),
            x.yaw + dt * x.yaw_rate + half * u.yaw_acc,
            x.yaw_rate + dt * u.yaw_acc,
            (q1 + dt * qd1 + half * qdd1, q2 + dt * qd2 + half * qdd2),
            (qd1 + dt * qdd1, qd2 + dt * qdd2),
        )

    def advance(self, x: PredictionState, u: PlanInput, ticks: int) -> PredictionState:
        """The state some ticks later under one input."""
        for _ in range(ticks):
            x = self.step(x, u)
        return x

    def _axis(
        self, p: float, v: float, a: float, j: float, s: float, u: float
    ) -> tuple[float, float, float, float, float]:
        rp, rv, ra, rj, rs = self._horizontal
        return (
            rp[0] * p + rp[1] * v + rp[2] * a + rp[3] * j + rp[4] * s + rp[5] * u,
            rv[1] * v + rv[2] * a + rv[3] * j + rv[4] * s + rv[5] * u,
            ra[2] * a + ra[3] * j + ra[4] * s + ra[5] * u,
            rj[2] * a + rj[3] * j + rj[4] * s + rj[5] * u,
            rs[2] * a + rs[3] * j + rs[4] * s + rs[5] * u,
        )

    def _climb(self, p: float, v: float, a: float, u: float) -> Vec3:
        rp, rv, ra = self._vertical
        return (
            rp[0] * p + rp[1] * v + rp[2] * a + rp[3] * u,
            rv[1] * v + rv[2] * a + rv[3] * u,
            ra[2] * a + ra[3] * u,
        )
