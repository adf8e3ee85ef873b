"""The link to PX4 as the vehicle: its estimate in, setpoints out.

A tick runs on every ATTITUDE_QUATERNION. While PX4 is silent ticks go on by our own clock without
readings, so that ground stations are told. Setpoints stream 50 times a second.

Stamps of setpoints and of the joints' readings are of the vehicle's time, which is PX4's.
"""

from __future__ import annotations

import math
import select
from collections.abc import Callable
from functools import partial
from typing import Final, cast

from fsw.autopilot.ports import Clock, VehicleFacts
from fsw.autopilot.signals import (
    VEHICLE_PILOT,
    Arm,
    Command,
    CommandAck,
    CommandRequest,
    CommandResult,
    Disarm,
    SensorFrame,
    Setpoint,
    Severity,
    StatusText,
    TickOutputs,
    frame_of_samples,
)
from fsw.link.endpoints import Endpoint, open_endpoint
from fsw.link.inbox import Inbox
from fsw.link.px4.arm import ArmLink, Joints, servo_ranges
from fsw.link.px4.estimate import ASK_US, Px4Clock, Px4Estimate
from fsw.link.px4.handover import LOST_US, Handover, Px4Seen
from fsw.link.px4.messages import (
    ACTUATORS,
    ARM_DISARM,
    ON_GROUND,
    SET_INTERVAL,
    SET_MODE,
    CompanionWriter,
    is_of_px4,
    mode_name,
    mode_of,
    shares_of,
    state_of,
)
from fsw.link.vehicle_link import Pacing
from fsw.link.wire.decode import Numbers
from messages import message_ids, status_text
from messages.addresses import Address, LinkAddress, LinkError, parse_link_address
from messages.frames import Frame, Losses

_STREAMS: Final = {  # asked for, with its period [us]
    message_ids.ATTITUDE_QUATERNION: 4_000,
    message_ids.ODOMETRY: 8_000,
    # Sent when it changes: HEARTBEAT tells of another mode up to a second later.
    message_ids.CURRENT_MODE: 20_000,
    message_ids.EXTENDED_SYS_STATE: 200_000,
    message_ids.BATTERY_STATUS: 1_000_000,
}
_STEADY: Final = (message_ids.ATTITUDE_QUATERNION, message_ids.ODOMETRY)
MIN_BYTES_PER_S: Final = 46_080  # of 460,800 baud: the streams take 42,000
PX4_PORT: Final = 14540  # to which PX4 sends what a companion hears, before it has heard one
STREAM_US: Final = 20_000  # of setpoints
_HEARTBEAT_US: Final = 1_000_000
_WHOLE_PIECE, _PIECES = 50, 5  # bytes of a STATUSTEXT, and pieces of a sentence
_PATIENCE_S: Final = 0.02
_SLOW: Final = 0.5  # of the rate asked for: less is asked for again
_SPOKEN: Final = {ARM_DISARM: "arming", SET_MODE: "its mode", SET_INTERVAL: "a stream"}


Px4Addresses = tuple[LinkAddress, LinkAddress | None]
"""Where PX4 is, and where the arm speaks; None: on no link of its own."""


def px4_addresses(px4: str, arm: str | None) -> Px4Addresses:
    """Read them; ``LinkError`` if one is none, or PX4's a line too slow for its estimate."""
    where = parse_link_address(px4)
    speed = None if isinstance(where, tuple) else where.bytes_per_s
    if speed is not None and speed < MIN_BYTES_PER_S:
        raise LinkError(
            f"{px4} takes {speed} bytes/s and PX4's estimate needs {MIN_BYTES_PER_S}; "
            "use 460800 baud or more"
        )
    return where, None if arm is None else parse_link_address(arm)


class Px4Link:
    """PX4 at the other end of one link, and the arm at that of another, or at PX4's."""

    def __init__(
        self,
        endpoint: Endpoint,
        peer: Address,
        inbox: Inbox,
        facts: VehicleFacts,
        clock: Clock,
        arm: Callable[[Joints], ArmLink] | None = None,
        *,
        servos: bool = False,
        wait: Callable[[Endpoint, float], bool] | None = None,
    ) -> None:
        """Take an open end towards PX4 at ``peer``; ``arm`` opens the arm's own link.

        Joints are PX4's ``servos``, beside encoders on that link; without the link they are anyway.

        Raises:
            LinkError: The arm has more joints than PX4 moves.
        """
        self.pacing: Pacing | None = None
        self.shutdown = False
        self.retransmissions = 0
        self.notices: list[StatusText] = []
        self.routed_acks: list[CommandAck] = []
        self._endpoint, self._peer, self._inbox = endpoint, peer, inbox
        self._clock, self._wait = clock, wait or _wait_for
        airframe = facts.airframe
        count = airframe.bodies.joints
        self.joints = Joints(tuple(airframe.home_posture[:count]))
        self._arm = None if arm is None else arm(self.joints)
        self._ranges = servo_ranges(airframe)
        self._servos = servos or self._arm is None
        if self._servos and count > ACTUATORS:
            raise LinkError(f"PX4 moves {ACTUATORS} servos and the arm has {count} joints")
        self._writer, self._losses = CompanionWriter(), Losses()
        self._estimate, self._px4_time = Px4Estimate(), Px4Clock()
        self._handover = Handover()
        self._heard_us = -1  # when PX4 was heard last, by our clock
        self._armed, self._mode, self._landed = False, (0, 0), True
        self._t_us = 0  # of the last frame that was handed on
        self._due_us = {"heartbeat": -1, "ask": -1, "stream": -1}
        self._counts = dict.fromkeys(_STREAMS, 0)  # since streams were looked at last
        self._commands = 0
        self._stay: Setpoint | None = None  # where PX4 is asked to be while no plan is followed
        self._handlers: dict[int, Callable[[Numbers], bool | None]] = {
            message_ids.ATTITUDE_QUATERNION: self._take_attitude,
            message_ids.ODOMETRY: self._take_odometry,
            message_ids.HEARTBEAT: self._take_heartbeat,
            message_ids.CURRENT_MODE: self._take_mode,
            message_ids.EXTENDED_SYS_STATE: self._take_landed,
            message_ids.BATTERY_STATUS: inbox.accept_battery,
            message_ids.TIMESYNC: self._take_time,
            message_ids.COMMAND_ACK: self._hear_answer,
        }
        self._pieces: list[Frame] = []  # of a sentence of PX4's that is not whole yet
        self._odd = ""  # the frame of velocities that was told of
        self._believed_us = 0

    def announce(self) -> None:
        """Say that a companion is there, and what it wants to hear."""
        self._send(self._writer.heartbeat())
        self._ask_for_streams()

    def wait_for_step(self) -> SensorFrame | None:
        """Wait for PX4's next attitude; without readings when it has been silent for a while."""
        frame = self.newest()
        if frame is None and self._wait(self._endpoint, _PATIENCE_S):
            frame = self.newest()
        if frame is not None or self._t_us == 0:
            return frame
        silent_us = self._clock() - self._heard_us
        # A shorter gap is a tick that comes late; in a longer one nothing is known of the attitude.
        if silent_us < LOST_US:
            return None
        t_us = self._t_us + round(1e6 * _PATIENCE_S)
        self._px4_time.passed(t_us)
        return self._handed_on(frame_of_samples(t_us, (), len(self.joints.q)))

    def newest(self) -> SensorFrame | None:
        """What PX4's newest attitude says, with all that came before it."""
        if self._arm is not None:
            self._arm.poll()
        new = False
        while (received := self._endpoint.receive_waiting()) is not None:
            data, peer = received
            for frame, _ in self._endpoint.cut(data, self._losses):
                if is_of_px4(frame):
                    self._peer = peer
                    new = self._read(frame) or new
        if not new or (self._estimate.age_us < 0 and self._t_us == 0):
            return None
        q, qd = self.joints.q, self.joints.qd
        if self._arm is not None and self._arm.silent:
            q = qd = (math.nan,) * len(q)
        frame_now = self._estimate.frame(self._px4_time.ahead_us, q, qd)
        return self._handed_on(frame_now) if frame_now.t_us > self._t_us else None

    def wait(self, wait_s: float) -> bool:
        """Wait until something has come."""
        return self._wait(self._endpoint, wait_s)

    def _handed_on(self, frame: SensorFrame) -> SensorFrame:
        self.pacing = Pacing.LOCKSTEP  # PX4's messages release ticks
        self._t_us = frame.t_us
        return frame

    def _read(self, frame: Frame) -> bool:
        """Take one message of PX4; whether it is a new attitude."""
        kind = frame.message_id
        if kind in self._counts:
            self._counts[kind] += 1
        if kind == message_ids.STATUSTEXT:
            self._hear(frame)
            return False
        handler = self._handlers.get(kind)
        return handler is not None and bool(handler(cast(Numbers, frame.payload_values)))

    def _take_attitude(self, values: Numbers) -> bool:
        if self._px4_time.take(1000 * int(values[0])):
            self._estimate.forget()
            self._tell(Severity.CRITICAL, "PX4 has started anew")
        self._heard_us = self._clock()
        return self._estimate.take_attitude(values)

    def _take_heartbeat(self, values: Numbers) -> None:
        found = state_of(values)
        if found is not None:
            self._armed, self._mode = found

    def _take_mode(self, values: Numbers) -> None:
        self._mode = mode_of(int(values[0]))

    def _take_landed(self, values: Numbers) -> None:
        self._landed = int(values[1]) <= ON_GROUND

    def _take_time(self, values: Numbers) -> None:
        answered_ns, sent_ns = int(values[0]), int(values[1])
        answer = self._px4_time.answer(answered_ns, sent_ns, self._clock(), self._writer)
        if answer:
            self._send(answer)

    def _take_odometry(self, values: Numbers) -> None:
        resets = self._estimate.resets
        if not self._estimate.take_odometry(values):
            odd = f"PX4's ODOMETRY is in frames {int(values[56])}/{int(values[57])}: not understood"
            if odd != self._odd:
                self._odd = odd
                self._tell(Severity.CRITICAL, odd)
        elif self._estimate.resets != resets:
            self._tell(Severity.WARNING, "PX4 has reset its estimate")

    def _hear(self, frame: Frame) -> None:
        _, raw, text_id, _ = cast("tuple[int, bytes, int, int]", frame.payload_values)
        self._pieces = [*self._pieces[-_PIECES:], frame]
        if text_id and len(raw.rstrip(b"\0")) == _WHOLE_PIECE:
            return  # the rest of it is to come
        pieces, self._pieces = self._pieces, []
        for severity, sentence in status_text.graded(pieces):
            if severity <= Severity.WARNING and sentence:
                grade = Severity.CRITICAL if severity <= Severity.CRITICAL else Severity.WARNING
                self._tell(grade, f"PX4: {sentence.strip()}")

    def _hear_answer(self, values: Numbers) -> None:
        command, result = int(values[0]), int(values[1])
        if command in _SPOKEN and result not in (CommandResult.ACCEPTED, CommandResult.IN_PROGRESS):
            self._tell(
                Severity.WARNING, f"PX4 refused a command about {_SPOKEN[command]}: result {result}"
            )

    def send_actuators(self, t_us: int, outputs: TickOutputs) -> None:
        """Hand the vehicle over or take it, and stream where it is to be."""
        silent_us = self._clock() - self._heard_us
        seen = Px4Seen(silent_us, self._armed, self._mode, self._landed)
        wish = self._handover.step(seen, t_us, flies=outputs.armed)
        self.notices += wish.texts
        if wish.arm:
            self._command_us(Arm(), 1.0)
        if wish.disarm:
            self._command_us(Disarm(force=True), 0.0)
        if wish.mode is not None:
            self._send(self._writer.mode(wish.mode))
        if self._is_due("stream", t_us, STREAM_US):
            self._stream(t_us, outputs, seen)
        if self._is_due("heartbeat", t_us, _HEARTBEAT_US):
            self._send(self._writer.heartbeat())
            news = self._endpoint.news()
            if news:
                self._tell(Severity.WARNING, f"PX4's link: {news}")
        if self._is_due("ask", t_us, ASK_US):
            self._send(self._writer.time_sync(0, 1000 * self._clock()))
            if any(self._counts[k] * _STREAMS[k] < _SLOW * ASK_US for k in _STEADY):
                self._ask_for_streams()
            self._counts = dict.fromkeys(_STREAMS, 0)

    def _stream(self, t_us: int, outputs: TickOutputs, seen: Px4Seen) -> None:
        wanted = outputs.setpoint if outputs.armed else None
        q = None
        if wanted is not None:
            self._stay, q = None, wanted.q_arm
        else:
            wanted = self._staying(seen)
        if wanted is not None and self._handover.streams:
            self._send(self._writer.target(t_us, wanted))
            if q is not None and self._servos:
                self._send(self._writer.joints(shares_of(self._ranges, q)))
        if self._arm is not None:
            self._arm.send(t_us, outputs, None if self._servos else q)
        elif q is not None:
            self.joints.sent(q, 1e-6 * (t_us - self._believed_us))
        self._believed_us = t_us

    def _staying(self, seen: Px4Seen) -> Setpoint | None:
        """Where the vehicle is, or was when PX4 began to follow: Offboard begins without a jump."""
        if seen.gives and self._stay is not None:
            return self._stay
        now = self._estimate.frame(0, (), ())
        if not math.isfinite(now.p_WB[0]):
            return None
        yaw = self._estimate.yaw
        still = (0.0, 0.0, 0.0)
        self._stay = Setpoint(now.p_WB, still, still, yaw, 0.0, ())
        return self._stay

    def _command_us(self, action: Arm | Disarm, number: float) -> None:
        self._commands = self._commands % 200 + 1  # so that none is taken for a repetition
        params = (number, float(self._commands), *(0.0,) * 5)
        self._inbox.accept_command(
            Command(action, CommandRequest(ARM_DISARM, params, *VEHICLE_PILOT))
        )

    def queue_texts(self, texts: tuple[StatusText, ...]) -> None:
        """PX4 is told nothing: its own ground station hears it, not us."""

    def queue_ack(self, ack: CommandAck) -> None:
        """Acknowledge a command of who speaks beside the arm."""
        if self._arm is not None:
            self._arm.acknowledge(ack)

    def route(self, request: CommandRequest) -> None:
        """A real vehicle lets nothing fail on command."""
        self.routed_acks.append(request.answer(CommandResult.UNSUPPORTED))

    def as_json(self) -> dict[str, object]:
        """What was found out about the link."""
        trip_us = self._px4_time.round_trip_us
        return {
            "round_trip_ms": None if trip_us is None else 1e-3 * trip_us,
            "mode": mode_name(self._mode),
            "armed": self._armed,
            "restarts": self._px4_time.restarts,
            "estimate_resets": self._estimate.resets,
            "lost_bytes": self._losses.bytes,
        }

    def close(self) -> None:
        """Close the links."""
        self._endpoint.close()
        if self._arm is not None:
            self._arm.close()

    def _ask_for_streams(self) -> None:
        for message_id, period_us in _STREAMS.items():
            self._send(self._writer.interval(message_id, period_us))

    def _is_due(self, what: str, t_us: int, period_us: int) -> bool:
        due_us = self._due_us[what]
        if t_us < due_us <= t_us + period_us:
            return False
        # On a grid, unless time has jumped.
        self._due_us[what] = due_us + period_us if t_us - due_us < period_us else t_us + period_us
        return True

    def _send(self, datagram: bytes) -> None:
        self._endpoint.send(datagram, self._peer)

    def _tell(self, severity: Severity, text: str) -> None:
        self.notices.append(StatusText(severity, text, prompt=True))


def _wait_for(endpoint: Endpoint, wait_s: float) -> bool:
    """Wait until something has come, or looks so."""
    ready = select.select((endpoint.fileno(),), (), (), wait_s)[0]
    return bool(ready)


def open_px4(
    where: Px4Addresses, inbox: Inbox, facts: VehicleFacts, clock: Clock, *, servos: bool = False
) -> Px4Link:
    """Open the links; joints are PX4's ``servos``, without a link of the arm they are anyway.

    Raises:
        LinkError: One cannot be opened, or is too slow.
    """
    px4, arm = where
    endpoint, peer = open_endpoint(px4, clock, PX4_PORT)
    opened = None if arm is None else partial(ArmLink, arm, inbox=inbox, clock=clock)
    return Px4Link(endpoint, peer, inbox, facts, clock, opened, servos=servos)
