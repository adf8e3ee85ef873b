"""Which rotor is named for how a vehicle moves; its motion is written out here, without a model."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from fsw.autopilot.control.actuator_watch import pause
from fsw.autopilot.control.cascade import in_hover
from fsw.autopilot.estimation.fusion_memory import at_start
from fsw.autopilot.flight.safety.damage_watch import DamageWatch
from fsw.autopilot.flight.state import Damage
from fsw.autopilot.model.actuator_health import HEALTHY, LIMP, SOUND, STUCK
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import ActuatorCommand, StateEstimate
from fsw.autopilot.tick_record import Tick, new_tick
from tests.fsw.autopilot.flight.in_flight import limits
from tests.fsw.records import changed

DT = 0.002
FAULT_S = 1.5
EACH = 3.5 * 9.81 / 4.0
LEVEL = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
HANGING = (0.0, 0.0)

Given = Callable[[float, int], float]  # thrust over command of a rotor (0 to 3) at a time [s]
WATCHER = DamageWatch(FlightConfig())


def estimate(t_s: float, rate: tuple[float, float, float], specific_force: float) -> StateEstimate:
    still = (0.0, 0.0, 0.0)
    t_us = round(1e6 * t_s)
    return StateEstimate(
        t_us, still, still, LEVEL, rate, 0.0, HANGING, (0.0, 0.0), specific_force=specific_force
    )


class Motion:
    """Four rotors that are commanded to hover, and what the base does."""

    def __init__(
        self,
        given: Given,
        watcher: DamageWatch = WATCHER,
        takeoff_s: float = 0.0,
        asked: Callable[[float, int], float] = lambda _t, _i: EACH,
        lag: float = 0.04,
        aloft: bool = False,
    ) -> None:
        """For the first ``takeoff_s`` [s] thrust rises from none, and the ground carries.

        Of each rotor a thrust is ``asked`` [N], and it follows with a ``lag`` [s]. Whoever is
        ``aloft`` has no ground near.
        """
        self.takeoff_s, self.asked, self.lag = takeoff_s, asked, lag
        self.given = given
        self.watcher = watcher
        self.damage = Damage()
        self.told_s = math.inf
        self.history: list[Damage] = []
        self.loops = in_hover(AIRFRAME, estimate(0.0, (0.0, 0.0, 0.0), 9.81))
        self.loops.watch.aloft = aloft

    def run(
        self,
        seconds: float,
        push: Callable[[float], float] = lambda _: 0.0,
        mass: float = 3.5,
        doubted: Callable[[float], bool] = lambda _: False,
    ) -> Damage:
        """Move for a while; ``push`` [m/s^2] along body -z. Nothing is seen while ``doubted``."""
        thrust, wx, wy = [EACH] * 4, 0.0, 0.0
        watch = self.loops.watch
        for k in range(round(seconds / DT)):
            t = k * DT
            share = min(t / self.takeoff_s, 1.0) if self.takeoff_s else 1.0
            each = tuple(share * self.asked(t, i) for i in range(4))
            commanded = ActuatorCommand(each, HANGING)
            loops = changed(self.loops, actuator_command=commanded, watch=watch)
            for i in range(4):
                thrust[i] += DT / self.lag * (self.given(t, i) * each[i] - thrust[i])
            rear, left, front, right = thrust
            # The body turns up to 1 rad/s in these tests: products of rates are left out.
            wx += DT * 0.3 * (left - right) / 0.307
            wy += DT * 0.3 * (front - rear) / 0.3
            felt = (9.81 if share < 1.0 else sum(thrust) / mass) + push(t)
            now = estimate(1.0 + t, (wx, wy, 0.0), felt)
            after = changed(loops, state_estimate=now)
            if doubted(t):
                pause(after.watch)
            else:
                self.damage = self.watcher.see(self.damage, loops, after, 1)
            watch = after.watch
            self.history.append(self.damage)
            if self.damage.rotor and self.told_s == math.inf:
                self.told_s = t - FAULT_S
        return self.damage


def weak(rotor: int, share: float) -> Given:
    return lambda t, i: share if i == rotor and t >= FAULT_S else 1.0


NAMES = ("rotor 1 (rear)", "rotor 2 (left)", "rotor 3 (front)", "rotor 4 (right)")


@pytest.mark.drawn(6)
@pytest.mark.parametrize("rotor", range(4))
@pytest.mark.parametrize(("share", "within_s"), [(0.7, 0.35), (0.5, 0.25), (0.3, 0.2)])
def test_the_weak_rotor_is_named_with_what_it_gives(
    rotor: int, share: float, within_s: float
) -> None:
    motion = Motion(weak(rotor, share))
    damage = motion.run(FAULT_S + 1.0)
    assert damage.rotor.startswith(NAMES[rotor])
    assert 0.0 < motion.told_s <= within_s
    assert damage.report.effect == pytest.approx(share, abs=0.05)
    assert damage.health.effectiveness[rotor] == damage.report.effect
    assert not damage.report.lost
    assert not damage.report.disobeys


def test_it_is_said_since_when() -> None:
    motion = Motion(weak(1, 0.6))
    damage = motion.run(FAULT_S + 0.6)
    begin_s = 1e-6 * damage.rotor_us - 1.0
    assert FAULT_S < begin_s < FAULT_S + motion.told_s


@pytest.mark.parametrize("rotor", range(4))
def test_a_rotor_that_gives_nothing_is_lost(rotor: int) -> None:
    damage = Motion(weak(rotor, 0.0)).run(FAULT_S + 0.4)
    assert damage.report.lost
    assert damage.rotor == f"{NAMES[rotor]} gives nothing"


def test_a_rotor_that_is_gone_for_a_moment_is_not_lost() -> None:
    gone = Motion(lambda t, i: 0.0 if i == 2 and FAULT_S <= t < FAULT_S + 0.2 else 1.0)
    damage = gone.run(FAULT_S + 1.0)
    assert damage.rotor.startswith("rotor 3")
    assert not damage.report.lost


@pytest.mark.parametrize(
    ("given", "wrong"),
    [
        (weak(2, 0.5), ("effect", 0.5)),
        (weak(2, 0.0), ("lost", True)),
        (lambda t, i: 1.0 + 0.6 * math.sin(9.0 * t) if i == 2 and t >= FAULT_S else 1.0,
         ("disobeys", True)),
    ],
    ids=["weak", "lost", "disobeys"],
)  # fmt: skip
def test_a_rotor_that_is_known_to_be_bad_stays_so_while_sensors_are_doubted(
    given: Given, wrong: tuple[str, float]
) -> None:
    found_s = FAULT_S + 1.0
    motion = Motion(given)
    motion.run(found_s + 1.5, doubted=lambda t: found_s - 0.02 <= t < found_s)
    name, value = wrong
    for damage in motion.history[round(found_s / DT) :]:
        assert damage.rotor.startswith(NAMES[2])
        assert getattr(damage.report, name) == pytest.approx(value, abs=0.15)


def test_while_nothing_has_failed_the_watch_starts_anew_after_a_doubt() -> None:
    motion = Motion(lambda _t, _i: 1.0)
    assert motion.run(0.2) == Damage()
    sound = new_tick(3.5, 4, 2).watch
    sound.running, sound.torque[:] = 5.0, 1.0
    limp = sound.copy()
    limp.joint[1] = LIMP
    pause(sound)
    assert sound == new_tick(3.5, 4, 2).watch
    pause(limp)
    assert limp.joint[:2].tolist() == [SOUND, LIMP]
    assert limp.running == 0.0
    assert not limp.torque.any()


@pytest.mark.parametrize(
    ("first", "second"), [(0, 2), (0, 1), (3, 1), (3, 2)], ids=lambda k: NAMES[k][6:]
)
def test_a_second_rotor_that_gives_nothing_is_lost(first: int, second: int) -> None:
    lost_s = FAULT_S + 1.0

    def given(t: float, i: int) -> float:
        if i == second:
            return 0.0 if t >= lost_s else 1.0
        return 0.7 if i == first and t >= FAULT_S else 1.0

    motion = Motion(given)
    damage = motion.run(lost_s + 0.4)
    assert motion.history[round(lost_s / DT)].rotor.startswith(NAMES[first])
    assert damage.rotor == f"{NAMES[second]} gives nothing"
    assert damage.report.lost
    assert 1e-6 * damage.rotor_us - 1.0 == pytest.approx(lost_s, abs=0.15)
    assert not any(one.report.disobeys for one in motion.history)


@pytest.mark.parametrize("share", [1.0, 0.6])
def test_beside_a_weak_rotor_pushes_and_another_weak_one_lose_nothing(share: float) -> None:
    random = np.random.default_rng(3).uniform(-0.8, 0.8, 100)
    motion = Motion(lambda t, i: {0: 0.7, 2: share}.get(i, 1.0) if t >= FAULT_S + i else 1.0)
    motion.run(FAULT_S + 3.0, lambda t: float(random[int(10.0 * t)]))
    assert motion.history[round((FAULT_S + 1.0) / DT)].rotor.startswith(NAMES[0])
    assert not any(one.report.lost or one.report.disobeys for one in motion.history)


@pytest.mark.drawn(3)
@pytest.mark.requirement("REQ-ACT-1")
@pytest.mark.parametrize("rotor", range(4))
@pytest.mark.parametrize("left", [0.8, 0.6, 0.45])
def test_a_battery_that_sags_beside_a_weak_rotor_is_no_lost_one(rotor: int, left: float) -> None:
    def given(t: float, i: int) -> float:
        share = left if t >= FAULT_S + 1.0 else 1.0
        return 0.55 * share if i == rotor and t >= FAULT_S else share

    motion = Motion(given)
    motion.run(FAULT_S + 2.5)
    assert motion.history[round((FAULT_S + 1.0) / DT)].rotor.startswith(NAMES[rotor])
    assert not any(one.report.lost for one in motion.history)
    assert {one.report.rotor for one in motion.history} == {0, rotor + 1}


def test_a_rotor_that_gives_too_much_does_not_obey_and_is_counted_on_as_it_is() -> None:
    def stuck(t: float, i: int) -> float:
        return 1.0 + 0.6 * math.sin(9.0 * t) if i == 0 and t >= FAULT_S else 1.0

    damage = Motion(stuck).run(FAULT_S + 1.0)
    assert damage.report.disobeys
    assert damage.rotor == "rotor 1 (rear) does not obey"
    assert damage.health.least[0] == damage.health.most[0] > 0.0
    assert damage.severe


@pytest.mark.parametrize("rotor", range(4))
def test_what_lifts_a_vehicle_high_above_the_ground_is_not_the_ground(rotor: int) -> None:
    """For a second after a push nothing was judged; a late rotor and a limp joint push like it."""

    def lifts(t: float) -> float:
        return 5.0 if FAULT_S - 0.6 < t < FAULT_S - 0.4 else 0.0

    high, low = Motion(weak(rotor, 0.5), aloft=True), Motion(weak(rotor, 0.5))
    assert high.run(FAULT_S + 0.3, push=lifts).rotor.startswith(NAMES[rotor])
    assert not low.run(FAULT_S + 0.3, push=lifts).rotor


def test_a_weak_rotor_that_is_well_again_is_forgotten() -> None:
    motion = Motion(lambda t, i: 0.7 if i == 3 and FAULT_S <= t < FAULT_S + 0.6 else 1.0)
    assert motion.run(FAULT_S + 0.6).rotor
    motion = Motion(motion.given)
    damage = motion.run(FAULT_S + 5.0)
    assert not damage.rotor
    assert damage.health is HEALTHY


@pytest.mark.parametrize("mass", [2.8, 3.5, 4.2])
def test_pushes_and_another_mass_name_no_rotor(mass: float) -> None:
    random = np.random.default_rng(3).uniform(-0.8, 0.8, 100)
    healthy = Motion(lambda _t, _i: 1.0)
    assert healthy.run(6.0, lambda t: float(random[int(10.0 * t)]), mass) == Damage()


def test_a_battery_that_sags_names_no_rotor() -> None:
    assert Motion(lambda t, _i: 1.0 - 0.05 * t).run(6.0) == Damage()


def test_two_rotors_that_change_together_are_no_single_one() -> None:
    """As a gust that turns the body, or an arm that is pulled: a torque without a lift."""
    turned = Motion(lambda t, i: {1: 0.8, 3: 1.2}.get(i, 1.0) if t >= FAULT_S else 1.0)
    assert not turned.run(FAULT_S + 0.5).rotor


@pytest.mark.drawn(6)
@pytest.mark.parametrize("lag", [0.04, 0.06, 0.08])
@pytest.mark.parametrize("rotor", range(4))
@pytest.mark.parametrize("swing", [3.0, 8.0])
def test_rotors_that_are_all_slow_name_none_while_the_vehicle_swings(
    rotor: int, swing: float, lag: float
) -> None:
    """Where one rotor is asked for more than the others, only that one shows its lag."""
    slow = Motion(
        lambda _t, _i: 1.0,
        asked=lambda t, i: EACH + (swing * math.sin(12.0 * t) if i == rotor else 0.0),
        lag=lag,
    )
    slow.run(5.0)
    assert not any(damage.rotor for damage in slow.history)


@pytest.mark.parametrize("rise_s", [1.0, 3.0])
def test_after_a_slow_take_off_a_lost_rotor_is_named_as_soon(rise_s: float) -> None:
    """What the ground carries while thrust rises is no error of the thrust that lasts."""
    lost_s = rise_s + 1.5
    motion = Motion(lambda t, i: 0.0 if i == 2 and t >= lost_s else 1.0, takeoff_s=rise_s)
    motion.run(lost_s + 0.3)
    assert not motion.history[round(lost_s / DT)].rotor
    assert motion.damage.rotor.startswith(NAMES[2])


def with_failed(kinds: tuple[float, float], for_s: float, t_s: float) -> Tick:
    """A record at a time [s] whose watch has found joints of these ``kinds`` for some time [s]."""
    r = in_hover(AIRFRAME, estimate(t_s, (0.0, 0.0, 0.0), 9.81))
    r.watch.joint[:2], r.watch.joint_for[:2] = kinds, for_s
    return r


def test_a_second_joint_that_fails_is_named_beside_the_first() -> None:
    damage, said = Damage(), []
    for k, kinds in enumerate([(STUCK, SOUND), (STUCK, LIMP), (LIMP, LIMP)]):
        loops = with_failed(kinds, 0.1, 5.0 + k)
        damage = WATCHER.see(damage, loops, loops.copy(), 1)
        said.append(damage.joint)
        assert damage.report.joints == damage.health.joints == kinds
    assert said == [
        "joint 1 does not move",
        "joint 1 does not move and joint 2 gives no torque",
        "joint 1 gives no torque and joint 2 gives no torque",
    ]
    assert damage.joint_us == 4_900_000, "when the first one failed"


@pytest.mark.parametrize("repeat", [True, False])
@pytest.mark.parametrize("kind", [LIMP, STUCK])
def test_a_joint_that_fails_and_stands_still_may_be_one_that_is_not_seen(
    kind: float, repeat: bool
) -> None:
    loops = with_failed((SOUND, kind), 0.1, 5.0)
    memory = at_start(2)
    memory.numbers["encoder_repeats"][0, :2] = (9.0, 9.0 if repeat else 0.0)
    damage = WATCHER.see(Damage(), loops, loops.copy(), 1, memory=memory)
    assert damage.joint.startswith("joint 2 ")
    assert ("joint encoders stuck" in damage.joint) is repeat


@pytest.mark.parametrize("stands", [(0,), (1,), (0, 1), ()], ids=str)
@pytest.mark.parametrize("contact", [1, 0])
def test_a_joint_that_does_not_yield_to_a_surface_stands(
    stands: tuple[int, ...], contact: int
) -> None:
    """The base is swung to and fro, and joints hold the tool, but for those that stand."""
    motion, along = Motion(lambda _t, _i: 1.0), np.array([0.3, 0.2])
    motion.run(1.5)
    loops, watch = motion.loops, motion.loops.watch
    for k in range(500):
        t, carried = 2.5 + k * DT, 0.3 * math.sin(9.0 * k * DT)
        qd = -along * carried / float(along @ along)
        qd[list(stands)] = 0.0
        now = estimate(t, (0.0, 0.0, 0.0), 9.81)._replace(qd_arm=(float(qd[0]), float(qd[1])))
        loops = changed(loops, watch=watch)
        after = changed(loops, state_estimate=now)
        at = after.pressing
        at.near, at.contact, at.speed = 1, contact, -carried - float(along @ qd)
        at.along[:2] = along
        motion.damage = WATCHER.see(motion.damage, loops, after, 1)
        watch = after.watch
    found = {k for k in range(2) if watch.joint[k] == STUCK}
    assert found == (set(stands) if contact else set())


def test_allocation_is_left_alone_where_that_is_asked_for() -> None:
    ignoring = DamageWatch(limits(failed_rotor_mode=0))
    damage = Motion(weak(1, 0.6), ignoring).run(FAULT_S + 0.6)
    assert damage.rotor
    assert damage.health is HEALTHY
