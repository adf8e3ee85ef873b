"""What a vehicle's telemetry says, message by message: for a live view and for a ``.tlog``."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, cast

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.geometry.rotation import quaternion_from_euler
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.parameters.param_type import value_of
from fsw.autopilot.signals import (
    JointVector,
    PlanInput,
    PredictionState,
    RotorVector,
    SafeSet,
    Vec3,
    Zone,
)
from fsw.link.events import condition_of
from fsw.link.wire import decode
from fsw.link.wire.identity import AVAILABLE_MODES
from fsw.link.wire.zone_transfer import ZoneTransfer
from messages import dialect
from messages import message_ids as ids
from messages.frames import Frame, wire_fields
from messages.joint_arrays import STATE_AT, STATE_COUNT_AT, joined
from view.flight_events import command_name, result_name
from view.log_flight import GROUPS, status_name
from view.scene import (
    Battery,
    Event,
    EventKind,
    Held,
    Horizon,
    Margin,
    Posture,
    Safety,
    Scene,
    Solver,
    Timing,
    Tool,
    vec3,
)
from view.vehicle import horizon

_EVENTS: Final = 500
# Of a vehicle and all that speak beside it; what is beyond somebody makes up.
_MAX_HEARD: Final = 1024  # kinds of messages that are not the vehicle's
_MAX_PARAMETERS: Final = 4096
_MAX_TEXT: Final = 255 * 50  # bytes of one sentence, as STATUSTEXT numbers its pieces
_IGNORE_POSITION: Final = 0x7
_ARMED, _FAILSAFE, _TERMINATED = 128, 5, 8
_ON_GROUND: Final = 1
_STEPS: Final = 6  # most of an MPC_HORIZON
HORIZON_JOINTS: Final = 2  # of it; of a vehicle with more an MPC_HORIZON_ARM has all
_FENCE_ID_AT: Final = 5  # of a MISSION_CURRENT; 0: there is no fence
_OUTPUTS: Final = 16  # of a SERVO_OUTPUT_RAW
_VEHICLE: Final = ((ids.SYSTEM_ID, ids.AUTOPILOT), (ids.SYSTEM_ID, ids.PANDION))
_NO_AUTOPILOT: Final = 8  # MAV_AUTOPILOT: of a component, not of the vehicle
_REQUESTS: Final = (511, 512)  # of messages; their answers are of no interest
_UNTIMED: Final = 0xFFFFFFFF
_OUR_MESSAGES: Final = 60_200  # the first number of the dialect, which one component alone speaks
RESTARTED_S: Final = 5.0  # by which its clock goes back where a vehicle starts again
# How long what was said is so [s, on the listener's clock]: what comes often, the rest, what comes
# once a second and on a slow line less often.
_SHORT_S, _USUAL_S, _LONG_S = 2.0, 5.0, 10.0
_BELIEVED: Final = 1e6  # numbers of a plan [SI]; larger ones somebody makes up
_MARK_S: Final = 1.0  # between two marks of a rate
_MARKS: Final = 3
_NEVER: Final[tuple[float, tuple[Any, ...]]] = (math.nan, ())
_COUNTED: Final = (ids.ARM_JOINT_STATE, ids.SERVO_OUTPUT_RAW)  # say how many there are
_Said = dict[int, tuple[Any, ...]]  # by message
MODE_NAMES: Final = {one.custom_mode: one.name.lower() for one in AVAILABLE_MODES}
_WARNING: Final = 4  # MAV_SEVERITY
# Of SYS_STATUS, as fsw.link.wire.encode_health has them.
_LOSSES: Final = ("damaged", "echoes", "unsigned", "overflowed")


@dataclass(slots=True)
class Heard:
    """One kind of message from one sender."""

    system: int
    component: int
    message_id: int
    count: int = 0
    at: float = 0.0  # s, on the listener's clock, of the newest
    values: tuple[Any, ...] = ()
    marks: deque[tuple[float, int]] = field(default_factory=lambda: deque(maxlen=_MARKS))
    """When [s] how many had come, the last few seconds."""

    @property
    def name(self) -> str:
        """As the dialect has it."""
        return str(dialect.mavlink_map[self.message_id].msgname)

    def take(self, values: tuple[Any, ...], at: float) -> None:
        """Count one that came ``at`` [s]; those that are read together have come together."""
        if self.marks and not self.rate(at):
            self.marks.clear()  # it had stopped
        marked = self.marks[-1][0] if self.marks else -math.inf
        if self.count and at != self.at and not self.at - marked < _MARK_S:
            self.marks.append((self.at, self.count))
        self.count, self.at, self.values = self.count + 1, at, values

    def rate(self, now: float) -> float:
        """How often it comes [1/s], at ``now`` [s]; 0 once it has stopped."""
        since, count = self.marks[0] if self.marks else (self.at, self.count)
        period = (self.at - since) / max(self.count - count, 1)
        return 1.0 / period if period > 0.0 and now - self.at <= 3.0 * period + 1.0 else 0.0

    def fields(self) -> str:
        """The newest values by name."""
        pairs = zip(wire_fields(self.message_id), self.values, strict=True)
        return ", ".join(f"{name} {_shown(value)}" for name, value in pairs)


@dataclass(slots=True)
class Telemetry:
    """The newest of everything one vehicle has said; of texts and events the last few hundred."""

    airframe: Airframe  # of the vehicle, which messages do not tell
    t: float = math.nan  # s, the vehicle's clock
    heard: dict[tuple[int, int, int], Heard] = field(default_factory=dict)
    events: deque[Event] = field(default_factory=lambda: deque(maxlen=_EVENTS))
    parameters: dict[str, float] = field(default_factory=dict)
    answers: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=20))
    """Commands and their MAV_RESULTs, as they were acknowledged."""
    refusals: deque[str] = field(default_factory=lambda: deque(maxlen=20))
    """Critical texts, the reasons of refusals among them."""
    at: float = math.nan  # s, on the listener's clock, of the newest message
    left_out: int = 0  # zones that cannot be shown, each time that they were sent
    _told: dict[str, str] = field(default_factory=dict)  # what was listed last, by what it is of
    _values: dict[int, tuple[float, tuple[Any, ...]]] = field(default_factory=dict)
    """When [s, on the listener's clock] what was said last, by message; NaN: not to be believed."""
    _timings: dict[int, tuple[float, Timing]] = field(default_factory=dict)
    _transfer: ZoneTransfer = field(default_factory=ZoneTransfer)
    _safe_set: SafeSet | None = None  # holds until another one comes
    whole_sets: int = 0  # how often the safe set was sent to its end
    set_problem: str = ""  # why the last one is not known
    _pieces: dict[int, bytes] = field(default_factory=dict)
    _mode: str = ""
    _conditions: list[Condition] = field(default_factory=list)  # of failsafes, that have begun
    _plan: tuple[tuple[Any, ...], ...] = ()  # of which is known where it leads
    _led: tuple[float, Horizon | None] = (math.nan, None)
    """When [s] a plan came, and where it leads."""

    def take(self, frame: Frame, at: float) -> None:
        """Take in a frame that came ``at`` [s, on the listener's clock]."""
        ours = _is_of_vehicle(frame)
        key = (frame.system_id, frame.component_id, frame.message_id)
        one = self.heard.get(key)
        if one is None and (len(self.heard) < _MAX_HEARD or key[:2] in _VEHICLE):
            one = self.heard[key] = Heard(*key)  # else somebody makes it up
        if one is not None:
            one.take(frame.payload_values, at)
        if not ours:
            return
        self.at = at
        read = READERS.get(frame.message_id)
        if read is None:
            return
        self._values[frame.message_id] = at, frame.payload_values
        try:
            read(self, frame.payload_values)
        except Exception as error:  # a vehicle may say anything
            self._values[frame.message_id] = _NEVER
            self.tell(f"message {frame.message_id}", first_line(error))

    def scene(self, now: float) -> Scene:
        """What is known at ``now`` [s, on the listener's clock]."""
        said = {
            message_id: values
            for message_id, (at, values) in self._values.items()
            if _is_known(now - at, _LASTS.get(message_id, _USUAL_S))
        }
        position, solver = said.get(ids.LOCAL_POSITION_NED), said.get(ids.MPC_STATUS)
        arm, beat = said.get(ids.ARM_JOINT_STATE), said.get(ids.HEARTBEAT)
        state, payload = said.get(ids.EXTENDED_SYS_STATE), said.get(ids.PAYLOAD_STATUS)
        margins, minimum, added, safety = self._margins(said)
        return Scene(
            t=self.t,
            estimate=self._posture(said),
            velocity=None if position is None else vec3(position[4:7]),
            thrust=self._thrust(said.get(ids.SERVO_OUTPUT_RAW)),
            torque=None if arm is None else _arm(arm, 2),
            joint_rates=None if arm is None else _arm(arm, 1),
            target=_target(said.get(ids.END_EFFECTOR_TARGET)),
            horizon=self._horizon(now),
            safe_set=self._safe_set,
            margins=margins,
            minimum=minimum,
            added=added,
            sigma=_sigma(said.get(ids.ESTIMATOR_STATUS)),
            mode="" if beat is None else self._mode,
            armed=None if beat is None else bool(beat[3] & _ARMED),
            landed=state is not None and state[1] == _ON_GROUND,
            failures=self._failures(beat),
            battery=_battery(said.get(ids.SYS_STATUS)),
            link_age=now - self.at,
            others=self._others(),
            dropped=_dropped(said.get(ids.SYS_STATUS)),
            solver=None if solver is None else _solver(solver),
            timing=tuple(
                timing
                for _, (at, timing) in sorted(self._timings.items())
                if _is_known(now - at, _LONG_S)
            ),
            safety=safety,
            tool=_tool(said.get(ids.TOOL_CONTACT)),
            held=None if payload is None else Held(bool(payload[2]), float(payload[1])),
        )

    def _horizon(self, now: float) -> Horizon | None:
        at, led = self._led
        return led if _is_known(now - at, _SHORT_S) and not self._is_another() else None

    def _is_another(self) -> bool:
        """Whether joints or rotors contradict the airframe."""
        return any(self._values.get(one) is _NEVER for one in _COUNTED)

    def _others(self) -> tuple[int, ...]:
        """The systems that speak where the vehicle does not."""
        if not math.isnan(self.at):
            return ()
        return tuple(sorted({system for system, _, _ in self.heard} - {ids.SYSTEM_ID}))

    def _failures(self, beat: tuple[Any, ...] | None) -> str:
        """By their names, which EVENT has; HEARTBEAT alone says only that there are any."""
        if beat is None:
            return ""
        named = ", ".join(one.value for one in self._conditions)
        if beat[4] == _TERMINATED:
            return f"terminated: {named}" if named else "terminated"
        return named or ("failsafe" if beat[4] == _FAILSAFE else "")

    def _posture(self, said: _Said) -> Posture | None:
        position, attitude = said.get(ids.LOCAL_POSITION_NED), said.get(ids.ATTITUDE)
        arm = said.get(ids.ARM_JOINT_STATE)
        if position is None or attitude is None or self._is_another():
            return None
        if arm is None and ids.ARM_JOINT_STATE in self._values:
            return None  # it is not known any more
        q_arm = (0.0,) * self.airframe.bodies.joints if arm is None else _arm(arm, 0)
        if not all(map(math.isfinite, (*position[1:4], *attitude[1:4], *q_arm))):
            return None  # an estimate that is lost, or somebody's frame
        return Posture(vec3(position[1:4]), quaternion_from_euler(vec3(attitude[1:4])), q_arm)

    def _thrust(self, servos: tuple[Any, ...] | None) -> RotorVector | None:
        if servos is None:
            return None
        pulses = _pulses(servos)[: self.airframe.rotors]
        shares = [max(pulse - 1000, 0) / 1000.0 for pulse in pulses]
        most = self.airframe.rotor_thrust_max
        return tuple([share * top for share, top in zip(shares, most, strict=False)])

    def _margins(self, said: _Said) -> tuple[tuple[Margin, ...], float, float, Safety]:
        values, setpoints = said.get(ids.BARRIER_MARGIN), said.get(ids.SETPOINT_STATUS)
        refusals = 0 if setpoints is None else setpoints[5]
        if values is None:
            return (), math.nan, math.nan, Safety(refusals=refusals)
        count = min(int(values[37]), 16)
        points = tuple(one.name for one in self.airframe.points)
        names = [_margin_name(k, count, self._safe_set, points) for k in range(count)]
        margins = tuple(Margin(n, values[1 + k], values[17 + k]) for k, n in enumerate(names))
        added = max(values[42:58], default=0.0)
        breaches, departures, interventions = values[39:42]
        safety = Safety(breaches, departures, interventions, refusals)
        return margins, values[34], added, safety

    def note(self, kind: EventKind, text: str) -> None:
        """Add an event of now."""
        self.events.append(Event(self.t, kind, text))

    def read_clock(self, values: tuple[Any, ...]) -> None:
        """Take the vehicle's time of an ATTITUDE; it goes back only if the vehicle starts again.

        One message has the clock: what a companion sends may be stamped by another one.
        """
        t = 1e-3 * values[0]
        if t < self.t - RESTARTED_S:
            self._forget()
            self._values[ids.ATTITUDE] = self.at, values
        if not t <= self.t:
            self.t = t

    def _forget(self) -> None:
        """Know nothing any more of a flight that is over; its messages and events stay listed."""
        self.t, self._safe_set, self._mode, self._led = math.nan, None, "", (math.nan, None)
        self._plan = ()
        self._transfer.discard()
        for kept in (self._values, self._timings, self._told, self._pieces, self._conditions):
            kept.clear()

    def read_arm(self, values: tuple[Any, ...]) -> None:
        """Take an ARM_JOINT_STATE of as many joints as the airframe has."""
        _check_fit("joints", int(values[STATE_COUNT_AT]), self.airframe.bodies.joints)

    def read_servos(self, values: tuple[Any, ...]) -> None:
        """Take a SERVO_OUTPUT_RAW: of the rotors, perhaps of the joints, of nothing while disarmed.

        More outputs than that are of another vehicle, and fewer than rotors too.
        """
        used, rotors = sum(pulse > 0 for pulse in _pulses(values)), self.airframe.rotors
        outputs = min(rotors + self.airframe.bodies.joints, _OUTPUTS)
        if used and not rotors <= used <= outputs:
            _check_fit("rotors and joints", used, outputs)

    def read_plan(self, _: tuple[Any, ...]) -> None:
        """Take a plan, once both messages of it have come where it is sent in two."""
        joints = self.airframe.bodies.joints
        at, plan = self._values.get(ids.MPC_HORIZON, _NEVER)
        arm = self._values.get(ids.MPC_HORIZON_ARM, _NEVER)[1]
        if arm:
            _check_fit("joints", arm[55], joints)
        if not plan or (joints > HORIZON_JOINTS and arm[53:55] != (plan[56], plan[58])):
            return
        known = plan[1:], arm[1:] if joints > HORIZON_JOINTS else ()
        led = self._led[1] if known == self._plan else _horizon_of(plan, arm, self.airframe)
        self._plan, self._led = known, (at, led)

    def read_zone(self, values: tuple[Any, ...]) -> None:
        """Take one shape of the safe set; the set changes when it is whole."""
        index, whole = int(values[23]), SafeSet() if values[24] == 0 else None
        if whole is None:
            problem = "it is of no known kind or has no place in its set"
            try:
                indexed = decode.obstacle_shape(cast("tuple[float, ...]", values))
            except decode.RefusedError as error:
                indexed, problem = None, str(error)
            if indexed is None:
                self._leave_out(index, f"zone {index + 1} is not shown: {problem}")
                return
            whole = self._transfer.add(indexed)
        else:
            self._transfer.discard()
        if whole is not None:
            self._safe_set, self.set_problem = whole, ""
            self.whole_sets += 1

    def _leave_out(self, index: int, sentence: str) -> None:
        """Know nothing of a set with a zone that cannot be shown; count the zone."""
        self._transfer.discard()
        self._safe_set, self.set_problem = None, sentence
        self.left_out += 1
        self.tell(f"zone {index}", sentence)

    def tell(self, of: str, sentence: str) -> None:
        """List a sentence ``of`` something; what is said again and again is listed once."""
        if sentence not in self._told.values():
            self.note(EventKind.WARNING, sentence)
        self._told[of] = sentence

    def announced(self, since: float) -> tuple[Zone, ...]:
        """The zones that were announced, as the vehicle has said ``since`` [s, listener's clock].

        Raises:
            RefusedError: It has not said it: what it reports is less than it keeps.
        """
        if self._safe_set is None:
            raise decode.RefusedError(self.set_problem or "the vehicle does not say what it keeps")
        zones, (at, mission) = self._safe_set.zones, self._values.get(ids.MISSION_CURRENT, _NEVER)
        if any(any(zone.velocity) for zone in zones):
            raise decode.RefusedError("zones move, and who announces them would take it away again")
        if zones and not (at >= since and mission[_FENCE_ID_AT] == 0):
            known = "a fence is in force" if at >= since else "there may be a fence"
            raise decode.RefusedError(
                f"{known}, and the vehicle does not say which zones are of it: announce the "
                "obstacle from where the safe set comes from"
            )
        return zones

    def read_beat(self, values: tuple[Any, ...]) -> None:
        """Take a HEARTBEAT."""
        mode = MODE_NAMES.get(values[0], f"mode {values[0]:#x}")
        if mode != self._mode:
            self._mode = mode
            self.note(EventKind.MODE, f"mode {mode}")

    def read_text(self, values: tuple[Any, ...]) -> None:
        """Take a STATUSTEXT; a long one is put together."""
        severity, raw, number, piece = values
        text = raw.rstrip(b"\0")
        if number:
            text = (self._pieces.get(number, b"") if piece else b"") + text
            goes_on = len(raw.rstrip(b"\0")) == len(raw) and len(text) < _MAX_TEXT
            self._pieces = {number: text} if goes_on else {}
            if self._pieces:
                return
        sentence = text.decode("utf-8", "replace")
        if severity < _WARNING:
            self.refusals.append(sentence)
        self.note(EventKind.WARNING if severity <= _WARNING else EventKind.TEXT, sentence)

    def read_event(self, values: tuple[Any, ...]) -> None:
        """EVENT: a failsafe condition that has begun or is over."""
        found = condition_of(int(values[0]), bytes(values[6:]))
        if found is None:
            return
        condition, over = found
        if condition in self._conditions:
            self._conditions.remove(condition)
        if not over:
            self._conditions.append(condition)

    def read_answer(self, values: tuple[Any, ...]) -> None:
        """Take a COMMAND_ACK."""
        command, result = int(values[0]), int(values[1])
        if command in _REQUESTS:
            return
        self.answers.append((command, result))
        self.note(EventKind.COMMAND, f"{command_name(command)}: {result_name(result)}")

    def read_parameter(self, values: tuple[Any, ...]) -> None:
        """Take a PARAM_VALUE."""
        field, _, _, name, type_ = values
        value = value_of(field, type_)
        known = _text(name)
        room = known in self.parameters or len(self.parameters) < _MAX_PARAMETERS
        if room and value is not None:
            self.parameters[known] = value

    def read_timing(self, values: tuple[Any, ...]) -> None:
        """Take a LOOP_TIMING."""
        group = int(values[11])
        if group < len(GROUPS):
            timing = Timing(
                name=GROUPS[group],
                period=1e-6 * values[4],
                execution_p99=1e-6 * values[6],
                late=int(values[2]),
                skipped=int(values[3]),
            )
            self._timings[group] = self.at, timing


def _arm(values: tuple[Any, ...], which: int) -> JointVector:
    """Positions (0), velocities (1) or torques (2) of an ARM_JOINT_STATE."""
    return joined(values, *STATE_AT[which], int(values[STATE_COUNT_AT]))


def _margin_name(k: int, count: int, safe_set: SafeSet | None, points: tuple[str, ...]) -> str:
    zones = safe_set.zones if safe_set is not None else ()
    if zones and count == len(zones):
        return f"{zones[k].shape.kind} {k + 1}"
    if count % len(points) == 0:
        zone = k // len(points)
        kind = zones[zone].shape.kind if zone < len(zones) else "zone"
        return f"{kind} {zone + 1}/{points[k % len(points)]}"
    return f"zone {k + 1}"


def _solver(values: tuple[Any, ...]) -> Solver:
    timed = values[2] != _UNTIMED
    return Solver(
        status=status_name(int(values[15])),
        total=1e-6 * values[2] if timed else math.nan,
        solve=1e-6 * values[4] if timed else math.nan,
        iterations=int(values[14]),
        slack=values[9],
        missed=int(values[6]),
        fallbacks=int(values[7]),
    )


def first_line(error: Exception) -> str:
    """Why something failed; of a reason of many lines the first."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _check_fit(what: str, said: int, chosen: int) -> None:
    """Refuse a number that contradicts the airframe.

    Raises:
        RefusedError: It does.
    """
    if said != chosen:
        raise decode.RefusedError(
            f"the vehicle has {said} {what}, the airframe that was chosen {chosen}: it is not "
            "drawn; choose its own by --airframe"
        )


def _is_known(age: float, lasts: float) -> bool:
    """Whether what came ``age`` [s] ago is so yet; of an unknown age it is not.

    A clock that was set, as that of a log's file, makes an age negative.
    """
    return abs(age) <= lasts


def _pulses(servos: tuple[Any, ...]) -> tuple[int, ...]:
    """Of a SERVO_OUTPUT_RAW [us]; 0 where nothing is put out."""
    return (*servos[1:9], *servos[10:18])


def _target(values: tuple[Any, ...] | None) -> Vec3 | None:
    if values is None or values[12] & _IGNORE_POSITION:
        return None
    return vec3(values[1:4]) if all(map(math.isfinite, values[1:4])) else None


def _sigma(values: tuple[Any, ...] | None) -> Vec3 | None:
    if values is None or not values[7] > 0.0:
        return None
    level = values[7] / math.sqrt(2.0)
    return level, level, values[8]


def _battery(values: tuple[Any, ...] | None) -> Battery | None:
    if values is None or values[12] < 0:
        return None
    return Battery(1e-3 * values[4], 0.01 * values[12])


def _dropped(values: tuple[Any, ...] | None) -> str:
    counts = (0,) * len(_LOSSES) if values is None else (values[7], *values[8:10], values[11])
    return ", ".join(f"{n} {what}" for n, what in zip(counts, _LOSSES, strict=True) if n)


def _tool(values: tuple[Any, ...] | None) -> Tool | None:
    if values is None or not all(map(math.isfinite, values[1:8])):
        return None
    pressed, asked, most = (float(values[k]) for k in (4, 7, 8))
    return Tool(vec3(values[1:4]), pressed, asked, most, bool(values[10]))


def _horizon_of(plan: tuple[Any, ...], arm: tuple[Any, ...], airframe: Airframe) -> Horizon | None:
    """Where an MPC_HORIZON leads; with more joints than it has, its MPC_HORIZON_ARM too."""
    joints, steps, x, u = airframe.bodies.joints, int(plan[58]), plan[1:20], plan[20:56]
    q, qd = (arm[1:9], arm[9:17]) if joints > HORIZON_JOINTS else (x[15:17], x[17:19])
    if not 0 < steps <= _STEPS or not plan[57]:
        return None
    if not all(abs(one) <= _BELIEVED for one in (*plan[1:56], *arm[1:53])):
        return None
    start = PredictionState(
        x[0:3], x[3:6], x[6:9], x[9:11], x[11:13], x[13], x[14], q[:joints], qd[:joints]
    )
    inputs = []
    for k in range(steps):
        one = u[6 * k : 6 * k + 6]
        more = arm[17 + joints * k :] if joints > HORIZON_JOINTS else one[4:]
        inputs.append(PlanInput(one[0:3], one[3], more[:joints]))
    return horizon(start, tuple(inputs), 1e-6 * plan[57], airframe)


def _text(padded: bytes) -> str:
    return padded.partition(b"\0")[0].decode("utf-8", "replace")


def _shown(value: Any) -> str:
    if isinstance(value, bytes):
        return repr(_text(value))
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _is_of_vehicle(frame: Frame) -> bool:
    """Whether the vehicle itself speaks: a gimbal or companion may have its system's number."""
    if frame.message_id == ids.HEARTBEAT and frame.payload_values[2] == _NO_AUTOPILOT:
        return False
    ours = frame.component_id == ids.AUTOPILOT or frame.message_id >= _OUR_MESSAGES
    return frame.system_id == ids.SYSTEM_ID and ours


def _nothing(_: Telemetry, values: tuple[Any, ...]) -> None:
    """Only the values are kept."""


_LASTS: Final = {
    **dict.fromkeys(
        (
            *(ids.ATTITUDE, ids.LOCAL_POSITION_NED, ids.ARM_JOINT_STATE, ids.SERVO_OUTPUT_RAW),
            *(ids.END_EFFECTOR_TARGET, ids.BARRIER_MARGIN, ids.TOOL_CONTACT),
        ),
        _SHORT_S,
    ),
    **dict.fromkeys((ids.ESTIMATOR_STATUS, ids.PAYLOAD_STATUS), _LONG_S),
}

READERS: Final[dict[int, Callable[[Telemetry, tuple[Any, ...]], None]]] = {
    **dict.fromkeys(
        (
            *(ids.SYS_STATUS, ids.LOCAL_POSITION_NED, ids.MISSION_CURRENT, ids.ESTIMATOR_STATUS),
            *(ids.EXTENDED_SYS_STATE, ids.END_EFFECTOR_TARGET, ids.BARRIER_MARGIN),
            *(ids.SETPOINT_STATUS, ids.MPC_STATUS, ids.TOOL_CONTACT, ids.PAYLOAD_STATUS),
        ),
        _nothing,
    ),
    ids.HEARTBEAT: Telemetry.read_beat,
    ids.PARAM_VALUE: Telemetry.read_parameter,
    ids.ATTITUDE: Telemetry.read_clock,
    ids.SERVO_OUTPUT_RAW: Telemetry.read_servos,
    ids.COMMAND_ACK: Telemetry.read_answer,
    ids.EVENT: Telemetry.read_event,
    ids.STATUSTEXT: Telemetry.read_text,
    ids.ARM_JOINT_STATE: Telemetry.read_arm,
    ids.LOOP_TIMING: Telemetry.read_timing,
    ids.OBSTACLE_SHAPE: Telemetry.read_zone,
    ids.MPC_HORIZON: Telemetry.read_plan,
    ids.MPC_HORIZON_ARM: Telemetry.read_plan,
}
