"""Messages of the scenario's pilot, and when it gives up."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import pytest

from sitl.link.pilot import (
    MESSAGES_PER_STEP,
    TARGET_INTERVAL_US,
    FlightPlan,
    Phase,
    PilotState,
    flight_plan,
    listen,
    speak,
)
from sitl.link.pilot_messages import (
    Ack,
    Announce,
    Heard,
    PilotMessage,
    SendCommand,
    SendTarget,
)
from sitl.scenario import (
    Hold,
    Obstacle,
    Pilot,
    Scenario,
    ScenarioWall,
    Start,
    WayPoint,
    Workspace,
)
from sitl.shapes.ball import Ball
from sitl.shapes.vertical_cylinder import VerticalCylinder
from sitl.simulation import START_US, STEP_US
from sitl.trajectory import TrajectoryPoint

ARM, MODE, TAKE_OFF, LAND = 400, 176, 22, 21
WALLS = tuple(ScenarioWall(name, (-1.0, 0.0, 0.0), -1.0, 0.1) for name in ("a", "b", "c"))


def still(t_us: int) -> TrajectoryPoint:
    return TrajectoryPoint((1e-6 * t_us, 0.0, -1.0), (0.0,) * 3, (0.0,) * 3)


def plan(kind: str = "trajectory", **changes: object) -> FlightPlan:
    fields = {
        "name": "test",
        "duration_s": 10.0,
        "start": Start("airborne"),
        "pilot": Pilot(kind),  # type: ignore[arg-type]
        "trajectory": Hold((0.0, 0.0, -1.0)),
        **changes,
    }
    return flight_plan(Scenario(**fields), still, lambda t_us: 0.25)  # type: ignore[arg-type]


@dataclass
class Flight:
    """A pilot and a vehicle that answers by a table: command to MAV_RESULT."""

    plan: FlightPlan
    results: dict[int, int]
    state: PilotState = field(init=False)
    reported: list[tuple[int, PilotMessage]] = field(default_factory=list)
    t_us: int = START_US
    heard: Heard = field(default_factory=Heard)

    def __post_init__(self) -> None:
        self.state = PilotState(self.plan.first_phase)

    def fly(self, seconds: float) -> None:
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.state, messages = speak(self.plan, self.state, self.t_us)
            assert len(messages) <= MESSAGES_PER_STEP
            self.reported += [(self.t_us, message) for message in messages]
            acks = tuple(
                Ack(message.command, self.results[message.command])
                for message in messages
                if isinstance(message, SendCommand) and message.command in self.results
            )
            heard = self.heard._replace(acks=acks)
            self.state = listen(self.plan, self.state, heard, self.t_us)
            self.t_us += STEP_US

    def commands(self) -> list[tuple[int, int]]:
        return [(t, m.command) for t, m in self.reported if isinstance(m, SendCommand)]

    def targets(self) -> list[tuple[int, SendTarget]]:
        return [(t, m) for t, m in self.reported if isinstance(m, SendTarget)]


def test_the_safe_set_is_announced_first() -> None:
    flight = Flight(plan(walls=WALLS, workspace=Workspace(0.1, 0.2)), {ARM: 0, MODE: 0})
    flight.fly(0.01)
    first = [message for _, message in flight.reported[:4]]
    announced = [(m.index, m.count, m.number) for m in first if isinstance(m, Announce)]
    assert announced == [(0, 4, 0), (1, 4, 0), (2, 4, 0), (3, 4, 2)]
    assert flight.reported[3][0] == START_US


def test_walls_and_points_are_announced_as_one_set() -> None:
    branch = Obstacle("branch", (0.0, 1.0, -1.0), 0.1)
    flight = Flight(plan(walls=WALLS, obstacles=(branch,)), {ARM: 0, MODE: 0})
    flight.fly(0.01)
    first = [message for _, message in flight.reported[:4]]
    assert [(m.index, m.count) for m in first if isinstance(m, Announce)] == [
        (0, 4), (1, 4), (2, 4), (3, 4),
    ]  # fmt: skip
    assert first[3] == Announce(
        number=1,
        numbers=(0.0, 1.0, -1.0, 0.0),
        velocity=(0.0, 0.0, 0.0),
        clearance_m=0.1,
        keep_in=False,
        t_us=START_US,
        index=3,
        count=4,
    )


def test_zones_that_move_are_announced_ten_times_a_second_where_they_are() -> None:
    person = VerticalCylinder(
        name="person",
        clearance_m=0.1,
        north_east_m=(1.0, 2.0),
        radius_m=0.3,
        velocity_m_s=(0.5, 0.0, 0.0),
        starts_s=0.25,
    )
    flight = Flight(plan("none", walls=WALLS, zones=(person,)), {})
    flight.fly(0.55)
    heard = [(t, m) for t, m in flight.reported if isinstance(m, Announce)]
    assert len(heard) == 6 * 4
    assert {m.t_us - t for t, m in heard} == {0}
    seen = [(m.numbers[0], m.velocity[0]) for _, m in heard if m.number == 3]
    expected = [(1.0, 0.0)] * 3 + [(1.025, 0.5), (1.075, 0.5), (1.125, 0.5)]
    assert seen == [pytest.approx(pair) for pair in expected]


def test_a_set_of_64_takes_several_steps_and_is_one_set() -> None:
    zones = tuple(
        Ball(name=f"b{k}", clearance_m=0.1, centre_m=(9.0, k, -1.0), radius_m=0.1)
        for k in range(64)
    )
    flight = Flight(plan("none", zones=zones), {})
    flight.fly(0.1)
    assert [m.index for _, m in flight.reported if isinstance(m, Announce)] == list(range(64))


def test_a_zone_goes_from_way_point_to_way_point_and_stays() -> None:
    points = (
        WayPoint(1.0, (0.0, 0.0, 0.0)),
        WayPoint(3.0, (2.0, 0.0, 0.0)),
        WayPoint(4.0, (2.0, 1.0, 0.0)),
    )
    ball = Ball(
        name="b", clearance_m=0.1, centre_m=(0.0, 0.0, -1.0), radius_m=0.1, way_points=points
    )
    (zone,) = plan("none", zones=(ball,)).zones
    placed = [zone.at(t) for t in (0.0, 1.0, 2.0, 3.5, 9.0)]
    assert [at.numbers[:2] for at in placed] == [(0, 0), (0, 0), (1, 0), (2, 0.5), (2, 1)]
    assert [at.velocity[:2] for at in placed] == [(0, 0), (1, 0), (1, 0), (0, 1), (0, 0)]


def test_targets_arrive_a_second_and_a_half_ahead_without_gaps() -> None:
    flight = Flight(plan(walls=WALLS), {ARM: 0, MODE: 0})
    flight.fly(3.0)
    times = [message.t_us for _, message in flight.targets()]
    assert times[0] == START_US
    assert {after - before for before, after in itertools.pairwise(times)} == {TARGET_INTERVAL_US}
    settled = [(t, m) for t, m in flight.targets() if t > START_US + 10 * STEP_US]
    assert min(message.t_us - t for t, message in settled) >= 1_500_000
    assert flight.targets()[5][1].point == still(times[5])


def test_it_arms_and_then_asks_for_the_trajectory_once_its_points_are_there() -> None:
    flight = Flight(plan(walls=WALLS), {ARM: 0, MODE: 0})
    flight.fly(1.0)
    assert [command for _, command in flight.commands()] == [ARM, MODE]
    (_, asked) = (t for t, _ in flight.commands())
    ahead = max(message.t_us for t, message in flight.targets() if t <= asked)
    assert ahead >= asked + 1_500_000
    assert flight.state.refusal is None


def test_a_command_without_an_answer_is_repeated_twice_a_second() -> None:
    flight = Flight(plan(), {})
    flight.fly(2.0)
    times = [t for t, _ in flight.commands()]
    assert times == [START_US + n * 500_000 for n in range(4)]


@pytest.mark.parametrize("result", [2, 3, 4])
def test_a_denial_ends_the_run_with_the_vehicles_reason(result: int) -> None:
    flight = Flight(plan(), {ARM: result}, heard=Heard(texts=("no estimate",)))
    flight.fly(0.01)
    assert flight.state.refusal == "the vehicle refused to arm: no estimate"


def test_a_warning_in_the_same_step_is_not_the_reason_of_a_refusal() -> None:
    texts = ("not armed: the arm swings", "parameters contradict each other: all of them")
    flight = Flight(plan(), {ARM: 4}, heard=Heard(texts=texts))
    flight.fly(0.01)
    assert flight.state.refusal == "the vehicle refused to arm: not armed: the arm swings"


def test_a_vehicle_that_is_not_ready_yet_is_asked_again() -> None:
    flight = Flight(plan(), {ARM: 1})
    flight.fly(2.0)
    assert flight.state.refusal is None
    flight.results = {ARM: 0, MODE: 0}
    flight.fly(1.0)
    assert flight.state.phase is Phase.FOLLOWING


def test_asking_does_not_go_on_for_ever() -> None:
    flight = Flight(plan(), {ARM: 1})
    flight.fly(11.0)
    assert flight.state.refusal is not None


def test_silence_to_a_command_does_not_go_on_for_ever() -> None:
    flight = Flight(plan(), {})
    flight.fly(11.0)
    assert flight.state.refusal is not None


def test_a_hop_takes_off_hovers_lands_and_is_done_when_disarmed() -> None:
    flight = Flight(plan("hop"), {ARM: 0, TAKE_OFF: 0, LAND: 0}, heard=Heard(armed=True))
    flight.fly(1.0)
    assert [command for _, command in flight.commands()] == [ARM, TAKE_OFF]
    flight.heard = Heard(armed=True, height_m=1.2, speed_m_s=0.5)
    flight.fly(4.0)
    assert flight.state.phase is Phase.HOVER
    flight.heard = Heard(armed=True, height_m=1.5, speed_m_s=0.01)
    flight.fly(4.0)
    assert flight.commands()[-1][1] == LAND
    assert not flight.state.done
    flight.heard = Heard(armed=False)
    flight.fly(0.01)
    assert flight.state.done
    assert flight.targets() == []


def test_plan_none_leaves_the_flying_to_others() -> None:
    flight = Flight(plan("none", walls=WALLS), {})
    flight.fly(2.0)
    assert all(isinstance(message, Announce) for _, message in flight.reported)


def test_walls_are_announced_again_every_second_for_a_datagram_may_be_lost() -> None:
    flight = Flight(plan("none", walls=WALLS), {})
    flight.fly(2.0)
    times = [t_us for t_us, _ in flight.reported]
    assert times == [1_000_000] * len(WALLS) + [2_000_000] * len(WALLS)


def test_a_hop_that_disarms_in_the_air_is_not_done() -> None:
    flight = Flight(plan("hop"), {ARM: 0, TAKE_OFF: 0, LAND: 0})
    flight.heard = Heard(armed=True, height_m=0.3, speed_m_s=0.0)
    flight.fly(1.0)
    flight.heard = Heard(armed=True, height_m=1.5, speed_m_s=0.01)
    flight.fly(4.0)
    assert flight.commands()[-1][1] == LAND
    flight.heard = Heard(armed=False, height_m=1.2, speed_m_s=2.0)
    flight.fly(0.1)
    assert not flight.state.done


TRAJECTORY, HOLD = 4 << 16 | 11 << 24, 4 << 16 | 3 << 24


def test_a_vehicle_that_somebody_else_takes_off_the_trajectory_is_noticed() -> None:
    flight = Flight(plan(), {ARM: 0, MODE: 0})
    flight.fly(1.0)
    flight.heard = Heard(custom_mode=TRAJECTORY)
    flight.fly(0.1)
    flight.heard = Heard()
    flight.fly(0.1)
    assert flight.state.left is None
    flight.heard = Heard(custom_mode=HOLD)
    flight.fly(0.1)
    assert flight.state.left == "the vehicle left the trajectory for hold"
    assert flight.state.refusal is None
