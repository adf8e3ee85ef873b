"""Who is named wrong when sensors contradict each other, and who is not."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fsw.autopilot.estimation.error_state import (
    CONTRADICTED,
    FILTER,
    HEIGHT_LASTS,
    NO_FORCE,
    NO_HEADING,
    ON_TRIAL,
)
from fsw.autopilot.estimation.faults import residuals, sources
from fsw.autopilot.estimation.faults.residuals import EVERY, NO_AID, Aid, Evidence, look
from fsw.autopilot.estimation.faults.sources import Source
from fsw.autopilot.estimation.faults.verdict import UNDECIDED, Verdict, judged, lifted
from fsw.autopilot.geometry.quaternion import turned
from fsw.autopilot.geometry.rotation import matrix_from_quaternion, rotate, rotate_back
from fsw.autopilot.signals import Vec3, Vec4

TICK = 0.002
G = 9.81
FIELD = (0.2148, 0.0109, 0.4321)  # Gauss, NED
SETTLED = 4.0  # s, before anything is wrong
FEW = 2 if settings.default.max_examples < 100 else 20  # a half second of one core each
NONE: Vec3 = (0.0, 0.0, 0.0)
# What is read of the filter's record, in which Python finds a field slowly.
WITNESSED = ("witness", "newest", "baseline", "bias")


class Wrong(NamedTuple):
    """By how much a source is off from ``SETTLED`` on, for good."""

    gyro: Vec3 = NONE  # rad/s
    accelerometer: Vec3 = NONE  # m/s^2
    push: Vec3 = NONE  # m/s^2, NED, that the model does not know
    turns: bool = False  # the push lasted, and turns
    blow: Vec3 = NONE  # rad/s, at once, that the model does not know
    turning: Vec3 = NONE  # rad/s, of the pose's attitude
    gaining: Vec3 = NONE  # m/s^2, of the measured place
    magnetic: Vec3 = NONE  # rad/s, of the field
    iron: Vec3 = NONE  # Gauss, body
    outlier: Vec3 = NONE  # m, of one place of satellites, after which the next one is lost
    garbage: float = 0.0  # m/s, up to which velocities of satellites are anything, and places are


def flown(
    wrong: Wrong,
    suite: str,
    seconds: float,
    seed: int = 1,
    yaw: float = 0.0,
    swing: float = 0.0,
    axes: float = 0.0,
    sigma: float = 0.015,
    bias: Vec3 = NONE,
    evidence: Evidence | None = None,
) -> list[Verdict]:
    """Verdicts of all looks at a vehicle that sways, beside which the ``wrong`` is added.

    It turns about its vertical at up to a rate ``yaw`` [rad/s], and its arm makes torques of pushes
    of up to 0.8 m/s^2: ``swing`` [rad/m]. The gyro's axes are off by ``axes`` [rad].
    Satellites say that places are known to ``sigma`` [m]. Of a ``bias`` [rad/s] of the gyro the
    filter knows nothing as it begins, and nearly all after a second.
    """
    random = np.random.default_rng(seed)
    x: Any = np.zeros(1, FILTER)
    evidence = residuals.at_start() if evidence is None else evidence
    verdict, found = Verdict(), []
    evidence["began"], x["turns"] = -1.0, residuals.scale_of_turns(1.0, swing)
    s: Any = SimpleNamespace(
        **{name: x[name][0] for name in WITNESSED},
        suspect=0,
        out=0,
        time=0.0,
        height_time=0.0,
    )
    blown, torque = np.zeros(3), np.zeros(3)
    p, v, q, spun = np.array([0.0, 0.0, -1.2]), np.zeros(3), (1.0, 0.0, 0.0, 0.0), np.zeros(3)
    place_off, turn_off, field_off = np.zeros(3), np.zeros(3), np.zeros(3)
    speed_off = np.zeros(3)
    for tick in range(round((SETTLED + seconds) / TICK)):
        now, late = TICK * tick, TICK * tick > SETTLED
        w = 0.1 * np.sin(now * np.array([1.3, 1.7, 0.9]) + (0.0, 1.0, 2.0))
        w += (0.0, 0.0, yaw * math.sin(0.5 * now))
        if swing and tick % 50 == 0:
            torque = 0.8 * swing * random.uniform(-1.0, 1.0, 3) * (1.0, 1.0, 0.0)
        rates = w + blown + (np.array(wrong.blow) if late else 0.0)
        against = -6.0 * blown  # by the rotors
        blown += TICK * (torque + against)
        alpha = (w - spun) / TICK + against
        spun = w
        q = turned(q, *(TICK * rates))
        R = matrix_from_quaternion(q)
        pushed = 1.0 if late else -1.0 if wrong.turns else 0.0
        gust = 0.4 * random.uniform(-1.0, 1.0, 3) + pushed * np.array(wrong.push)
        thrust = G + 0.3 * math.sin(now)
        a = np.array(rotate(R, (0.0, 0.0, -thrust))) + (0.0, 0.0, G) + gust
        p, v = p + TICK * v, v + TICK * a
        force = np.array(rotate_back(R, tuple(gust))) - (0.0, 0.0, thrust)
        said = rates + np.cross((axes, 0.0, 0.0), rates) + 0.01 * random.standard_normal(3) + bias
        felt = force + 0.5 * random.standard_normal(3)
        if late:
            said, felt = said + wrong.gyro, felt + wrong.accelerometer
            turn_off += TICK * np.array(wrong.turning)
            field_off += TICK * np.array(wrong.magnetic)
            speed_off += TICK * np.array(wrong.gaining)
            place_off += TICK * speed_off
        s.newest[:3], s.newest[3:] = felt, said
        s.bias[3:] = (1.0 - math.exp(-now / 0.3)) * np.array(bias)
        s.suspect = ON_TRIAL if verdict.is_on or verdict.wrong else 0
        s.suspect |= CONTRADICTED if verdict.contradicts else 0
        residuals.witness(s, R, TICK, (*alpha.tolist(), thrust), NONE)  # type: ignore[arg-type]
        if tick % round(EVERY / TICK):
            continue
        pose: Aid = NO_AID
        fix: Aid = NO_AID
        field: Aid = NO_AID
        if suite == "pose":
            noisy = turned(q, *(turn_off + 2e-3 * random.standard_normal(3)))
            where = tuple((p + place_off + 1e-3 * random.standard_normal(3)).tolist())
            pose = (True, now, where, noisy, 2e-3, 2e-3)  # type: ignore[assignment]
        else:
            since = round((now - SETTLED) / 0.1) if late and any(wrong.outlier) else 0
            if tick % 50 == 0 and since != 6:
                off = place_off + (np.array(wrong.outlier) if since == 5 else 0.0)
                where = tuple((p + off + 0.01 * random.standard_normal(3)).tolist())
                fast = (v + speed_off + 0.03 * random.standard_normal(3)).tolist()
                if late and wrong.garbage:
                    where = tuple(random.uniform(-100.0, 100.0, 3).tolist())
                    fast = random.uniform(-wrong.garbage, wrong.garbage, 3).tolist()
                fix = (True, now, where, (*fast, 0.0), sigma, 0.1)  # type: ignore[assignment]
            seen = matrix_from_quaternion(turned(q, *field_off))
            body = np.array(rotate_back(seen, FIELD)) + 3e-3 * random.standard_normal(3)
            body += np.array(wrong.iron)
            field = (True, now, tuple(body.tolist()), (1.0, 0.0, 0.0, 0.0), 0.01, 0.0)  # type: ignore[assignment]
        look(evidence, x, now, pose, fix, field, not verdict.is_on)
        ratios = tuple(evidence[0]["ratio"].tolist())
        sizes = tuple(evidence[0]["size"].tolist())
        headed = tuple(evidence[0]["headed"].tolist())
        held = suite == "pose"
        verdict = judged(verdict, ratios, now, holds_attitude=held, sizes=sizes, headed=headed)
        found.append(verdict)
    return found


def named(verdicts: list[Verdict]) -> Source:
    """All that was named, the rotors' model included."""
    total = Source(0)
    for one in verdicts:
        total |= one.wrong | one.named
    return total


def suspected(verdicts: list[Verdict]) -> Source:
    total = Source(0)
    for one in verdicts:
        total |= one.suspects | one.wrong
    return total


directions = st.sampled_from([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.6, 0.52)])
suites = st.sampled_from(["pose", "satellites"])


def along(direction: Vec3, size: float) -> Vec3:
    x, y, z = direction
    return size * x, size * y, size * z


@pytest.mark.drawn(2)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("suite", ["pose", "satellites"])
def test_nobody_is_suspected_while_all_are_well(suite: str, seed: int) -> None:
    assert not suspected(flown(Wrong(), suite, 6.0, seed))


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
def test_a_gyro_whose_axes_are_off_is_well_however_long_the_vehicle_turns_on() -> None:
    """hexa-3r was held between walls: it turned on by 0.8 rad in 3 s."""
    assert not suspected(flown(Wrong(), "pose", 8.0, yaw=0.6, axes=0.01))


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("seed", range(3))
def test_a_bias_that_the_filter_finds_as_it_begins_is_no_gyro_s_fault(seed: int) -> None:
    """A probe's began in the air, and the pose was compared with half of what was known by then."""
    assert not suspected(flown(Wrong(), "pose", 3.0, seed, bias=(0.008, -0.016, 0.008)))


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("suite", ["pose", "satellites"])
def test_pushes_that_turn_a_light_body_by_its_heavy_arm_are_no_gyro_s_fault(
    suite: str, seed: int
) -> None:
    """They do by 2.2 rad/m of hexa-3r, fifteen times the paper's."""
    assert not suspected(flown(Wrong(), suite, 6.0, seed, swing=2.2))


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("size", [0.2, 0.4, 0.6, 2.0])
def test_one_reflection_names_no_satellites_though_the_next_place_is_lost(size: float) -> None:
    """The one place counted twice: 4 of 20 flights in the field came down for it."""
    verdicts = flown(Wrong(outlier=along((0.6, 0.6, 0.52), size)), "satellites", 2.0)
    assert not suspected(verdicts)


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("seed", range(3))
def test_garbage_of_satellites_accuses_nobody(seed: int) -> None:
    """It was compared with the others wherever a place of metres followed: the gyro was named."""
    verdicts = flown(Wrong(garbage=20.0), "satellites", 3.5, seed, sigma=2.0)
    assert not suspected(verdicts)


@pytest.mark.requirement("REQ-EST-13")
@settings(deadline=None, max_examples=FEW, phases=[Phase.generate])
@given(suite=suites, direction=directions, size=st.floats(0.3, 8.0), seed=st.integers(0, 99))
def test_a_gyro_that_is_off_is_named_whatever_its_size(
    suite: str, direction: Vec3, size: float, seed: int
) -> None:
    verdicts = flown(Wrong(gyro=along(direction, size)), suite, 1.2, seed)
    assert named(verdicts) == Source.GYRO


@pytest.mark.requirement("REQ-EST-13")
@settings(deadline=None, max_examples=FEW, phases=[Phase.generate])
@given(suite=suites, direction=directions, size=st.floats(2.5, 30.0), seed=st.integers(0, 99))
def test_an_accelerometer_that_is_off_is_named_whatever_its_size(
    suite: str, direction: Vec3, size: float, seed: int
) -> None:
    verdicts = flown(Wrong(accelerometer=along(direction, size)), suite, 2.5, seed)
    assert named(verdicts) == Source.ACCELEROMETER


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
@settings(deadline=None, max_examples=5, phases=[Phase.generate])
@given(suite=suites, size=st.floats(2.5, 8.0), seed=st.integers(0, 99))
def test_a_gust_is_no_sensor_s_fault(suite: str, size: float, seed: int) -> None:
    verdicts = flown(Wrong(push=(size, 0.0, 0.0)), suite, 3.0, seed)
    assert named(verdicts) == Source.MODEL


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("suite", ["pose", "satellites"])
@pytest.mark.parametrize("turns", [False, True])
def test_a_push_that_is_allowed_puts_no_sensor_in_doubt(suite: str, turns: bool) -> None:
    verdicts = flown(Wrong(push=(0.9, 0.7, 0.0), turns=turns), suite, 3.0, 3)
    assert suspected(verdicts) in (Source(0), Source.MODEL)


@pytest.mark.requirement("REQ-EST-7")
@settings(deadline=None, max_examples=FEW, phases=[Phase.generate])
@given(size=st.floats(0.5, 4.0), seed=st.integers(0, 99))
def test_a_blow_is_no_gyro_s_fault(size: float, seed: int) -> None:
    verdicts = flown(Wrong(blow=(0.0, size, 0.0)), "pose", 1.0, seed)
    assert named(verdicts) == Source.MODEL


@pytest.mark.requirement("REQ-EST-13")
@settings(deadline=None, max_examples=FEW, phases=[Phase.generate])
@given(direction=directions, size=st.floats(1.0, 6.0), seed=st.integers(0, 99))
def test_a_frame_that_turns_is_suspected_and_the_accelerometer_is_not(
    direction: Vec3, size: float, seed: int
) -> None:
    """Degrees a second: nothing but the gyro says otherwise, so both stay suspects."""
    turning = along(direction, math.radians(size))
    verdicts = flown(Wrong(turning=turning), "pose", 5.0, seed)
    assert suspected(verdicts) & Source.ATTITUDE
    assert not named(verdicts) & ~(Source.ATTITUDE | Source.GYRO)


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
def test_a_frame_that_gains_speed_is_named() -> None:
    verdicts = flown(Wrong(gaining=(0.0, 3.0, 0.0)), "pose", 3.0)
    assert named(verdicts) == Source.POSE


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
def test_a_slow_turn_stays_undecided_for_long_and_is_over_when_it_ends() -> None:
    verdicts = flown(Wrong(turning=(0.0, 0.0, math.radians(1.0))), "pose", 6.0)
    last = verdicts[-1]
    assert last.contradicts
    assert last.suspects == Source.ATTITUDE | Source.GYRO
    now = EVERY * len(verdicts)
    assert now - last.since > UNDECIDED


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("iron", [(0.015, 0.0, 0.0), (0.0, -0.012, 0.012)])
def test_iron_that_turns_with_the_vehicle_is_nobody_s_fault(iron: Vec3) -> None:
    for seed in range(2):
        verdicts = flown(Wrong(iron=iron), "satellites", 12.0, seed, yaw=1.0)
        assert not suspected(verdicts)


@pytest.mark.requirement("REQ-EST-13")
def test_where_rotors_half_know_it_the_field_is_suspected_and_not_the_gyro() -> None:
    ratios = [0.0] * sources.COUNT
    ratios[sources.GB], ratios[sources.MB] = 1.8, 0.7
    verdict = judged(Verdict(), tuple(ratios), 1.0, holds_attitude=False)
    assert verdict.suspects == Source.COMPASS
    ratios[sources.GM], ratios[sources.MB] = 1.3, 0.0
    verdict = judged(Verdict(), tuple(ratios), 1.0, holds_attitude=False)
    assert verdict.suspects & Source.GYRO


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("turning", [(2.0, 0.0, 0.0), (0.0, -1.5, 1.5)])
def test_a_field_that_turns_as_the_rotors_turn_nothing_is_named(turning: Vec3) -> None:
    """Gyro and field contradict each other, and the rotors know who is right."""
    verdicts = flown(Wrong(magnetic=turning), "satellites", 0.6)
    assert named(verdicts) == Source.COMPASS


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
@settings(deadline=None, max_examples=FEW, phases=[Phase.generate])
@given(direction=directions, size=st.floats(0.04, 0.3), seed=st.integers(0, 99))
def test_a_field_that_leaps_is_no_fault_of_a_gyro_that_agrees_with_the_rotors(
    direction: Vec3, size: float, seed: int
) -> None:
    """A gyro that is off by so much would show beside the rotors at once."""
    verdicts = flown(Wrong(iron=along(direction, size)), "satellites", 1.0, seed)
    assert not suspected(verdicts) & Source.GYRO


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("residual", "source"),
    [(sources.AA, Source.ACCELEROMETER), (sources.GG, Source.GYRO)],
)
def test_a_bias_that_no_such_unit_has_is_named_and_is_not_taken_for_unknown(
    residual: int, source: Source
) -> None:
    """Satellites do not hold the tilt: an accelerometer that drifts turned it by 20 deg."""
    ratios = [0.7] * sources.COUNT
    ratios[residual] = 2.0
    verdict = Verdict()
    for look_ in range(3):
        now = EVERY * look_
        verdict = judged(verdict, tuple(ratios), now, holds_attitude=False)
        assert not verdict.suspects
    assert verdict.wrong == source
    found_with = Verdict(wrong=Source.ATTITUDE)
    found_with = judged(found_with, tuple(ratios), 1.0, holds_attitude=False)
    assert not found_with.is_on, "it was found with an attitude that is wrong"
    x: Any = np.zeros(1, FILTER)
    evidence = residuals.at_start()
    x["witness"][0, 0] = 1.0
    x["bias"] = 0.0, -1.0, 0.0, 0.1, 0.1, 0.0
    for look_ in range(60):
        look(evidence, x, EVERY * look_, NO_AID, NO_AID, NO_AID, False)
    assert evidence[0]["ratio"][sources.AA] > 1.0
    assert evidence[0]["ratio"][sources.GG] > 1.0
    x["covariance"][0] = 0.5**2 * np.eye(17)
    for look_ in range(60, 90):
        look(evidence, x, EVERY * look_, NO_AID, NO_AID, NO_AID, False)
    assert not evidence[0]["ratio"].any(), "nothing is known of them"


@pytest.mark.requirement("REQ-EST-13")
def test_a_bias_that_was_taken_for_unknown_is_no_evidence() -> None:
    """A field that was stuck found one of 0.14 rad/s, and the gyro was named for that."""
    ratios = [0.0] * sources.COUNT
    ratios[sources.GB], ratios[sources.GG] = 1.5, 2.0
    verdict = Verdict(since=0.5, fired=0.98, unknown=(0.0, 0.2))
    for look_ in range(10):
        now = 1.0 + EVERY * look_
        verdict = judged(verdict, tuple(ratios), now, holds_attitude=False)
    assert verdict.suspects == Source.GYRO | Source.COMPASS
    assert not verdict.wrong


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(("gains", "source"), [(1.0, Source.ATTITUDE), (4.0, Source.POSE)])
def test_a_pose_that_turns_is_wrong_about_its_place_where_that_gains_more_than_a_tilt_explains(
    gains: float, source: Source
) -> None:
    ratios, sizes = [0.0] * sources.COUNT, [0.0] * sources.COUNT
    for k in (sources.GP, sources.MP_TURN, sources.AP, sources.MP_FORCE):
        ratios[k] = 3.0
    sizes[sources.AP] = sizes[sources.MP_FORCE] = gains
    verdict = judged(Verdict(), tuple(ratios), 1.0, holds_attitude=True, sizes=tuple(sizes))
    assert verdict.wrong == source
    ratios[sources.GP] = ratios[sources.MP_TURN] = 0.0
    verdict = judged(Verdict(), tuple(ratios), 1.0, holds_attitude=True, sizes=tuple(sizes))
    assert verdict.wrong == Source.POSE, "its attitude agrees"


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(("unheard", "lasts"), [(2.9, True), (0.5, False)])
def test_short_windows_that_are_heard_first_after_a_silence_acquit_nobody(
    unheard: float, lasts: bool
) -> None:
    """One outlier of a place made all windows wait: the accelerometer was believed, and a wall."""
    verdict, ratios, kept = Verdict(), [0.0] * sources.COUNT, [0.0] * sources.COUNT
    for look_ in range(round(2.0 / EVERY)):
        now = 10.0 + EVERY * look_
        ratios[sources.AP] = 2.9 if now < 11.0 else 0.3
        kept[sources.AP] = 0.0 if now < 11.0 else unheard
        heard, silent = tuple(ratios), tuple(kept)
        verdict = judged(verdict, heard, now, holds_attitude=True, unheard=silent)
        assert verdict.is_on or now > 11.0
    assert verdict.is_on is lasts


@pytest.mark.requirement("REQ-EST-13")
def test_what_comes_and_goes_about_its_threshold_is_one_contradiction() -> None:
    """A frame that tilted slowly was acquitted every half second, and the vehicle never landed."""
    verdict = Verdict()
    for look_ in range(round((UNDECIDED + 1.0) / EVERY)):
        ratios = [0.0] * sources.COUNT
        ratios[sources.GP] = 1.05 if look_ % 40 < 10 else 0.9
        now = 10.0 + EVERY * look_
        verdict = judged(verdict, tuple(ratios), now, holds_attitude=True)
    assert now - verdict.since > UNDECIDED
    assert verdict.contradicts
    for look_ in range(20):
        verdict = judged(verdict, (0.6,) * sources.COUNT, now + EVERY * look_, holds_attitude=True)
    assert not verdict.is_on


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("wrong", [Source(0), Source.GYRO])
def test_a_bias_that_is_found_without_the_attitude_it_contests_is_no_evidence(
    wrong: Source,
) -> None:
    evidence = residuals.at_start()
    evidence["looked"] = evidence["tipped"] = 9.0
    if wrong:  # they do not differ by a tilt
        evidence["tipped"] = -math.inf
    before = Verdict(evidence, since=9.0, fired=9.0, suspects=Source.GYRO | Source.ATTITUDE)
    assert before.contested == (not wrong)
    ratios = {sources.GP: 2.0, sources.GG: 3.0}
    assert looked_at(ratios, {}, verdict=before, holds_attitude=False).wrong == wrong


@pytest.mark.requirement("REQ-EST-13")
def test_a_place_is_not_lost_for_what_a_slow_tilt_explains() -> None:
    ratios, sizes = {sources.GP: 0.6, sources.AP: 1.4}, {sources.AP: 0.6}
    verdict = looked_at(ratios, sizes, holds_attitude=True)
    assert not (verdict.wrong | verdict.suspects) & Source.POSE
    assert verdict.suspects & Source.ATTITUDE


def looked_at(ratios: dict[int, float], sizes: dict[int, float], **known: Any) -> Verdict:
    """The verdict after ten looks at the same residuals: ``ratios`` [1] and ``sizes`` [SI]."""
    shown = tuple([ratios.get(k, 0.0) for k in range(sources.COUNT)])
    off = tuple([sizes.get(k, 0.0) for k in range(sources.COUNT)])
    verdict = known.pop("verdict", Verdict())
    for look_ in range(10):
        verdict = judged(verdict, shown, 10.0 + EVERY * look_, sizes=off, **known)
    return verdict


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("known", ["damaged", "named"])
def test_rotors_that_are_known_to_be_off_are_no_witness_against_others(known: str) -> None:
    """Beside a limp joint a sound pose was named for an accelerometer that drifted: 51 m away."""
    turns = {sources.GM: 3.0, sources.MP_TURN: 3.0}
    drifts = {sources.AP: 4.0, sources.AM: 0.9}
    before = looked_at(turns, {}, holds_attitude=True, damaged=known == "damaged")
    assert before.suspects == Source.MODEL
    assert before.explained
    verdict = looked_at(
        {**turns, **drifts}, {}, verdict=before, holds_attitude=True, damaged=known == "damaged"
    )
    assert not verdict.wrong
    assert verdict.suspects & Source.ACCELEROMETER
    assert verdict.contradicts, "it is told, and the vehicle lands"


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(("silent", "wrong"), [(6.0, Source.ATTITUDE), (8.4, Source(0))])
def test_what_was_not_heard_could_not_show_a_change(silent: float, wrong: Source) -> None:
    """After a gap in the unit a gyro that drifted by 0.2 rad/s^2 was taken for the pose's fault."""
    evidence = residuals.at_start()
    residuals.note_silence(evidence, Source.GYRO | Source.ACCELEROMETER, silent)
    ratios = {sources.GP: 3.8, sources.GM: 0.5, sources.AM: 0.5, sources.AP: 0.4}
    sizes = {sources.GP: 0.31, sources.GM: 0.1, sources.AM: 0.9, sources.AP: 0.2}
    verdict = looked_at(ratios, sizes, verdict=Verdict(evidence), holds_attitude=True)
    assert verdict.wrong == wrong
    assert wrong or verdict.suspects == Source.GYRO | Source.ATTITUDE


@pytest.mark.requirement("REQ-EST-13")
def test_without_the_attitude_of_a_pose_its_place_is_the_gyro_s_evidence_too() -> None:
    """A gyro turns what is felt: the place was named for a tilt, and the vehicle fell."""
    ratios = {sources.GM: 1.6, sources.AP: 1.7, sources.MP_FORCE: 1.1}
    tilted = looked_at(ratios, {}, verdict=Verdict(wrong=Source.ATTITUDE), holds_attitude=False)
    assert tilted.wrong & Source.GYRO
    assert not tilted.wrong & Source.POSE


def test_what_was_named_is_believed_again_after_it_has_agreed_for_five_seconds() -> None:
    fires = [0.0] * sources.COUNT
    fires[sources.GM], fires[sources.GP] = 5.0, 5.0
    agrees = tuple(0.2 for _ in range(sources.COUNT))
    verdict, now = Verdict(), 10.0
    for _ in range(3):
        verdict, now = judged(verdict, tuple(fires), now, holds_attitude=True), now + EVERY
    assert verdict.wrong == Source.GYRO
    back: float | None = None
    began = now
    while back is None and now < began + 10.0:
        verdict, now = judged(verdict, agrees, now, holds_attitude=True), now + EVERY
        back = now - began if not verdict.wrong else None
    assert back == pytest.approx(5.0, abs=0.1)
    verdict = judged(verdict, tuple(fires), now, holds_attitude=True)
    assert verdict.wrong == Source.GYRO, "and it can be named again"


@given(st.lists(st.floats(0.0, 20.0), min_size=sources.COUNT, max_size=sources.COUNT))
def test_who_is_named_has_fired_and_nobody_is_while_nothing_does(ratios: list[float]) -> None:
    verdict = judged(Verdict(), tuple(ratios), 1.0, holds_attitude=True)
    fired = Source(0)
    for k, ratio in enumerate(ratios):
        fired |= sources.OF[k] if ratio > 1.0 else Source(0)
    assert not verdict.wrong & ~fired
    assert bool(verdict.is_on or verdict.wrong) == (max(ratios) > 1.0)


@pytest.mark.parametrize(
    ("since", "kept"), [(0.1, 0.0), (0.3, 1.5), (1.2, 2.0), (3.9, 3.0), (4.1, 4.0)]
)
def test_a_comparison_counts_as_soon_as_its_window_is_without_silence(
    since: float, kept: float
) -> None:
    """Of a gyro that is garbage a second after a gap in its readings, nothing was heard for 4 s."""
    e = residuals.at_start()
    residuals.note_silence(e, Source.GYRO, 10.0)
    s = SimpleNamespace(**{name: e[0][name] for name in residuals.EVIDENCE.fields or ()})
    s.came[sources.GM] = 10.0 + since
    s.both[sources.GM] = 1.5, 2.0, 3.0, 4.0, 0.0
    residuals._note_largest(s, 10.0 + since, sources.GM)
    assert s.ratio[sources.GM] == kept


@given(st.sampled_from(list(Source)), st.floats(0.0, 0.19), st.floats(1.1, 20.0))
def test_what_has_said_nothing_for_some_of_the_time_is_no_witness(
    silent: Source, later: float, ratio: float
) -> None:
    """Encoders that send garbage leave the rotors' model without its arm, and no gyro is wrong."""
    evidence = residuals.at_start()
    residuals.note_silence(evidence, silent, 5.0)
    lost = residuals.note_silence(evidence, Source(0), 5.0 + later)
    assert lost == silent
    assert not residuals.note_silence(evidence, Source(0), 5.0 + 2.0 * residuals.WINDOWS[0])
    fires = tuple([ratio if of & silent else 0.0 for of in sources.OF])
    verdict = judged(Verdict(), fires, 5.0 + later, holds_attitude=True, lost=lost)
    assert not verdict.is_on
    assert not verdict.wrong


@pytest.mark.requirement("REQ-EST-13")
def test_a_field_that_has_turned_the_heading_is_a_suspect_beside_the_gyro() -> None:
    """It turns what is felt as well, where no pose holds the attitude."""
    ratios = [0.0] * sources.COUNT
    ratios[sources.GB], ratios[sources.AN] = 1.4, 1.1
    verdict = Verdict()
    for look_ in range(20):
        now = EVERY * look_
        verdict = judged(verdict, tuple(ratios), now, holds_attitude=False)
    assert verdict.suspects == Source.GYRO | Source.COMPASS
    assert not verdict.wrong
    without = verdict._replace(wrong=Source.COMPASS)
    without = judged(without, tuple(ratios), now, holds_attitude=False)
    assert without.suspects & Source.GNSS, "the heading of one that is not used turns nothing"


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(("size", "who"), [(0.8, Source.GYRO | Source.COMPASS), (1.2, Source.GYRO)])
def test_a_field_turns_what_is_felt_by_no_more_than_it_has_turned_the_heading(
    size: float, who: Source
) -> None:
    """The gyro of a hexarotor, which pushes turn, was no more to blame than the field: a wall."""
    headed = tuple(
        [1.0 if k in (sources.AN, sources.MN) else math.inf for k in range(sources.COUNT)]
    )
    ratios = {sources.GM: 0.4, sources.GB: 2.5, sources.AN: 1.3, sources.MN: 0.9}
    sizes = {sources.AN: size, sources.MN: size}
    verdict = looked_at(ratios, sizes, holds_attitude=False, headed=headed)
    assert (verdict.wrong or verdict.suspects) == who


@pytest.mark.parametrize("turning", [0.0, 0.2])
def test_how_far_a_heading_may_be_off_is_how_far_gyro_and_field_have_turned_apart(
    turning: float,
) -> None:
    evidence = residuals.at_start()
    flown(Wrong(magnetic=(0.0, 0.0, turning)), "satellites", 2.0, evidence=evidence)
    s, apart = evidence[0], 2.0 * turning * FIELD[0] / math.hypot(*FIELD)
    assert apart <= s["apart"] < apart + 0.25, "noise, and iron of a vehicle that tilts"
    windows = s["headed"][[sources.AN, sources.MN]] / s["apart"]
    assert all(np.isclose(one, s["across"][:4]).any() for one in windows)
    assert math.isinf(s["headed"][sources.GB])


def test_integrals_begin_anew_when_the_vehicle_stands() -> None:
    x: Any = np.zeros(1, FILTER).view(np.recarray)[0]
    level: NDArray[np.float64] = np.eye(3).ravel()
    model: Vec4 = (0.1, 0.0, 0.0, G)
    R = tuple(level.tolist())
    residuals.witness(x, R, TICK, model, NONE)  # type: ignore[arg-type]
    assert x.witness.any()
    residuals.witness(x, R, TICK, (0.0, 0.0, 0.0, 0.0), NONE)  # type: ignore[arg-type]
    assert not x.witness[:4].any()


@pytest.mark.parametrize(("suspect", "learns"), [(0, True), (NO_HEADING, True), (ON_TRIAL, False)])
def test_what_lasts_beside_the_rotors_is_learnt_while_nobody_is_a_suspect(
    suspect: int, learns: bool
) -> None:
    """A heading that is not known says nothing of wind or of a bias."""
    x: Any = np.zeros(1, FILTER).view(np.recarray)[0]
    R = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    x.newest[:3], x.suspect = (0.4, 0.0, -G), suspect
    for _ in range(500):
        residuals.witness(x, R, TICK, (0.0, 0.0, 0.0, G), NONE)
    assert bool(x.baseline[6] > 0.05) is learns


def test_what_a_surface_pushes_is_the_rotors_model_s_as_well() -> None:
    x: Any = np.zeros(1, FILTER).view(np.recarray)[0]
    R = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    x.newest[:3] = (-1.5, 0.0, -G)  # what an accelerometer feels of it
    for _ in range(100):
        residuals.witness(x, R, TICK, (0.0, 0.0, 0.0, G), (-1.5, 0.0, 0.0))
    np.testing.assert_allclose(x.witness[residuals.MADE :][:3], (-0.3, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(x.witness[residuals.BESIDE :][:3], 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("suspect", "out", "learns"),
    [
        (0, 0, True),
        (ON_TRIAL, 0, True),  # nobody but the rotors is in doubt: a payload, a weak rotor
        (ON_TRIAL | CONTRADICTED, 0, False),
        (ON_TRIAL | CONTRADICTED | NO_FORCE, 0, False),
        (0, NO_FORCE, False),
    ],
)
def test_rotors_do_not_learn_their_lift_from_what_they_witness_against(
    suspect: int, out: int, learns: bool
) -> None:
    """They did within a second, bore out a wrong accelerometer, and the pose was named."""
    x: Any = np.zeros(1, FILTER).view(np.recarray)[0]
    R = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    x.newest[:3] = (0.0, 0.0, -1.1 * G)
    for _ in range(round(2.0 / TICK)):
        residuals.witness(x, R, TICK, (0.0, 0.0, 0.0, G), NONE)
    assert x.baseline[9] == pytest.approx(0.1), "at first at once: of another mass"
    x.newest[:3], x.suspect, x.out = (0.0, 0.0, -0.8 * G), suspect, out
    for _ in range(round(5.0 / TICK)):
        residuals.witness(x, R, TICK, (0.0, 0.0, 0.0, G), NONE)
    assert bool(x.baseline[9] < -0.05) is learns
    assert x.baseline[9] > -0.15, "slowly"
    if not learns:
        assert x.baseline[9] == pytest.approx(0.1)


def test_rotors_do_not_learn_their_lift_while_nothing_measures_the_height() -> None:
    x: Any = np.zeros(1, FILTER).view(np.recarray)[0]
    R = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    x.newest[:3] = (0.0, 0.0, -0.8 * G)
    x.time = x.height_time + 1.1 * HEIGHT_LASTS
    for _ in range(round(2.0 / TICK)):
        residuals.witness(x, R, TICK, (0.0, 0.0, 0.0, G), NONE)
    assert x.baseline[9] == 0.0


@pytest.mark.requirement("REQ-EST-13")
def test_while_no_height_is_measured_rotors_are_right_that_the_vehicle_does_not_sink() -> None:
    """An accelerometer that said so lifted it, in a descent that never ended."""

    def after(gained: float, told: bool = False) -> Source:
        return lifted(seen, (0.3 + gained, 0.0), 3.0, told=told).wrong

    seen = lifted(Verdict(), (0.3, 0.1), 2.0, told=True)
    assert not seen.wrong
    assert seen.seen_down == (0.3, 0.1)
    assert not after(0.45), "rotors may be off"
    assert after(0.6) is Source.ACCELEROMETER
    assert not after(-5.0), "the ground may carry it"
    assert not after(0.6, told=True)
    seen = seen._replace(explained=True)
    assert not after(0.6), "rotors are what is wrong"
