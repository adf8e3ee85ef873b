"""Which tuning a tick flies: the one in its state, whatever was asked for or made ready."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.plan_exchange import nominal_at_rest
from fsw.autopilot.flight.state import FlightState, first_state
from fsw.autopilot.flight.tuned_autopilot import TunedAutopilot
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.signals import (
    MissionUpdate,
    Mode,
    SafeSet,
    SensorFrame,
    Severity,
    TickInputs,
    TickOutputs,
    Vec3,
)
from fsw.autopilot.tuning import Tuning, tuned
from tests.fsw.autopilot.flight.in_flight import CONFIG, flying, vehicle_at
from tests.fsw.autopilot.flight.test_autopilot import frame as frame_at
from tests.fsw.records import with_record

STILL: Vec3 = (0.0, 0.0, 0.0)
HERE: Vec3 = (0.0, 0.0, -5.0)
SLOW: Tuning = (("limits.mission_speed", 0.2), ("planner.weights.tracking", 12.0))
UNSAFE: Tuning = (("planner.walls.lambda_", 0.1),)
WALLED = SafeSet((wall((-1.0, 0.0, 0.0), -50.0, 0.1),))
SOFT = replace(CONFIG, soft=True)


def tick(
    loop: TunedAutopilot, state: FlightState, tuning: Tuning | None = None
) -> tuple[FlightState, TickOutputs]:
    """One tick in the air, at a planning instant, with a tuning that is asked for."""
    frame = SensorFrame(
        t_us=state.t_us + CONFIG.mpc_period_us,
        p_WB=HERE,
        v_WB=STILL,
        q_WB=(1.0, 0.0, 0.0, 0.0),
        gyro_B=STILL,
        accel_B=(0.0, 0.0, -9.81),
        q_arm=(0.0, 0.0),
        qd_arm=(0.0, 0.0),
    )
    return loop.tick(state, TickInputs(frame, tuning=tuning))


def walled(mode: Mode = Mode.HOLD) -> FlightState:
    state = flying(mode)
    return replace(state, mission=replace(state.mission, safe_set=WALLED))


def test_a_tuning_is_flown_from_the_tick_on_that_takes_it() -> None:
    loop = TunedAutopilot(CONFIG)
    state, outputs = tick(loop, walled())
    assert (loop.config, outputs.tuning_taken) == (CONFIG, None)
    state, outputs = tick(loop, state, SLOW)
    assert (loop.config, outputs.tuning_taken) == (tuned(CONFIG, SLOW), True)
    state, outputs = tick(loop, state)
    assert (loop.config, state.tuning, outputs.tuning_taken) == (tuned(CONFIG, SLOW), SLOW, None)
    _, outputs = tick(loop, state, ())
    assert (loop.config, outputs.tuning_taken) == (CONFIG, True)


def test_the_same_state_is_flown_alike_by_a_loop_that_never_saw_its_tuning() -> None:
    state, _ = tick(TunedAutopilot(CONFIG), walled(), SLOW)
    fresh = TunedAutopilot(CONFIG)
    tick(fresh, state)
    assert fresh.config == tuned(CONFIG, SLOW)


def test_the_planner_is_asked_with_its_part_of_the_tuning() -> None:
    loop, requests = TunedAutopilot(CONFIG), []
    state = replace(walled(), index=0)
    state = with_record(state, plan_state=nominal_at_rest(vehicle_at(HERE)))
    for tuning in (None, SLOW, None):
        for _ in range(5):
            state, outputs = tick(loop, state, tuning)
            if outputs.plan_request is not None:
                requests.append(outputs.plan_request.tuning)
                break
    assert requests == [(), (("weights.tracking", 12.0),), (("weights.tracking", 12.0),)]


@pytest.mark.parametrize(
    ("config", "mode", "taken"),
    [(CONFIG, Mode.HOLD, False), (CONFIG, Mode.DISARMED, True), (SOFT, Mode.HOLD, True)],
    ids=["armed", "disarmed", "soft"],
)
def test_what_breaks_an_inequality_is_not_taken_while_armed_unless_softly(
    config: FlightConfig, mode: Mode, taken: bool
) -> None:
    loop = TunedAutopilot(config)
    state, outputs = tick(loop, walled(mode), UNSAFE)
    assert outputs.tuning_taken is taken
    assert state.tuning == (UNSAFE if taken else ())
    begins = {
        text.text.partition(": ")[0] for text in outputs.texts if text.severity is Severity.WARNING
    }
    contradict = Condition.PARAMETERS_CONTRADICT.value
    assert ("refused while armed" in begins) is not taken
    assert (contradict in begins) is (mode is Mode.DISARMED), "told once, by its row"
    # Disarmed it stands against arming from now on.
    assert bool(state.mission.refusals) is (mode is Mode.DISARMED)


@pytest.mark.requirement("REQ-SAFE-9")
@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.DISARMED])
@pytest.mark.parametrize(
    ("path", "value", "waits"),
    [
        ("limits.safe_set_owner", 66.0, True),
        ("planner.body", 0.0, True),
        ("limits.fence_action", 4.0, True),
        ("limits.station_loss_action", 5.0, True),
        ("limits.fence_action", 5.0, False),
        ("surroundings.disturbance", 0.0, True),
        # References and estimates jumped, by metres and degrees.
        ("limits.land_speed", 0.6, True),
        ("limits.climb_speed", 1.5, True),
        ("steering.highest", 2.0, True),
        ("estimator.pose.attitude_floor", 1.0, True),
        ("estimator.gnss.delay", 0.2, True),
    ],
)
def test_what_would_let_anybody_end_the_flight_waits_for_disarming(
    path: str, value: float, waits: bool, mode: Mode
) -> None:
    """A stranger became the owner, had rotors fly into a wall that was kept, had it terminate."""
    loop = TunedAutopilot(flight_config(body="full"))
    _, outputs = tick(loop, walled(mode), ((path, value),))
    armed = mode is Mode.HOLD
    assert outputs.tuning_taken is not (waits and armed)
    assert any("while disarmed" in one.text for one in outputs.texts) is (waits and armed)


@pytest.mark.requirement("REQ-SAFE-9")
@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.DISARMED])
@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("tuning.tracking.jerk_limit", 2.0),
        ("tuning.tracking.acceleration_limit", 0.5),
        ("planner.walls.lambda_", 0.1),
        ("tuning.tracking.input_weight", 1.3e-7),  # uses 106 % of a limit: a warning on the ground
    ],
)
def test_while_armed_no_promise_becomes_weaker(path: str, value: float, mode: Mode) -> None:
    """A vehicle that was not let jerk flew into the wall, with a warning."""
    loop = TunedAutopilot(CONFIG)
    _, outputs = tick(loop, walled(mode), ((path, value),))
    assert outputs.tuning_taken is (mode is Mode.DISARMED)
    assert any("refused while armed" in one.text for one in outputs.texts) is (mode is Mode.HOLD)


def test_what_is_broken_already_is_no_reason_against_another_change() -> None:
    loop = TunedAutopilot(CONFIG)
    on_ground, _ = tick(loop, walled(Mode.DISARMED), UNSAFE)
    armed = replace(on_ground, vehicle=replace(on_ground.vehicle, mode=Mode.HOLD))
    both = (*UNSAFE, ("limits.mission_speed", 0.2))
    state, outputs = tick(loop, armed, both)
    assert (state.tuning, outputs.tuning_taken) == (both, True)


def test_what_was_made_ready_is_flown_without_being_made_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    loop = TunedAutopilot(CONFIG)
    loop.prepare(SLOW)
    assert loop.config == CONFIG

    def forbidden(_config: FlightConfig) -> Autopilot:
        pytest.fail("a loop was designed within a tick")

    monkeypatch.setattr("fsw.autopilot.flight.tuned_autopilot.Autopilot", forbidden)
    state, outputs = tick(loop, walled(), SLOW)
    tick(loop, state)
    assert (loop.config, outputs.tuning_taken) == (tuned(CONFIG, SLOW), True)


def test_a_safe_set_that_cannot_be_kept_is_flown_softly_alone() -> None:
    loop = TunedAutopilot(CONFIG)
    assert _fence_refused(loop) == ""
    soft = TunedAutopilot(tuned(SOFT, UNSAFE))
    hard = TunedAutopilot(tuned(CONFIG, UNSAFE))
    assert _fence_refused(soft) == ""
    assert "it cannot be kept" in _fence_refused(hard)


def _fence_refused(loop: TunedAutopilot) -> str:
    """What the tick says against a fence that is uploaded on the ground."""
    inputs = TickInputs(frame_at(1_000_000), mission=MissionUpdate(fence=WALLED))
    state, outputs = loop.tick(first_state(CONFIG.airframe), inputs)
    told = [text.text for text in outputs.texts if "refused" in text.text]
    assert outputs.upload_taken is not bool(told)
    assert state.mission.fence == (SafeSet() if told else WALLED)
    return "".join(told)


def test_the_loop_of_another_tuning_is_made_without_asking_for_types_or_gains_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """numba's types of records and the gains of braking took a tenth of a second, not 5 ms."""
    loop = TunedAutopilot(CONFIG)

    def asked(*_: object) -> None:
        raise AssertionError("it is known already")

    monkeypatch.setattr("numba.np.numpy_support.from_struct_dtype", asked)
    monkeypatch.setattr("fsw.autopilot.control.braking.solve_continuous_are", asked)
    loop.prepare(SLOW)
