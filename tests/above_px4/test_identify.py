"""PX4's lag found from the pushes, with the stand-in's loops as they are known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fsw.autopilot.control.px4_loops import Px4Tuning
from pandion.px4_identification import Manoeuvre, Pushed, identify
from pandion.px4_identify import GAINS, Identifier, NotIdentified
from tests.above_px4.flight import AbovePx4
from tests.above_px4.test_flights import still
from tests.px4_companion_stand_in import OFFBOARD, Gains

STEP_S = 0.004


def pushed(true: Px4Tuning, noise: float = 0.0) -> list[Pushed]:
    """A point that follows the pushes with a lag that is known, by Euler's rule."""
    rng = np.random.default_rng(1)
    manoeuvre = Manoeuvre()
    p, v, a, j = np.zeros((4, 2))
    s = np.zeros(2)
    for k in range(round(manoeuvre.seconds / STEP_S)):
        f = 9.81
        q = (1.0, 0.5 * a[1] / f, -0.5 * a[0] / f, 0.0)
        frame = Frame((k + 1) * STEP_S, (*p, -1.5), (*v, 0.0), q)
        wanted = manoeuvre.step(frame, ())  # type: ignore[arg-type]
        asked = np.array([wanted.p[:2], wanted.v[:2], wanted.a[:2]])
        for _ in range(4):
            error = asked[1] - v + true.position_gain * (asked[0] - p)
            c = asked[2] + true.velocity_gain * error - true.acceleration_gain * a
            dt = STEP_S / 4
            s = s + dt / true.delay * (true.tilt_kp * (c - a) - true.tilt_kd * j - s)
            j, a, v, p = j + dt * s, a + dt * j, v + dt * a, p + dt * v
    seen = manoeuvre.seen
    return [
        one._replace(lean=tuple(np.array(one.lean) + noise * rng.standard_normal(2)))
        for one in seen
    ]


class Frame:
    def __init__(self, t: float, p: Any, v: Any, q: Any) -> None:
        self.t_us, self.p_WB, self.v_WB = round(1e6 * t), p, v
        self.q_WB = tuple(np.array(q) / np.linalg.norm(q))


@pytest.mark.drawn(1)
@pytest.mark.parametrize(("kp", "kd", "delay"), [(119.0, 17.0, 0.02), (60.0, 14.0, 0.04)])
def test_a_lag_that_is_known_is_found(kp: float, kd: float, delay: float) -> None:
    true = replace(Px4Tuning(), tilt_kp=kp, tilt_kd=kd, delay=delay, velocity_integral=0.0)
    found = identify(pushed(true, noise=0.05), replace(Px4Tuning(), velocity_integral=0.0)).px4
    assert found.tilt_kp == pytest.approx(kp, rel=0.15)
    assert found.tilt_kd == pytest.approx(kd, rel=0.15)
    assert found.delay == pytest.approx(delay, abs=0.005)


@pytest.mark.long
def test_what_is_no_such_loop_is_refused() -> None:
    seen = [one._replace(lean=(0.3, -0.2)) for one in pushed(Px4Tuning())]
    rng = np.random.default_rng(2)
    seen = [one._replace(lean=tuple(rng.standard_normal(2))) for one in seen]
    assert "of the lean is not what such a loop does" in identify(seen, Px4Tuning()).refusal
    with pytest.raises(ValueError, match="too little"):
        identify(seen[:100], Px4Tuning())


def test_pushes_end_where_they_began_and_stay_small() -> None:
    places = np.array([one.asked[0] for one in pushed(Px4Tuning())])
    assert np.abs(places[-1] - places[0]).max() < 1e-9
    assert 0.1 < np.abs(places[:, :2]).max() < 0.25


class Identified(AbovePx4):
    """The harness with the manoeuvre in place of the autopilot."""

    over = False

    def _tick(self, frame: Any) -> None:
        if not hasattr(self, "identifier"):
            assert self.config is not None
            self.identifier = Identifier(self.config.airframe, self.inbox, self.texts.append)
        self.over = self.identifier.step(frame, self.link) or self.over


@pytest.mark.long
def test_the_stand_ins_loops_are_identified_in_flight() -> None:
    flight = Identified(still())
    flight.run(0.5)
    with pytest.raises(NotIdentified, match="too little"):
        flight.identifier.found({})
    assert flight.px4.switch(OFFBOARD)
    flight.run(flight.identifier.manoeuvre.seconds + 0.5)
    assert flight.over
    gains = Gains()
    values = (gains.xy_p, gains.xy_vel_p, gains.xy_vel_i, gains.xy_vel_d, gains.z_p,
              gains.z_vel_p, gains.z_vel_i)  # fmt: skip
    found = flight.identifier.found(dict(zip(GAINS, values, strict=True)))
    assert found.unexplained < 0.2
    # A real PX4 with these gains was found to be 73, 12.5 and 46 ms.
    assert found.px4.tilt_kp == pytest.approx(73.0, rel=0.2)
    assert found.px4.tilt_kd == pytest.approx(12.5, rel=0.2)
    assert found.px4.delay == pytest.approx(0.046, abs=0.015)
