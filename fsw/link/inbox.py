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


@dataclass(frozen=True, slots=True)
class Setpoints:
    """The newest offboard setpoints; at most one of motion and attitude."""

    motion: MotionSetpoint | None = None
    attitude: AttitudeSetpoint | None = None
    joints: JointSetpoint | None = None
    refused: int = 0  # that were of no use


NO_SETPOINTS: Final = Setpoints()


class Inbox:
    """Collects commands, targets and the safe set until a tick takes them.

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
        self._safe_set: SafeSet | None = None
        self._obstacles: dict[int, Zone] = {}
        self._obstacle_count = 0
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
            message_ids.OBSTACLE_SHAPE: partial(self._obstacle, 21, decode.obstacle_shape),
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

    def take_safe_set(self, now_us: int = 0) -> SafeSet | None:
        """Hand over the safe set if a new one is complete.

        A zone that moves and did not say since when is where it is now, ``now_us``.
        """
        if self._safe_set is None:
            return None
        taken, self._safe_set = self._safe_set, None
        if any(zone.t_us == 0 and any(zone.velocity) for zone in taken.zones):
            return SafeSet(tuple(_begun(zone, now_us) for zone in taken.zones))
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
            self.take_safe_set(sensors.t_us),
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
        if indexed.count != self._obstacle_count:
            # Another count announces another set; those of two sets must not mix.
            self._obstacles.clear()
            self._obstacle_count = indexed.count
        self._obstacles[indexed.index] = indexed.zone
        if len(self._obstacles) == indexed.count:
            self._safe_set = SafeSet(tuple(self._obstacles[i] for i in range(indexed.count)))
            self._obstacles.clear()

    def _sphere(self, frame: Frame) -> None:
        values = cast(Numbers, frame.payload_values)
        if not decode.for_this_vehicle(values[4], values[5]):
            return
        sphere = decode.workspace_sphere(values)
        if sphere is None:
            self.refused += 1
            return
        self._safe_set = SafeSet((sphere,))


def _begun(zone: Zone, now_us: int) -> Zone:
    if zone.t_us or not any(zone.velocity):
        return zone
    return replace(zone, t_us=now_us)
