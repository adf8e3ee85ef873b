"""What follows for the filter when sensors contradict each other, or one is named.

Every 20 ms it is asked who is wrong (``verdict.py``). Of suspects the biases are not known any
more; without who is named the filter runs again, from before it was wrong.

Source: docs/decisions/0041-one-law-for-who-is-wrong.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from fsw.autopilot.estimation.error_state import (
    BA,
    BG,
    CONTRADICTED,
    ERRORS,
    HEIGHT_LASTS,
    IMU_CAPACITY,
    LOST,
    MODELLED,
    NO_FORCE,
    NO_HEADING,
    NO_RATE,
    NOTHING,
    ON_TRIAL,
    TH,
    P,
    V,
    correct,
    distance,
    watch_biases,
)
from fsw.autopilot.estimation.faults import residuals
from fsw.autopilot.estimation.faults.confirmation import Run
from fsw.autopilot.estimation.faults.residuals import LASTS, NO_AID
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.estimation.faults.sources import AM, GM, NOBODY, Source
from fsw.autopilot.estimation.faults.verdict import UNDECIDED, Verdict, judged, lifted
from fsw.autopilot.estimation.fusion import clear
from fsw.autopilot.estimation.fusion_memory import FusionMemory, TickInputs, Trail, copied
from fsw.autopilot.estimation.imu import IMU_SILENT, is_stuck
from fsw.autopilot.estimation.joint_filter import ENCODERS_TOO_OLD
from fsw.autopilot.estimation.sensors.base import AidingSensor, attitude_of
from fsw.autopilot.geometry.quaternion import conjugate, multiply, normalised, rotation_vector
from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from fsw.autopilot.geometry.vectors import add_scaled, three
from fsw.autopilot.measurements import PoseSample, Sensor
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.signals import StateEstimate, Vec2
from fsw.frozen import replace

_TRAIL: Final = 0.75  # s, of each of two trails: so far, or twice, the filter can go back
# Of a suspect: the most that its bias may be off, for how long it has been so [s], and the share of
# it that residuals show. Places show a force late: half of it where windows are half full.
_MOST: Final = (10.0, 0.5)  # m/s^2 and rad/s
_FOR: Final = (0.1, 0.06)
# The same of a gyro where no pose has held the attitude: it takes a long window until it is found.
_TURNED: Final = 0.6  # s
_SEEN_OF_TURN: Final = 1.0 / 3.0
_SEEN: Final = (0.5, 1.0)
_IS_WHAT_IT_WAS: Final = 3.0  # chi-square, of what may have walked on for half a second since
_BORNE_OUT: Final = 0.5  # of a threshold
_HALVES: Final = ((Source.ACCELEROMETER, NO_FORCE), (Source.GYRO, NO_RATE))
_USED: Final = 0.5  # s; what was refused for longer finds no bias
_LASTED: Final = 0.05  # s, of integrals
_ALONE: Final = 2.5  # periods since a pose was used: one has been refused
_BOTH: Final = Source.ACCELEROMETER | Source.MODEL
_UNIT: Final = Source.GYRO | Source.ACCELEROMETER
_POSE: Final = Source.POSE | Source.ATTITUDE
_PARTS: Final = {
    Sensor.POSE: (Source.POSE, Source.ATTITUDE),
    Sensor.GNSS: (Source.GNSS, Source.GNSS),
}
# Of encoders that are used all the same.
_FOLLOWED: Final = (SensorFault.RATE_TOO_LOW, SensorFault.NOISY)
_ASKS_EVERY: Final = 0.1  # s; going back takes as long as four ticks
# By so much nearer poses must be to what refutes those before.
_NEARER: Final = 0.3
_OWN: Final = (0.005, 0.01)  # m, rad; or no farther than what poses and units make of themselves
_ROUNDING: Final = 1e-9  # s

Again = Callable[[FusionMemory, TickInputs], tuple[FusionMemory, StateEstimate | None]]
"""What a tick makes of a memory."""


class Arbitration:
    """Asks who is wrong, for one configuration; holds nothing that changes in flight."""

    def __init__(
        self, sensors: Mapping[type, AidingSensor[Any, Any]], stale: float, again: Again
    ) -> None:
        """Of some ``sensors``, each silent after ``stale`` [s]."""
        self._sensors, self._stale = sensors, stale
        self._again = again

    def step(
        self,
        memory: FusionMemory,
        found: StateEstimate,
        *,
        aloft: Callable[[], bool],
        flies: bool,
        damaged: bool,
        touches: bool = False,
    ) -> tuple[FusionMemory, StateEstimate | None]:
        """The memory, and the state ``found`` in this tick, after what is due.

        Nothing is, unless the vehicle ``flies``, and is ``aloft``: else the ground may hold it. Of
        a ``damaged`` one a rotor or a joint is known to have failed; the tool of one that
        ``touches`` something turns it by more than is known.
        """
        evidence = memory.verdict.evidence
        if evidence is None:
            return begun(memory), found
        if not self.is_due(memory):
            return memory, found
        memory, refuted = self._refuted(memory)
        if refuted is not None:
            return memory, refuted
        before = memory.verdict
        memory = _lifted(memory, found, flies=flies, known=damaged or touches)
        if memory.verdict.wrong is not before.wrong:
            oldest = memory.trail_before or memory.trail
            memory, state = self._convicted(memory, before, found)
            if state is None or (oldest and oldest.began <= before.measured):
                return memory, state
            return _as_made(memory, before, state)
        if not aloft():
            # What is in doubt is so until the rotors stand, on the ground too: else its bias would
            # be the one of before.
            if memory.verdict.is_on and flies:
                return memory, found
            if evidence[0]["count"] or memory.verdict.is_on:
                memory = _anew(memory)
            on_ground = memory.verdict.wrong and not (flies and _is_unseen(memory))
            return (_on_ground(memory) if on_ground else memory), found
        return self._look(memory, found, damaged=damaged, touches=touches)

    def is_due(self, memory: FusionMemory) -> bool:
        """Whether ``step`` would do anything now."""
        evidence = memory.verdict.evidence
        return evidence is None or memory.now - evidence["looked"][0] >= residuals.EVERY - _ROUNDING

    def _look(
        self, memory: FusionMemory, found: StateEstimate, *, damaged: bool, touches: bool
    ) -> tuple[FusionMemory, StateEstimate | None]:
        """The memory after a look at whether all sensors agree, and the state with it."""
        before, now = memory.verdict, memory.now
        assert before.evidence is not None
        evidence = copied(before.evidence)
        newest = memory.newest_pose, memory.gnss, memory.newest_field
        pose, fix, field = [
            NO_AID
            if sample is None or sample is last
            else self._sensors[type(sample)].aid(memory, sample)
            for sample, last in zip(newest, before.seen, strict=True)
        ]
        silent = _silent(memory) | _stuck(memory) | _stepped(memory)
        silent |= Source.MODEL if touches else NOBODY
        lost = residuals.note_silence(evidence, silent, now)
        learns = not (before.is_on or before.wrong or lost)
        residuals.look(evidence, memory.numbers, now, pose, fix, field, learns)
        ratios = tuple(evidence[0]["ratio"].tolist())
        verdict = before._replace(evidence=evidence, seen=newest)
        if before.is_on or before.wrong or max(ratios) > 1.0:
            held = Source.ATTITUDE in self._aided(memory)
            verdict = judged(
                verdict,
                ratios,
                now,
                holds_attitude=held,
                lost=lost,
                damaged=damaged,
                sizes=tuple(evidence[0]["size"].tolist()),
                headed=tuple(evidence[0]["headed"].tolist()),
                unheard=tuple(evidence[0]["unheard"].tolist()),
            )
        memory = replace(memory, verdict=verdict)
        state: StateEstimate | None = found
        if verdict.is_on or verdict.wrong or before.is_on or before.wrong:
            memory, state = self._convicted(memory, before, found)
        return _with_trail(memory), state

    def _aided(self, memory: FusionMemory) -> Source:
        """Who measures places, and attitudes, that are used now, and is not named."""
        found, wrong, now = NOBODY, memory.verdict.wrong, memory.now
        for sensor, parts in _PARTS.items():
            health = memory.of(sensor)
            fused = zip(parts, health.fused, strict=False)
            used = min([at for part, at in fused if not part & wrong], default=-math.inf)
            if now - used <= _USED and now - health.came <= self._stale:
                found |= parts[0] | parts[1]
        return found & ~(wrong | (Source.ATTITUDE if memory.verdict.contested else NOBODY))

    def _convicted(
        self, memory: FusionMemory, before: Verdict, found: StateEstimate
    ) -> tuple[FusionMemory, StateEstimate | None]:
        """The memory with a filter that knows the verdict, and the state with it."""
        verdict, now = memory.verdict, memory.now
        x = memory.numbers.copy()
        memory = replace(memory, numbers=x)
        new, back = verdict.wrong & ~before.wrong, before.wrong & ~verdict.wrong
        # A half that has jumped, and stays, is believed where the rotors are named for it, and
        # where it agrees. Garbage does not stay.
        agrees = back or (before.is_on and not verdict.is_on and not verdict.wrong)
        doubted, steady = x["doubted"][0], x["steady"][0]
        stays = bool(((doubted > 0) & (steady >= doubted)).any())
        believes = stays and (agrees or verdict.named is Source.MODEL)
        # So is what has jumped and come back meanwhile: an arm that hits its stop is a blow.
        unit = memory.of(Sensor.IMU)
        jumped = unit.fault is SensorFault.JUMP and now - unit.fault_at < _TRAIL
        believes = believes or (jumped and verdict.explained and not before.explained)
        x["out"], x["suspect"] = _halves(verdict.wrong), _halves(verdict.suspects)
        x["suspect"] |= NO_HEADING if verdict.wrong & Source.COMPASS else 0
        if verdict.is_on:
            x["suspect"] |= ON_TRIAL | (CONTRADICTED if verdict.contradicts else 0)
            verdict = _widened(x.view(np.recarray)[0], verdict, self._aided(memory))
            memory = replace(memory, verdict=verdict)
        # What the rotors explain, nobody else was wrong about.
        acquits = verdict.explained and not before.explained and any(before.unknown)
        if not (new or believes or acquits):
            return memory, found
        x["believed"] = NOTHING if believes else 0
        if new & _UNIT:
            memory = memory.noting_fault(Sensor.IMU, SensorFault.DISAGREES, now)
        memory, state = self._replayed(memory, found)
        if state is None:
            return memory, state
        # What the estimate was down when it was measured last was as wrong as it is now.
        (v, p), verdict = memory.verdict.seen_down, memory.verdict
        v, p = v + state.v_WB[2] - found.v_WB[2], p + state.p_WB[2] - found.p_WB[2]
        return replace(memory, verdict=verdict._replace(seen_down=(v, p))), state

    def _refuted(self, memory: FusionMemory) -> tuple[FusionMemory, StateEstimate | None]:
        """The memory without what poses have taught that are refuted by later ones, and its state.

        Poses that are refused, and are where the inertial unit alone leads from before all that the
        filter can go back to, refute those in between. None: these do not.
        """
        oldest = memory.trail_before or memory.trail
        run = next((one for one in memory.runs if one.kind is PoseSample), None)
        if run is None or oldest is None or run.since <= oldest.began:
            return memory, None
        if not run.is_no_chance or memory.now - memory.asked < _ASKS_EVERY:
            return memory, None
        memory = replace(memory, asked=memory.now)
        numbers = memory.numbers.copy()
        numbers["refuted"] = oldest.began, math.inf
        without, state = self._replayed(replace(memory, numbers=numbers), None)
        verdict = without.verdict.acquitted()
        if state is None or verdict.evidence is None or not _refutes(run, memory.pose, without):
            return memory, None
        without.numbers["refuted"] = oldest.began, run.since
        evidence = copied(verdict.evidence)
        residuals.forget_poses(evidence)
        without.numbers["suspect"] = 0
        without = replace(
            without,
            verdict=verdict._replace(evidence=evidence),
            health=memory.health,
            pose=memory.pose,
            reset_counter=memory.reset_counter,
            runs=(),
        )
        if memory.pose is not None and memory.pose.drifts:
            # What the inertial unit is off by meanwhile would be taken for a drift of the frame.
            sensor = self._sensors[PoseSample]
            without = sensor.take(without, memory.pose, memory.pose.time, (2.0, 1.0))
        return without.noting_fault(Sensor.POSE, SensorFault.DISAGREES, memory.now), state

    def _replayed(
        self, memory: FusionMemory, found: StateEstimate | None
    ) -> tuple[FusionMemory, StateEstimate | None]:
        """Go back to before sensors contradicted, and do without what is wrong since then."""
        trails = [one for one in (memory.trail_before, memory.trail) if one is not None]
        x = memory.numbers[0]
        believed = int(x["believed"])
        x["believed"] = 0
        if not trails:
            return memory, found
        back, state = trails[0].start, None
        numbers = back.numbers.copy()
        for name in ("out", "suspect", "refuted"):
            numbers[name] = x[name]
        numbers["believed"] = believed
        back = replace(back, numbers=numbers, verdict=memory.verdict)
        for trail in trails:
            for tick in trail.inputs():
                back, state = self._again(back, tick)
        if state is None:
            return memory, found
        numbers = back.numbers.copy()
        numbers["believed"] = 0
        for name in ("witness", "model_walk"):
            numbers[name] = memory.numbers[name]
        fused = [(one, back.of(one.sensor)) for one in memory.health]
        without = replace(
            memory,
            numbers=numbers,
            health=tuple([a.with_fused(b.fused, b.ratio, b.innovation) for a, b in fused]),
            waiting=back.waiting,
            arrivals=back.arrivals,
            runs=back.runs,
            pose=back.pose,
            reset_counter=back.reset_counter,
            frame=back.frame,
            unproven=back.unproven,
            replays=memory.replays + 1,
        )
        return without, state


def _refutes(run: Run, pose: PoseSample | None, without: FusionMemory) -> bool:
    """Whether the last ``pose`` of a ``run`` is nearer to the memory ``without`` any.

    By far, in each part that contradicts the one with them.
    """
    if pose is None:
        return False
    x = without.numbers[0]
    place = add_scaled(three(x["p"], 0), three(x["v"], 0), pose.time - float(x["time"]))
    turn = rotation_vector(multiply(conjugate(attitude_of(x)), normalised(pose.attitude)))
    left = math.dist(pose.position, place), math.hypot(*turn)
    off = math.hypot(*run.innovation[:3]), math.hypot(*run.innovation[3:])
    nearer = [now <= _NEARER * before for now, before in zip(left, off, strict=True)]
    return any(nearer) and all(
        one or now <= own for one, now, own in zip(nearer, left, _OWN, strict=True)
    )


def begun(memory: FusionMemory) -> FusionMemory:
    """The memory of a filter that has just begun: what sensors say is compared from now on."""
    verdict = memory.verdict._replace(evidence=residuals.at_start())
    return replace(memory, verdict=verdict, trail=None, trail_before=None)


def _anew(memory: FusionMemory) -> FusionMemory:
    """The memory without what has been compared so far: rotors do not explain what legs feel."""
    x = memory.numbers.copy()
    x["suspect"] = 0
    return begun(replace(memory, numbers=x, verdict=memory.verdict.acquitted()))


def _on_ground(memory: FusionMemory) -> FusionMemory:
    """The memory with what was named in flight believed again, once it is time."""
    verdict = memory.verdict.on_ground(memory.now)
    x = memory.numbers
    if verdict.wrong is not memory.verdict.wrong:
        x = x.copy()
        x["out"] = _halves(verdict.wrong)
    return replace(memory, numbers=x, verdict=verdict)


def _with_trail(memory: FusionMemory) -> FusionMemory:
    """The memory with a new trail where the newest one is long enough.

    None is begun while it may have to be said soon who is wrong.
    """
    newest, verdict, now = memory.trail, memory.verdict, memory.now
    if newest is not None:
        decides = verdict.is_on and now - verdict.since < UNDECIDED
        if decides or now - newest.began < _TRAIL:
            return memory
    start = replace(memory, trail=None, trail_before=None)
    return replace(memory, trail_before=newest, trail=Trail(start, now))


def _is_unseen(memory: FusionMemory) -> bool:
    """Whether nothing measures the height of a vehicle that flies, for a while."""
    x = memory.numbers[0]
    W, unseen = x["witness"], x["time"] - x["height_time"] > HEIGHT_LASTS
    return bool(unseen and W[residuals.SAID : residuals.SAID + 4].any() and W[LASTS] > _LASTED)


def _lifted(
    memory: FusionMemory, found: StateEstimate, *, flies: bool, known: bool
) -> FusionMemory:
    """The memory with a verdict on what climbs, or not, while nothing measures the height.

    That rotors are off is ``known`` of a vehicle that is damaged or touches something.
    """
    v, p = _made_down(memory)
    told = not (flies and _is_unseen(memory)) or known or bool(_silent(memory) & _BOTH)
    down = found.v_WB[2] - v, found.p_WB[2] - p
    return replace(memory, verdict=lifted(memory.verdict, down, memory.now, told=told))


def _made_down(memory: FusionMemory) -> Vec2:
    """Integrals of what the rotors make down: velocity [m/s] and place [m]."""
    W = memory.numbers["witness"][0]
    return float(W[residuals.MADE + 2]), float(W[residuals.MADE2 + 2])


def _as_made(
    memory: FusionMemory, before: Verdict, state: StateEstimate
) -> tuple[FusionMemory, StateEstimate]:
    """The memory and the ``state`` of now, as rotors have moved it since it was measured.

    Down, of which the verdict ``before`` tells: no trail of the filter goes back so far.
    """
    (v, p), (faster, lower) = _made_down(memory), before.seen_down
    (x, y, z), (vx, vy, vz) = state.p_WB, state.v_WB
    p += lower + faster * (memory.now - before.measured)
    numbers = memory.numbers.copy()
    numbers["p"][0, 2] += p - z
    numbers["v"][0, 2] += v + faster - vz
    state = state._replace(p_WB=(x, y, p), v_WB=(vx, vy, v + faster))
    return replace(memory, numbers=numbers), state


def _silent(memory: FusionMemory) -> Source:
    """What says nothing of how the vehicle moves now.

    Rotors explain it only where it is known how the arm moves.
    """
    now = memory.now
    unit = now - memory.imu_came > IMU_SILENT
    encoders, came = memory.of(Sensor.ENCODERS), now - memory.joints_came
    wrong = now - encoders.fault_at < residuals.EVERY and encoders.fault not in _FOLLOWED
    arm = memory.encoders_stuck or wrong or came > ENCODERS_TOO_OLD
    return (_UNIT if unit else NOBODY) | (Source.MODEL if arm else NOBODY)


def _stuck(memory: FusionMemory) -> Source:
    """Halves of the inertial unit that repeat themselves."""
    found, same = NOBODY, memory.numbers[0]["same"]
    for place, (source, _) in enumerate(_HALVES):
        if is_stuck(same, place):
            found |= source
    return found


def _stepped(memory: FusionMemory) -> Source:
    """A pose whose place has changed at once, and is refused: what is off may be so in both parts.

    Where the rotors' model says nothing either, its attitude would make a sound gyro a suspect. Of
    one pose that is refused alone, as every camera sends now and then, no window holds enough.
    """
    health = memory.of(Sensor.POSE)
    alone = memory.now - max(health.fused, default=memory.now) < _ALONE * health.apart
    return _POSE if not alone and any(one.stepped for one in memory.runs) else NOBODY


def _widened(x: Any, verdict: Verdict, aided: Source) -> Verdict:
    """The ``verdict`` with a filter ``x`` that takes the biases of suspects for unknown.

    By as much as residuals with them show, and so what that has led to. A bias that may walk alone
    takes too long to be found; where the filter is not ``aided``, nothing would find it, and what
    has been found of it so far is kept where it is another one.
    """
    assert verdict.evidence is not None
    M, unknown, k = x["covariance"], list(verdict.unknown), np.arange(3)
    for half, ((source, _), bias, state) in enumerate(zip(_HALVES, (BA, BG), (V, TH), strict=True)):
        if not source & verdict.suspects:
            continue
        seen = residuals.size_of(verdict.evidence, source)
        turned = state == TH and Source.ATTITUDE not in aided
        size = min(seen / (_SEEN_OF_TURN if turned else _SEEN[half]), _MOST[half])
        x["model_walk"][half] = min(x["model_walk"][half], size)
        grown = size**2 - unknown[half] ** 2
        if not aided and unknown[half]:
            _recall(x, bias, shown=bool(verdict.evidence["ratio"][0, (AM, GM)[half]] > _BORNE_OUT))
            unknown[half] = 0.0
        elif aided and grown > 0.0:
            if not unknown[half]:
                _doubt(x, half)
            unknown[half] = size
            if turned:
                _doubt_turn(x, grown)
                continue
            M[bias + k, bias + k] += grown
            M[state + k, state + k] += _FOR[half] ** 2 * grown
    return verdict._replace(unknown=(unknown[0], unknown[1]))


def _recall(x: Any, bias: int, *, shown: bool) -> None:
    """Take a ``bias`` [BA, BG] of ``x`` for what it was, unless it has been found to be another.

    That rotors have ``shown`` too: else a pose that is wrong has taught it.
    As a measurement, because what is known of it has led to a tilt and a velocity.
    """
    clear(x, 3)
    for i in range(3):
        x.H[i, bias + i] = 1.0
        k = bias - BA + i
        x.residual[i], x.variance[i] = x.kept_bias[k] - x.bias[k], x.kept_variance[k]
    if distance(x, 3) <= (_IS_WHAT_IT_WAS if shown else math.inf):
        correct(x, 3)


def _doubt_turn(x: Any, grown: float) -> None:
    """Know less of the gyro's bias, by a variance ``grown`` [rad^2/s^2], and of what it has made.

    The tilt that it has made has made a velocity and a place. One cause, so that the next velocity
    tells the tilt, which nothing else does here; else the filter would level the vehicle wrongly.
    """
    R = np.reshape(matrix_from_quaternion(attitude_of(x)), (3, 3))
    fx, fy, fz = R.T @ (x["acceleration"] - (0.0, 0.0, GRAVITY))
    sideways = R @ ((0.0, -fz, fy), (fz, 0.0, -fx), (-fy, fx, 0.0))
    made = np.zeros((ERRORS, 3))
    made[BG : BG + 3], made[TH : TH + 3] = np.eye(3), -_TURNED * np.eye(3)
    made[V : V + 3] = _TURNED**2 / 2.0 * sideways
    made[P : P + 3] = _TURNED**3 / 6.0 * sideways
    x["covariance"] += grown * made @ made.T


def _doubt(x: Any, half: int) -> None:
    """Keep what the filter ``x`` knows of the bias of a ``half``: its readings are in doubt now.

    Those too that have come, but wait until measurements of their time have.
    """
    waiting = np.arange(x["first"], x["end"]) % IMU_CAPACITY
    lost = x["imu"][waiting, LOST].astype(int) | MODELLED | 1 << half
    x["imu"][waiting, LOST] = lost
    watch_biases(x, x["covariance"], int(x["lost"]) | 1 << half)


def _halves(sources: Source) -> int:
    """Halves of the inertial unit, as ``FILTER`` counts them, among some ``sources``."""
    return sum(half for source, half in _HALVES if source & sources)
