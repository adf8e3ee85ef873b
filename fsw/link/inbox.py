"""Messages received since the last tick, from all links."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final, cast

from fsw.geometry.geodesy import DEFAULT_ORIGIN, to_local
from fsw.link.wire import decode, decode_commands, message_ids
from fsw.link.wire.decode import Numbers
from fsw.link.wire.decode_setpoints import (
    attitude_setpoint,
    body_setpoint,
    end_effector_setpoint,
    joint_setpoint,
)
from fsw.signals import (
    AttitudeSetpoint,
    Command,
    CommandRequest,
    EndEffectorTarget,
    JointSetpoint,
    MissionUpdate,
    MotionSetpoint,
    Origin,
    Plan,
    PlanFailure,
    SafeSet,
    SensorFrame,
    TickInputs,
    Zone,
)
from fsw.tuning import Tuning
from messages.frames import Frame

_MAX_COMMANDS: Final = 16  # a tick; a client sends one at a time and repeats it
_MAX_TARGETS: Final = 64  # a tick
_GROUND_STATION: Final = 6  # MAV_TYPE

Setpoint = MotionSetpoint | AttitudeSetpoint | JointSetpoint


@dataclass(slots=True)
class Received:
    """What came since the last tick."""

    commands: list[Command] = field(default_factory=list)  # in order of arrival
    targets: list[EndEffectorTarget] = field(default_factory=list)  # the same
    safe_set: SafeSet | None = None  # newly complete
    motion: MotionSetpoint | None = None  # the newest; at most one of motion and attitude
    attitude: AttitudeSetpoint | None = None
    joints: JointSetpoint | None = None
    refused_setpoints: int = 0  # that were of no use
    station_heard: bool = False  # a ground station's heartbeat


class Inbox:
    """Collects commands, targets and the safe set until a tick takes them.

    Bounded: what does not fit is dropped and counted, as a lost datagram would be.
    """

    def __init__(self, origin: Origin = DEFAULT_ORIGIN) -> None:
        """Begin empty; commands name places on Earth, from ``origin`` of the local frame on."""
        self._locate = partial(to_local, origin)
        self.refused = 0  # messages with numbers of no use, or too many of them
        self._received = Received()
        self._obstacles: dict[int, Zone] = {}
        self._obstacle_count = 0
        self._handlers: dict[int, Callable[[Frame], None]] = {
            message_ids.COMMAND_LONG: partial(self._command, decode.command_long),
            message_ids.COMMAND_INT: partial(self._command, decode.command_int),
            message_ids.SET_MODE: partial(self._command, decode.set_mode),
            message_ids.END_EFFECTOR_TARGET: self._target,
            message_ids.SET_POSITION_TARGET_LOCAL_NED: partial(self._setpoint, body_setpoint),
            message_ids.SET_ATTITUDE_TARGET: partial(self._setpoint, attitude_setpoint),
            message_ids.ARM_JOINT_SETPOINT: partial(self._setpoint, joint_setpoint),
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

    def accept(self, frame: Frame) -> None:
        """Keep what the frame says if it is for this vehicle and of use; never raises."""
        handler = self._handlers.get(frame.message_id)
        if handler is not None:
            handler(frame)

    def take(self) -> Received:
        """Hand over what came."""
        taken, self._received = self._received, Received()
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
        came = self.take()
        # By position: it is made in every tick.
        return TickInputs(
            sensors,
            plan,
            tuple(came.commands),
            tuple(came.targets),
            _begun(came.safe_set, sensors.t_us),
            came.motion,
            came.attitude,
            came.joints,
            came.refused_setpoints,
            came.station_heard,
            mission,
            tuning,
            stale_us,
        )

    def _command(self, read: Callable[[Frame], CommandRequest | None], frame: Frame) -> None:
        request = read(frame)
        if request is None:
            return
        if len(self._received.commands) >= _MAX_COMMANDS:
            self.refused += 1
            return
        self._received.commands.append(decode_commands.command(request, self._locate))

    def _target(self, frame: Frame) -> None:
        values = cast(Numbers, frame.payload_values)
        if values[0] == 0:  # not for a later time: for now
            self._setpoint(end_effector_setpoint, frame)
            return
        if not decode.for_this_vehicle(frame):
            return
        target = decode.end_effector_target(values)
        if target is None or len(self._received.targets) >= _MAX_TARGETS:
            self.refused += 1
            return
        self._received.targets.append(target)

    def _setpoint(self, read: Callable[[Numbers], Setpoint | None], frame: Frame) -> None:
        """Keep the newest of each kind; one for another vehicle is refused like a wrong one."""
        values = cast(Numbers, frame.payload_values)
        setpoint = read(values) if decode.for_this_vehicle(frame) else None
        received = self._received
        if setpoint is None:
            self.refused += 1
            received.refused_setpoints += 1
        elif isinstance(setpoint, JointSetpoint):
            received.joints = setpoint
        elif isinstance(setpoint, AttitudeSetpoint):
            received.attitude, received.motion = setpoint, None
        else:
            received.motion, received.attitude = setpoint, None

    def _heartbeat(self, frame: Frame) -> None:
        if frame.payload_values[1] == _GROUND_STATION:
            self._received.station_heard = True

    def _obstacle(
        self, read: Callable[[Numbers], decode.IndexedObstacle | None], frame: Frame
    ) -> None:
        if not decode.for_this_vehicle(frame):
            return
        indexed = read(cast(Numbers, frame.payload_values))
        if indexed is None:
            self.refused += 1
            return
        if indexed.count != self._obstacle_count:
            # Another count announces another set; those of two sets must not mix.
            self._obstacles.clear()
            self._obstacle_count = indexed.count
        self._obstacles[indexed.index] = indexed.zone
        if len(self._obstacles) == indexed.count:
            whole = tuple(self._obstacles[i] for i in range(indexed.count))
            self._received.safe_set = SafeSet(whole)
            self._obstacles.clear()

    def _sphere(self, frame: Frame) -> None:
        if not decode.for_this_vehicle(frame):
            return
        sphere = decode.workspace_sphere(cast(Numbers, frame.payload_values))
        if sphere is None:
            self.refused += 1
            return
        self._received.safe_set = SafeSet((sphere,))


def _begun(safe_set: SafeSet | None, now_us: int) -> SafeSet | None:
    """The safe set with zones that move, and did not say since when, where they are now."""
    if safe_set is None or all(zone.t_us or not any(zone.velocity) for zone in safe_set.zones):
        return safe_set
    return SafeSet(
        tuple(
            replace(zone, t_us=now_us) if any(zone.velocity) and not zone.t_us else zone
            for zone in safe_set.zones
        )
    )
