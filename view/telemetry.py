"""What a vehicle's telemetry says, message by message: for a live view and for a ``.tlog``."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, cast

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.parameters.param_type import value_of
from fsw.autopilot.signals import (
    CommandResult,
    JointVector,
    PlanInput,
    PredictionState,
    RotorVector,
    SafeSet,
    Vec3,
    Vec4,
    Zone,
)
from fsw.link.events.event_table import condition_of
from fsw.link.wire import decode
from fsw.link.wire.px4_mode import AVAILABLE_MODES
from messages import dialect
from messages import message_ids as ids
from messages.frames import Frame, wire_fields
from messages.joint_arrays import STATE_AT, STATE_COUNT_AT, joined
from view.flight_events import EventKind
from view.log_flight import GROUPS, status_name
from view.scene import (
    Battery,
    Event,
    Held,
    Horizon,
    Margin,
    Posture,
    Safety,
    Scene,
    Solver,
    Timing,
    Tool,
)
from view.vehicle import horizon

_EVENTS: Final = 500
# Of a vehicle and all that speak beside it; what is beyond somebody makes up.
_MAX_HEARD: Final = 4096  # kinds of messages
_MAX_PARAMETERS: Final = 4096
_MAX_TEXT: Final = 255 * 50  # bytes of one sentence, as STATUSTEXT numbers its pieces
_IGNORE_POSITION: Final = 0x7
_ARMED, _FAILSAFE, _TERMINATED = 128, 5, 8
_ON_GROUND: Final = 1
_STEPS: Final = 6  # most of an MPC_HORIZON
_REQUESTS: Final = (511, 512)  # of messages; their answers are of no interest
_UNTIMED: Final = 0xFFFFFFFF
_OUR_MESSAGES: Final = 60_200  # the first number of the dialect, which one component alone speaks
RESTARTED_S: Final = 5.0  # by which its clock goes back where a vehicle starts again
_SHORT_S: Final = 1.0  # what was said longer ago is not so any more
_AVERAGE: Final = 0.2  # weight of the newest interval in a rate
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
    interval: float = math.nan  # s, of late
    values: tuple[Any, ...] = ()

    @property
    def name(self) -> str:
        """As the dialect has it."""
        return str(dialect.mavlink_map[self.message_id].msgname)

    def rate(self, now: float) -> float:
        """How often it comes [1/s], at ``now`` [s]; 0 once it has stopped."""
        if not self.interval > 0.0 or now - self.at > 3.0 * self.interval + 1.0:
            return 0.0
        return 1.0 / self.interval

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
    parameter_count: int = 0
    answers: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=20))
    """Commands and their MAV_RESULTs, as they were acknowledged."""
    refusals: deque[str] = field(default_factory=lambda: deque(maxlen=20))
    """Critical texts, the reasons of refusals among them."""
    at: float = math.nan  # s, on the listener's clock, of the newest message
    left_out: int = 0  # zones that cannot be shown, each time that they were sent
    _unshown: dict[int, str] = field(default_factory=dict)  # what was listed of them, by index
    _values: dict[int, tuple[float, tuple[Any, ...]]] = field(default_factory=dict)
    _timings: dict[int, Timing] = field(default_factory=dict)
    _zones: dict[int, Zone] = field(default_factory=dict)
    _safe_set: SafeSet | None = None
    whole_sets: int = 0  # how often the safe set was sent to its end
    _pieces: dict[int, bytes] = field(default_factory=dict)
    _mode: str = ""
    _conditions: list[Condition] = field(default_factory=list)  # of failsafes, that have begun
    _plan: tuple[Any, ...] | None = None  # of which the horizon is known
    _led: Horizon | None = None

    def take(self, frame: Frame, at: float) -> None:
        """Take in a frame that came ``at`` [s, on the listener's clock]."""
        key = (frame.system_id, frame.component_id, frame.message_id)
        one = self.heard.get(key)
        if one is None:
            if len(self.heard) >= _MAX_HEARD:
                return  # no vehicle says so much; somebody makes it up
            self.heard[key] = one = Heard(*key)
        if one.count:
            since = at - one.at
            known = one.interval == one.interval
            one.interval = one.interval + _AVERAGE * (since - one.interval) if known else since
        one.count, one.at, one.values = one.count + 1, at, frame.payload_values
        if not _is_of_vehicle(frame):
            return
        self.at = at
        read = _READERS.get(frame.message_id)
        if read is not None:
            read(self, frame.payload_values)
            self._values[frame.message_id] = (self.t, frame.payload_values)

    def scene(self, now: float = math.nan) -> Scene:
        """What is known at ``now`` [s, on the listener's clock]."""
        position, solver = self._newest(ids.LOCAL_POSITION_NED), self._newest(ids.MPC_STATUS)
        arm, beat = self._newest(ids.ARM_JOINT_STATE), self._newest(ids.HEARTBEAT)
        servos = self._newest(ids.SERVO_OUTPUT_RAW)
        margins, minimum, added, safety = self._margins()
        state = self._newest(ids.EXTENDED_SYS_STATE)
        return Scene(
            t=self.t,
            estimate=self._posture(position, arm),
            velocity=None if position is None else _vec3(position[4:7]),
            thrust=None if servos is None else self._thrust(servos),
            torque=None if arm is None else _arm(arm, 2),
            joint_rates=None if arm is None else _arm(arm, 1),
            target=self._place(ids.END_EFFECTOR_TARGET, mask_at=12),
            base_target=self._place(ids.POSITION_TARGET_LOCAL_NED, mask_at=12),
            horizon=self._horizon(),
            safe_set=self._safe_set,
            margins=margins,
            minimum=minimum,
            added=added,
            sigma=self._sigma(),
            mode=self._mode,
            armed=beat is not None and bool(beat[3] & _ARMED),
            landed=state is not None and state[1] == _ON_GROUND,
            failures=self._failures(beat),
            battery=self._battery(),
            link_age=now - self.at,
            dropped=self._dropped(),
            solver=None if solver is None else _solver(solver),
            timing=tuple(self._timings[group] for group in sorted(self._timings)),
            safety=safety,
            tool=self._tool(),
            held=self._held(),
        )

    def _tool(self) -> Tool | None:
        values = self._newest(ids.TOOL_CONTACT, lasts=_SHORT_S)
        if values is None or not all(map(math.isfinite, values[1:8])):
            return None
        pressed, asked, most = (float(values[k]) for k in (4, 7, 8))
        return Tool(_vec3(values[1:4]), pressed, asked, most, bool(values[10]))

    def _held(self) -> Held | None:
        values = self._newest(ids.PAYLOAD_STATUS)
        return None if values is None else Held(bool(values[2]), float(values[1]))

    def _failures(self, beat: tuple[Any, ...] | None) -> str:
        """By their names, which EVENT has; HEARTBEAT alone says only that there are any."""
        state = None if beat is None else beat[4]
        named = ", ".join(one.value for one in self._conditions)
        if state == _TERMINATED:
            return f"terminated: {named}" if named else "terminated"
        return named or ("failsafe" if state == _FAILSAFE else "")

    def _newest(self, message_id: int, lasts: float = math.inf) -> tuple[Any, ...] | None:
        """The newest values of a message, unless they are older than ``lasts`` [s]."""
        t, values = self._values.get(message_id, (math.nan, None))
        return None if values is None or self.t - t > lasts else values

    def _posture(
        self, position: tuple[Any, ...] | None, arm: tuple[Any, ...] | None
    ) -> Posture | None:
        attitude = self._newest(ids.ATTITUDE)
        if position is None or attitude is None:
            return None
        q_arm = (0.0,) * self.airframe.bodies.joints if arm is None else _arm(arm, 0)
        if not all(map(math.isfinite, (*position[1:4], *attitude[1:4], *q_arm))):
            return None  # an estimate that is lost, or somebody's frame
        return Posture(_vec3(position[1:4]), quaternion(*attitude[1:4]), q_arm)

    def _thrust(self, servos: tuple[Any, ...]) -> RotorVector:
        pulses = servos[1 : 1 + self.airframe.rotors]
        return tuple(
            [
                most * max(pulse - 1000, 0) / 1000.0
                for pulse, most in zip(pulses, self.airframe.rotor_thrust_max, strict=False)
            ]
        )

    def _place(self, message_id: int, mask_at: int) -> Vec3 | None:
        values = self._newest(message_id, lasts=_SHORT_S)
        if values is None or values[mask_at] & _IGNORE_POSITION:
            return None
        return _vec3(values[1:4])

    def _horizon(self) -> Horizon | None:
        values = self._newest(ids.MPC_HORIZON, lasts=_SHORT_S)
        if values is None or not 0 < values[58] <= _STEPS or not values[57]:
            return None
        plan = values[1:57] if all(map(math.isfinite, values[1:56])) else None
        if plan != self._plan:
            self._plan = plan
            known = plan is not None
            self._led = horizon(*_planned(values), self.airframe) if known else None
        return self._led

    def _margins(self) -> tuple[tuple[Margin, ...], float, float, Safety]:
        values = self._newest(ids.BARRIER_MARGIN, lasts=2.0 * _SHORT_S)
        setpoints = self._newest(ids.SETPOINT_STATUS)
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

    def _sigma(self) -> Vec3 | None:
        values = self._newest(ids.ESTIMATOR_STATUS, lasts=3.0)
        if values is None or not values[7] > 0.0:
            return None
        level = values[7] / math.sqrt(2.0)
        return level, level, values[8]

    def _battery(self) -> Battery | None:
        values = self._newest(ids.SYS_STATUS)
        if values is None or values[12] < 0:
            return None
        return Battery(1e-3 * values[4], 0.01 * values[12])

    def _dropped(self) -> str:
        values = self._newest(ids.SYS_STATUS)
        counts = (0,) * len(_LOSSES) if values is None else (values[7], *values[8:10], values[11])
        return ", ".join(f"{n} {what}" for n, what in zip(counts, _LOSSES, strict=True) if n)

    def note(self, kind: EventKind, text: str) -> None:
        """Add an event of now."""
        self.events.append(Event(self.t, kind.value, text))

    def read_clock(self, t: float) -> None:
        """Take the vehicle's time ``t`` [s]; it goes back only if the vehicle starts again."""
        if t < self.t - RESTARTED_S:
            self._forget()
        if not t <= self.t:
            self.t = t

    def _forget(self) -> None:
        """Know nothing any more of a flight that is over; its messages and events stay listed."""
        self.t, self._safe_set, self._mode, self._plan, self._led = math.nan, None, "", None, None
        for kept in (
            *(self._values, self._timings, self._zones, self._unshown, self._pieces),
            self._conditions,
        ):
            kept.clear()

    def read_zone(self, values: tuple[Any, ...]) -> None:
        """Take one shape of the safe set; the set changes when it is whole."""
        if values[24] == 0:
            self._zones, self._safe_set = {}, SafeSet()
            self.whole_sets += 1
            return
        index, problem = int(values[23]), "it is of no known kind or has no place in its set"
        try:
            indexed = decode.obstacle_shape(cast("tuple[float, ...]", values))
        except decode.RefusedError as error:
            indexed, problem = None, str(error)
        if indexed is None:
            self._leave_out(index, f"zone {index + 1} is not shown: {problem}")
            return
        if any(index >= indexed.count for index in self._zones):
            self._zones.clear()
        self._zones[indexed.index] = indexed.zone
        if len(self._zones) == indexed.count:
            self._safe_set = SafeSet(tuple(self._zones[k] for k in range(indexed.count)))
            self.whole_sets += indexed.index == indexed.count - 1

    def _leave_out(self, index: int, sentence: str) -> None:
        """Count a zone that cannot be shown; what is said again and again is listed once."""
        self.left_out += 1
        if self._unshown.get(index) != sentence:
            self._unshown[index] = sentence
            self.note(EventKind.WARNING, sentence)

    def read_beat(self, values: tuple[Any, ...]) -> None:
        """Take a HEARTBEAT."""
        if values[2] == 8:  # MAV_AUTOPILOT_INVALID: of a component, not of the vehicle
            return
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
        field, count, index, name, type_ = values
        value = value_of(field, type_)
        if index < count:
            self.parameter_count = count
        known = _text(name)
        room = known in self.parameters or len(self.parameters) < _MAX_PARAMETERS
        if room and value is not None:
            self.parameters[known] = value

    def read_timing(self, values: tuple[Any, ...]) -> None:
        """Take a LOOP_TIMING."""
        group = int(values[11])
        if group < len(GROUPS):
            self._timings[group] = Timing(
                name=GROUPS[group],
                period=1e-6 * values[4],
                execution_p50=1e-6 * values[5],
                execution_p99=1e-6 * values[6],
                lateness_p99=1e-6 * values[9],
                late=int(values[2]),
                skipped=int(values[3]),
            )


def _arm(values: tuple[Any, ...], which: int) -> JointVector:
    """Positions (0), velocities (1) or torques (2) of an ARM_JOINT_STATE."""
    return joined(values, *STATE_AT[which], int(values[STATE_COUNT_AT]))


def quaternion(roll: float, pitch: float, yaw: float) -> Vec4:
    """Unit quaternion [w, x, y, z] of ZYX angles ``roll``, ``pitch``, ``yaw`` [rad]."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )


def command_name(command: int) -> str:
    """As MAVLink names it."""
    known = dialect.enums["MAV_CMD"].get(command)
    return f"command {command}" if known is None else known.name.removeprefix("MAV_CMD_")


def result_name(result: int) -> str:
    """What became of a command."""
    known = result in list(CommandResult)
    return CommandResult(result).name.lower().replace("_", " ") if known else f"result {result}"


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


def _vec3(values: tuple[Any, ...]) -> Vec3:
    x, y, z = values
    return float(x), float(y), float(z)


def _planned(values: tuple[Any, ...]) -> tuple[PredictionState, tuple[PlanInput, ...], float]:
    """Start, inputs and period [s] of an MPC_HORIZON."""
    x, u = values[1:20], values[20:56]
    start = PredictionState(
        x[0:3], x[3:6], x[6:9], x[9:11], x[11:13], x[13], x[14], x[15:17], x[17:19]
    )
    steps = (u[6 * k : 6 * k + 6] for k in range(values[58]))
    inputs = tuple(PlanInput(one[0:3], one[3], one[4:6]) for one in steps)
    return start, inputs, 1e-6 * values[57]


def _text(padded: bytes) -> str:
    return padded.partition(b"\0")[0].decode("utf-8", "replace")


def _shown(value: Any) -> str:
    if isinstance(value, bytes):
        return repr(_text(value))
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _clock(us: bool) -> Callable[[Telemetry, tuple[Any, ...]], None]:
    scale = 1e-6 if us else 1e-3
    return lambda telemetry, values: telemetry.read_clock(scale * values[0])


def _is_of_vehicle(frame: Frame) -> bool:
    """Whether the vehicle itself speaks: a gimbal or companion may have its system's number."""
    ours = frame.component_id == ids.AUTOPILOT or frame.message_id >= _OUR_MESSAGES
    return frame.system_id == ids.SYSTEM_ID and ours


def _nothing(_: Telemetry, values: tuple[Any, ...]) -> None:
    """Only the values are kept."""


_READERS: Final[dict[int, Callable[[Telemetry, tuple[Any, ...]], None]]] = {
    ids.HEARTBEAT: Telemetry.read_beat,
    ids.SYS_STATUS: _nothing,
    ids.PARAM_VALUE: Telemetry.read_parameter,
    ids.ATTITUDE: _clock(us=False),
    ids.LOCAL_POSITION_NED: _clock(us=False),
    ids.SERVO_OUTPUT_RAW: _nothing,
    ids.COMMAND_ACK: Telemetry.read_answer,
    ids.POSITION_TARGET_LOCAL_NED: _nothing,
    ids.ESTIMATOR_STATUS: _nothing,
    ids.EXTENDED_SYS_STATE: _nothing,
    ids.EVENT: Telemetry.read_event,
    ids.STATUSTEXT: Telemetry.read_text,
    ids.ARM_JOINT_STATE: _clock(us=True),
    ids.END_EFFECTOR_TARGET: _nothing,
    ids.BARRIER_MARGIN: _clock(us=True),
    ids.SETPOINT_STATUS: _nothing,
    ids.MPC_STATUS: _nothing,
    ids.LOOP_TIMING: Telemetry.read_timing,
    ids.OBSTACLE_SHAPE: Telemetry.read_zone,
    ids.MPC_HORIZON: _nothing,
    ids.TOOL_CONTACT: _nothing,
    ids.PAYLOAD_STATUS: _nothing,
}
