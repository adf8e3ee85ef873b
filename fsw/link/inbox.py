"""Messages received since the last tick, from all links."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import partial
from typing import Any, Final, TypeVar, cast

from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN, to_local
from fsw.autopilot.measurements import Sample
from fsw.autopilot.signals import (
    AttitudeSetpoint,
    BatteryReading,
    Command,
    CommandAck,
    CommandRequest,
    CommandResult,
    EndEffectorTarget,
    HostHealth,
    JointSetpoint,
    MessageSource,
    MissionUpdate,
    MotionSetpoint,
    Origin,
    Plan,
    PlanFailure,
    SafeSet,
    SafeSetAnnouncement,
    SensorFrame,
    TickInputs,
)
from fsw.autopilot.tuning import Tuning
from fsw.link.wire import decode, decode_commands
from fsw.link.wire.decode import Numbers
from fsw.link.wire.decode_sensors import battery_reading
from fsw.link.wire.decode_setpoints import (
    actuator_setpoint,
    attitude_setpoint,
    body_setpoint,
    end_effector_setpoint,
    global_setpoint,
    joint_setpoint,
)
from fsw.link.wire.zone_transfer import ZoneTransfer
from messages import message_ids
from messages.frames import Frame

_MAX_COMMANDS: Final = 16  # a tick; a client sends one at a time and repeats it
_MAX_PUT_OFF: Final = 64  # more of them a tick and link, which are answered and not carried out
_MAX_TARGETS: Final = 64  # a tick
_MAX_ANNOUNCEMENTS: Final = 4  # a tick
_MAX_OF_ADDRESS: Final = 2  # of them, and so many sets of one address may be incomplete at once
_MAX_REASONS: Final = 4  # a tick, of refusals; more are counted
_MAX_INCOMPLETE: Final = 16  # safe sets, at the same time
MAX_SAMPLES: Final = 512  # a tick; a second of a suite has some 1300
_GROUND_STATION: Final = 6  # MAV_TYPE
_CROWDED: Final = "a safe set is left out: too many sources announce one at once"
UNKNOWN_SOURCE: Final = MessageSource(0, 0, "unknown")

T = TypeVar("T")
Setpoint = MotionSetpoint | AttitudeSetpoint | JointSetpoint


@dataclass(slots=True)
class Received:
    """What came since the last tick; the names are those of ``TickInputs``."""

    commands: list[Command] = field(default_factory=list)  # in order of arrival
    targets: list[EndEffectorTarget] = field(default_factory=list)  # the same
    announced: list[SafeSetAnnouncement] = field(default_factory=list)  # safe sets, the same
    motion: MotionSetpoint | None = None  # the newest; at most one of motion and attitude
    attitude: AttitudeSetpoint | None = None
    joints: JointSetpoint | None = None
    refused_setpoints: int = 0  # that were of no use
    setpoint_problem: str = ""  # why the newest of them was; empty: it was for another vehicle
    ground_station_heard: bool = False  # a ground station's heartbeat
    samples: list[Sample] = field(default_factory=list)  # of sensors, in order of arrival
    battery: BatteryReading | None = None  # the newest
    sensor_clock_jump_us: int = 0
    refused: list[str] = field(default_factory=list)  # why, of the first


_RECEIVED: Final = tuple(one.name for one in fields(Received))


class Inbox:
    """Collects commands, targets and safe sets until a tick takes them.

    Bounded: what does not fit is dropped and counted, as a lost datagram would be, and of safe sets
    it is told. A command is answered all the same. Room is shared out by address, because anybody
    can write any ids, and the ``owner`` of the safe set has always some.
    """

    def __init__(self, origin: Origin = DEFAULT_ORIGIN) -> None:
        """Begin empty; commands name places on Earth, from ``origin`` of the local frame on."""
        self.locate = partial(to_local, origin)
        self.owner: MessageSource | None = None  # of the safe set in force
        self.refused = 0  # messages with numbers of no use, or too many of them
        self._received = Received()
        self._is_news = False  # there is more in it than samples
        self._put_off: dict[str, int] = {}  # commands answered since the last tick, by link
        # By source: the walls of two announcers must not mix.
        self._transfers: dict[MessageSource, ZoneTransfer] = {}
        self._source = UNKNOWN_SOURCE  # of the frame that is read now
        self._handlers: dict[int, Callable[[Frame], CommandAck | None]] = {
            message_ids.COMMAND_LONG: partial(self._command, decode.command_long),
            message_ids.COMMAND_INT: partial(self._command, decode.command_int),
            message_ids.SET_MODE: partial(self._command, decode.set_mode),
            message_ids.END_EFFECTOR_TARGET: self._target,
            message_ids.SET_POSITION_TARGET_LOCAL_NED: partial(self._setpoint, body_setpoint),
            message_ids.SET_POSITION_TARGET_GLOBAL_INT: partial(
                self._setpoint, partial(global_setpoint, self.locate)
            ),
            message_ids.SET_ATTITUDE_TARGET: partial(self._setpoint, attitude_setpoint),
            message_ids.ARM_JOINT_SETPOINT: partial(self._setpoint, joint_setpoint),
            message_ids.SET_ACTUATOR_CONTROL_TARGET: partial(self._setpoint, actuator_setpoint),
            message_ids.HEARTBEAT: self._heartbeat,
            message_ids.OBSTACLE_WALL: partial(self._obstacle, decode.obstacle_wall),
            message_ids.OBSTACLE_POINT: partial(self._obstacle, decode.obstacle_point),
            message_ids.OBSTACLE_SHAPE: partial(self._obstacle, decode.obstacle_shape),
            message_ids.WORKSPACE_SPHERE: self._sphere,
        }

    @property
    def message_ids(self) -> frozenset[int]:
        """What it keeps something of."""
        return frozenset(self._handlers)

    def accept(self, frame: Frame, source: MessageSource = UNKNOWN_SOURCE) -> CommandAck | None:
        """Keep what the frame says if it is for this vehicle and of use; never raises.

        Returns what is to be answered at once: to a command for which there is no room.
        """
        handler = self._handlers.get(frame.message_id)
        if handler is None:
            return None
        self._source, self._is_news = source, True
        return handler(frame)

    def accept_command(self, command: Command) -> None:
        """Keep a command of our own, which is carried out in the next tick."""
        self._is_news = True
        self._received.commands.append(command)

    def accept_samples(self, samples: list[Sample]) -> None:
        """Keep what sensors have measured; the oldest go where a tick has taken none for long."""
        kept = self._received.samples
        kept += samples
        if len(kept) > MAX_SAMPLES:
            self.refused += len(kept) - MAX_SAMPLES
            del kept[:-MAX_SAMPLES]

    def accept_battery(self, values: Numbers) -> None:
        """Keep what a BATTERY_STATUS says, if it knows the battery's voltage and charge."""
        reading = battery_reading(values)
        if reading is not None:
            self._is_news, self._received.battery = True, reading

    def accept_clock_jump(self, jump_us: int) -> None:
        """Keep by how much [us] the sensors' clock has jumped against the vehicle's time."""
        self._is_news = True
        self._received.sensor_clock_jump_us += jump_us

    def take(self) -> Received:
        """Hand over what came."""
        taken, self._received, self._is_news = self._received, Received(), False
        self._put_off.clear()
        return taken

    def take_inputs(
        self,
        sensors: SensorFrame,
        plan: Plan | PlanFailure | None,
        tuning: Tuning | None,
        mission: MissionUpdate | None,
        stale_us: int = 0,
        host: HostHealth | None = None,
    ) -> TickInputs:
        """Everything since the last tick, and what did not come from the ground.

        The sensors' readings are ``stale_us`` older than their stamp says.
        """
        inputs = TickInputs(
            sensors,
            plan,
            mission=mission,
            tuning=tuning,
            stale_us=stale_us,
            samples=tuple(self._received.samples),
            host=host,
        )
        if not self._is_news:  # as in most ticks: there are samples alone
            self._received.samples = []
            return inputs
        came = self.take()
        came.announced = [_begun(one, sensors.t_us) for one in came.announced]
        news: dict[str, Any] = {name: getattr(came, name) for name in _RECEIVED}
        news |= {name: tuple(values) for name, values in news.items() if isinstance(values, list)}
        return replace(inputs, **news)

    def _command(self, read: Callable[[Frame], CommandRequest], frame: Frame) -> CommandAck | None:
        if not decode.for_this_vehicle(frame):
            return None
        request = read(frame)
        if len(self._received.commands) >= _MAX_COMMANDS:
            self.refused += 1
            return self._later(request)
        self._received.commands.append(decode_commands.command(request, self.locate))
        return None

    def _later(self, request: CommandRequest) -> CommandAck | None:
        """The answer to a command that came too many; a flood of them is not answered."""
        link = self._source.link
        answered = self._put_off.get(link, 0)
        if answered >= _MAX_PUT_OFF:
            return None
        self._put_off[link] = answered + 1
        return request.answer(CommandResult.TEMPORARILY_REJECTED)

    def _target(self, frame: Frame) -> None:
        values = cast(Numbers, frame.payload_values)
        if values[0] == 0:  # not for a later time: for now
            self._setpoint(end_effector_setpoint, frame)
            return
        if not decode.for_this_vehicle(frame):
            return
        target = self._read(decode.end_effector_target, values)
        if target is None:
            return
        if len(self._received.targets) >= _MAX_TARGETS:
            self.refused += 1
            return
        self._received.targets.append(target)

    def _setpoint(self, read: Callable[[Numbers], Setpoint], frame: Frame) -> None:
        """Keep the newest of each kind; one for another vehicle is counted with the wrong ones."""
        values, received = cast(Numbers, frame.payload_values), self._received
        setpoint, problem = None, ""
        if decode.for_this_vehicle(frame):
            try:
                setpoint = read(values)
            except decode.RefusedError as error:
                problem = f"{error}; from {self._source}"
        if setpoint is None:
            self.refused += 1
            received.refused_setpoints += 1
            received.setpoint_problem = problem or received.setpoint_problem
        elif isinstance(setpoint, JointSetpoint):
            received.joints = setpoint
        elif isinstance(setpoint, AttitudeSetpoint):
            received.attitude, received.motion = setpoint, None
        else:
            received.motion, received.attitude = setpoint, None

    def _heartbeat(self, frame: Frame) -> None:
        if frame.payload_values[1] == _GROUND_STATION:
            self._received.ground_station_heard = True

    def _obstacle(
        self, read: Callable[[Numbers], decode.IndexedObstacle | None], frame: Frame
    ) -> None:
        if not decode.for_this_vehicle(frame):
            return
        source = self._source
        if source not in self._transfers:
            self._make_room()
        transfer = self._transfers.setdefault(source, ZoneTransfer())
        indexed = self._read(read, cast(Numbers, frame.payload_values))
        if indexed is None:
            transfer.discard()
            return
        was_lost = transfer.is_lost
        if transfer.is_begun and indexed.index == 0:
            self._refuse()  # the rest of the last one is lost
        safe_set = transfer.add(indexed)
        if safe_set is not None:
            self._announce(safe_set)
        elif transfer.is_lost:
            problem = (
                f"zone {indexed.index + 1} of {indexed.count} does not follow the one before: "
                f"the set is left out; send it again from zone 1; from {source}"
            )
            self._refuse("" if was_lost else problem)

    def _make_room(self) -> None:
        """Forget a set that is incomplete, of this source's address if it has more than its share.

        Else that of the newest source: who has been there for longer keeps its place.
        """
        self._transfers = {one: its for one, its in self._transfers.items() if not its.is_whole}
        others = [one for one in self._transfers if not one.is_same(self.owner)]
        own = [one for one in others if one.place == self._source.place]
        full = own if len(own) >= _MAX_OF_ADDRESS else others[::-1]
        if full is own or len(others) >= _MAX_INCOMPLETE:
            del self._transfers[full[0]]
            self._refuse(_CROWDED)

    def _announce(self, safe_set: SafeSet) -> None:
        """Keep the newest safe set of a source."""
        source = self._source
        kept, owns = self._received.announced, source.is_same(self.owner)
        kept = [one for one in kept if one.source != source]
        of_address = sum(one.source.place == source.place for one in kept)
        if len(kept) >= _MAX_ANNOUNCEMENTS or (of_address >= _MAX_OF_ADDRESS and not owns):
            self._refuse(_CROWDED)
            if not owns:
                return
            kept.pop()
        self._received.announced = [*kept, SafeSetAnnouncement(source, safe_set)]

    def _sphere(self, frame: Frame) -> None:
        if not decode.for_this_vehicle(frame):
            return
        sphere = self._read(decode.workspace_sphere, cast(Numbers, frame.payload_values))
        if sphere is not None:
            self._announce(SafeSet((sphere,)))

    def _read(self, read: Callable[[Numbers], T | None], values: Numbers) -> T | None:
        """What a message means; None where it is refused, which is counted and perhaps told."""
        try:
            meaning = read(values)
        except decode.RefusedError as error:
            self._refuse(f"{error}; from {self._source}")
            return None
        if meaning is None:
            self._refuse()
        return meaning

    def _refuse(self, reason: str = "") -> None:
        """Count something that is of no use, and tell why, of the first of a tick."""
        self.refused += 1
        if reason and len(self._received.refused) < _MAX_REASONS:
            self._received.refused.append(reason)


def _begun(announcement: SafeSetAnnouncement, now_us: int) -> SafeSetAnnouncement:
    """The same with zones that move, and did not say since when, where they are now."""
    zones = announcement.safe_set.zones
    if all(zone.t_us or not any(zone.velocity) for zone in zones):
        return announcement
    begun = (
        replace(zone, t_us=now_us) if any(zone.velocity) and not zone.t_us else zone
        for zone in zones
    )
    return SafeSetAnnouncement(announcement.source, SafeSet(tuple(begun)))
