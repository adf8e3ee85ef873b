"""The compiled plant against its obvious rival, in one run: a ratio, not a stop-watch."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from sitl.plant.vector import Array
from tests.sitl.free_motion import flown, tumbling
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from tests.sitl.state_view import StateView
from tests.sitl.vehicles import frictionless

STEPS = 200
ROUNDS = 60  # a quarter of a second: longer than another process takes a core at once


def _rival() -> Callable[[], None]:
    """RK4 in Python around Pinocchio's compiled articulated-body algorithm."""
    vehicle = frictionless()
    model = pinocchio_model(vehicle)
    data, load = model.createData(), np.zeros(8)
    view = StateView(tumbling(vehicle))
    q0 = configuration(view.p_WB, view.q_WB, view.q_arm)
    v0 = np.concatenate([view.v_WB, view.w_WB_B, view.qd_arm])

    def rate(q: Array, v: Array) -> Array:
        return np.asarray(pin.aba(model, data, q, v, load))

    def fly() -> None:
        q, v, h = q0, v0, 0.001
        for _ in range(STEPS):
            a1 = rate(q, v)
            v2 = v + 0.5 * h * a1
            a2 = rate(pin.integrate(model, q, 0.5 * h * v), v2)
            v3 = v + 0.5 * h * a2
            a3 = rate(pin.integrate(model, q, 0.5 * h * v2), v3)
            v4 = v + h * a3
            a4 = rate(pin.integrate(model, q, h * v3), v4)
            q = pin.integrate(model, q, h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4))
            v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)

    return fly


def _seconds(run: Callable[[], object]) -> float:
    began = time.perf_counter()
    run()
    return time.perf_counter() - began


def test_a_step_is_at_least_three_times_as_fast_as_pinocchio_under_python() -> None:
    vehicle, rival = frictionless(), _rival()
    start = tumbling(vehicle)
    flown(vehicle, start, 0.001, 0.001)
    # Interleaved, best of several: another process may take the core from either side.
    pairs = [
        (_seconds(rival), _seconds(lambda: flown(vehicle, start, 0.001 * STEPS, 0.001)))
        for _ in range(ROUNDS)
    ]
    theirs, ours = (1e6 * min(side) / STEPS for side in zip(*pairs, strict=True))
    print(f"\nper step: {ours:.2f} us, rival {theirs:.1f} us, ratio {theirs / ours:.1f}")
    assert theirs / ours >= 3.0
