"""Messages received since the last tick, from all links."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, cast

from fsw.geometry.geodesy import DEFAULT_ORIGIN, to_local
from fsw.link.wire import decode, decode_commands, decode_setpoints, message_ids
from fsw.link.wire.decode import Numbers
from fsw.signals import (
    AttitudeSetpoint,
    Command,
    CommandRequest,
    EndEffectorTarget,
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
    Zone,
)
from fsw.tuning import Tuning
from messages.frames import Frame

_MAX_COMMANDS: Final = 16  # a tick; a client sends one at a time and repeats it
_MAX_TARGETS: Final = 64  # a tick
_MAX_ANNOUNCEMENTS: Final = 4  # a tick
_MAX_ANNOUNCERS: Final = 8  # whose safe sets may be incomplete at the same time
_GROUND_STATION: Final = 6  # MAV_TYPE
UNKNOWN_SOURCE: Final = MessageSource(0, 0, "unknown")

Setpoint = MotionSetpoint | AttitudeSetpoint | JointSetpoint


@dataclass(frozen=True, slots=True)
class Setpoints:
    """The newest offboard setpoints; at most one of motion and attitude."""

    motion: MotionSetpoint | None = None
    attitude: AttitudeSetpoint | None = None
    joints: JointSetpoint | None = None
    refused: int = 0  # that were of no use


NO_SETPOINTS: Final = Setpoints()


@dataclass(slots=True)
class _Incomplete:
    """The zones that one source has announced so far, of a set of ``count``."""

    count: int
    zones: dict[int, Zone]


class Inbox:
    """Collects commands, targets and safe sets until a tick takes them.

    Bounded: what does not fit is dropped and counted, as a lost datagram would be.
    """

    def __init__(self, origin: Origin = DEFAULT_ORIGIN) -> None:
        """Begin empty; commands name places on Earth, from ``origin`` of the local frame on."""
        self._locate = partial(to_local, origin)
        self.refused = 0  # messages with numbers of no use, or too many of them
        self._commands: list[Command] = []
        self._targets: list[EndEffectorTarget] = []
        self._setpoints = NO_SETPOINTS
        self._station_heard = False
        self._announced: list[SafeSetAnnouncement] = []
        # By source: the walls of two announcers must not mix.
        self._incomplete: dict[MessageSource, _Incomplete] = {}
        self._source = UNKNOWN_SOURCE  # of the frame that is read now
        self._handlers: dict[int, Callable[[Frame], None]] = {
            message_ids.COMMAND_LONG: partial(self._command, decode.command_long),
            message_ids.COMMAND_INT: partial(self._command, decode.command_int),
            message_ids.SET_MODE: partial(self._command, decode.set_mode),
            message_ids.END_EFFECTOR_TARGET: self._target,
            message_ids.SET_POSITION_TARGET_LOCAL_NED: partial(
                self._setpoint, 13, decode_setpoints.body_setpoint
            ),
            message_ids.SET_ATTITUDE_TARGET: partial(
                self._setpoint, 9, decode_setpoints.attitude_setpoint
            ),
            message_ids.ARM_JOINT_SETPOINT: partial(
                self._setpoint, 13, decode_setpoints.joint_setpoint
            ),
            message_ids.HEARTBEAT: self._heartbeat,
            message_ids.OBSTACLE_WALL: partial(self._obstacle, 5, decode.obstacle_wall),
            message_ids.OBSTACLE_POINT: partial(self._obstacle, 4, decode.obstacle_point),
            message_ids.WORKSPACE_SPHERE: self._sphere,
        }

    @property
    def message_ids(self) -> frozenset[int]:
        """What it keeps something of."""
        return frozenset(self._handlers)

    def accept(self, frame: Frame, source: MessageSource = UNKNOWN_SOURCE) -> None:
        """Keep what the frame says if it is for this vehicle and of use; never raises."""
        handler = self._handlers.get(frame.message_id)
        if handler is not None:
            self._source = source
            handler(frame)

    def take_commands(self) -> tuple[Command, ...]:
        """Hand over the commands, in order of arrival."""
        if not self._commands:
            return ()
        taken = tuple(self._commands)
        self._commands.clear()
        return taken

    def take_targets(self) -> tuple[EndEffectorTarget, ...]:
        """Hand over the trajectory points, in order of arrival."""
        if not self._targets:
            return ()
        taken = tuple(self._targets)
        self._targets.clear()
        return taken

    def take_announced(self) -> tuple[SafeSetAnnouncement, ...]:
        """Hand over the safe sets that are complete, in order of arrival."""
        if not self._announced:
            return ()
        taken = tuple(self._announced)
        self._announced.clear()
        return taken

    def take_setpoints(self) -> Setpoints:
        """Hand over the newest setpoints for now."""
        taken, self._setpoints = self._setpoints, NO_SETPOINTS
        return taken

    def take_inputs(
        self,
        sensors: SensorFrame,
        plan: Plan | PlanFailure | None,
        tuning: Tuning | None,
        mission: MissionUpdate | None,
        stale_us: int = 0,
    ) -> TickInputs:
        """Everything since the last tick, and what did not come from the ground.

        The sensors' readings are ``stale_us`` older than their stamp says.
        """
        setpoints = self.take_setpoints()
        # By position: it is made in every tick.
        return TickInputs(
            sensors,
            plan,
            self.take_commands(),
            self.take_targets(),
            self.take_announced(),
            setpoints.motion,
            setpoints.attitude,
            setpoints.joints,
            setpoints.refused,
            self.take_station_heard(),
            mission,
            tuning,
            stale_us,
        )

    def take_station_heard(self) -> bool:
        """Whether a ground station's heartbeat came."""
        taken, self._station_heard = self._station_heard, False
        return taken

    def _command(self, read: Callable[[Frame], CommandRequest | None], frame: Frame) -> None:
        request = read(frame)
        if request is None:
            return
        if len(self._commands) >= _MAX_COMMANDS:
            self.refused += 1
            return
        self._commands.append(decode_commands.command(request, self._locate))

    def _target(self, frame: Frame) -> None:
        values = cast(Numbers, frame.payload_values)
        if values[0] == 0:  # not for a later time: for now
            self._setpoint(13, decode_setpoints.end_effector_setpoint, frame)
            return
        if not decode.for_this_vehicle(values[13], values[14]):
            return
        target = decode.end_effector_target(values)
        if target is None or len(self._targets) >= _MAX_TARGETS:
            self.refused += 1
            return
        self._targets.append(target)

    def _setpoint(self, at: int, read: Callable[[Numbers], Setpoint | None], frame: Frame) -> None:
        """Keep the newest of each kind; one for another vehicle is refused like a wrong one.

        The target stands at the values ``at`` and behind.
        """
        values = cast(Numbers, frame.payload_values)
        setpoint = read(values) if decode.for_this_vehicle(*values[at : at + 2]) else None
        kept = self._setpoints
        if setpoint is None:
            self.refused += 1
            self._setpoints = replace(kept, refused=kept.refused + 1)
        elif isinstance(setpoint, JointSetpoint):
            self._setpoints = replace(kept, joints=setpoint)
        elif isinstance(setpoint, AttitudeSetpoint):
            self._setpoints = replace(kept, attitude=setpoint, motion=None)
        else:
            self._setpoints = replace(kept, motion=setpoint, attitude=None)

    def _heartbeat(self, frame: Frame) -> None:
        if frame.payload_values[1] == _GROUND_STATION:
            self._station_heard = True

    def _obstacle(
        self, at: int, read: Callable[[Numbers], decode.IndexedObstacle | None], frame: Frame
    ) -> None:
        values = cast(Numbers, frame.payload_values)
        if not decode.for_this_vehicle(*values[at : at + 2]):
            return
        indexed = read(values)
        if indexed is None:
            self.refused += 1
            return
        incomplete = self._incomplete.pop(self._source, None)
        if incomplete is None or indexed.count != incomplete.count:
            # Another count announces another set; those of two sets must not mix.
            incomplete = _Incomplete(indexed.count, {})
        zones = incomplete.zones
        zones[indexed.index] = indexed.zone
        if len(zones) < indexed.count:
            self._incomplete[self._source] = incomplete
            if len(self._incomplete) > _MAX_ANNOUNCERS:
                del self._incomplete[next(iter(self._incomplete))]
            return
        self._announce(SafeSet(tuple(zones[i] for i in range(indexed.count))))

    def _announce(self, safe_set: SafeSet) -> None:
        """Keep the newest safe set of a source."""
        kept = [one for one in self._announced if one.source != self._source]
        if len(kept) >= _MAX_ANNOUNCEMENTS:
            self.refused += 1
            return
        self._announced = [*kept, SafeSetAnnouncement(self._source, safe_set)]

    def _sphere(self, frame: Frame) -> None:
        values = cast(Numbers, frame.payload_values)
        if not decode.for_this_vehicle(values[4], values[5]):
            return
        sphere = decode.workspace_sphere(values)
        if sphere is None:
            self.refused += 1
            return
        self._announce(SafeSet((sphere,)))
