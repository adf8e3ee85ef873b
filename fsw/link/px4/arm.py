"""The arm beside PX4: on a link of its own, or as servos of PX4 that say nothing.

On its own link an arm sends ARM_JOINT_STATE or JOINT_ENCODERS, and is sent ARM_JOINT_SETPOINT. What
else comes there is for the inbox: the programs that know the trajectory and the safe set may speak
there too. Without that link joints are PX4's servos, moved by DO_SET_ACTUATOR, and are believed
where they were sent.
"""

from __future__ import annotations

import math
from typing import Final, cast

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.ports import Clock
from fsw.autopilot.signals import CommandAck, JointVector, MessageSource, Mode, TickOutputs
from fsw.link.endpoints import open_endpoint
from fsw.link.inbox import Inbox
from fsw.link.wire.decode import Numbers
from fsw.link.wire.encode_standard import command_ack, vehicle_heartbeat
from messages import dialect, message_ids
from messages.addresses import LinkAddress
from messages.frames import FrameWriter, Losses
from messages.joint_arrays import ENCODERS_AT, STATE_AT, base, joined, more
from messages.message_ids import PANDION, SYSTEM_ID

SILENT_US: Final = 100_000  # an arm that says nothing for so long is not there
_BANDWIDTH: Final = 60.0  # rad/s, of rates that are found from angles
_SERVO: Final = 15.0  # rad/s, with which a servo that says nothing is believed to follow
_REPORT_US: Final = 200_000


class Joints:
    """Angles and rates of the joints, as far as they are known."""

    def __init__(self, rest: JointVector) -> None:
        self.q = rest
        self.qd: JointVector = (0.0,) * len(rest)
        self._stamp_us = -1

    def measured(self, stamp_us: int, q: JointVector, qd: JointVector | None) -> None:
        """Believe angles [rad] of a time; rates [rad/s] that are not measured are found."""
        dt = 1e-6 * (stamp_us - self._stamp_us)
        if qd is None and 0.0 < dt < 0.2 and self._stamp_us >= 0:
            share = min(_BANDWIDTH * dt, 1.0)
            qd = tuple(
                [r + share * ((a - b) / dt - r) for a, b, r in zip(q, self.q, self.qd, strict=True)]
            )
        self.q, self._stamp_us = q, stamp_us
        self.qd = (0.0,) * len(q) if qd is None else qd

    def sent(self, q: JointVector, seconds: float) -> None:
        """Believe that servos go to angles [rad] for ``seconds`` [s]."""
        self.qd = tuple([_SERVO * (a - b) for a, b in zip(q, self.q, strict=True)])
        self.q = tuple(
            [b + min(seconds, 1.0 / _SERVO) * r for b, r in zip(self.q, self.qd, strict=True)]
        )


class ArmLink:
    """The link of an arm, and of who stands beside it."""

    def __init__(self, address: LinkAddress, joints: Joints, inbox: Inbox, clock: Clock) -> None:
        """Begin to look for who is at ``address``, or to listen there, else LinkError.

        The clock is wall time.
        """
        local_port = address[1] if isinstance(address, tuple) else 0
        self._endpoint, self._peer = open_endpoint(address, clock, local_port)
        self._joints, self._inbox, self._clock = joints, inbox, clock
        self._writer = FrameWriter(SYSTEM_ID, PANDION)
        self._losses = Losses()
        self._heard_us = -1
        self._reported_us = 0
        self._mode: Mode | None = None
        self._known = False  # who is there

    @property
    def silent(self) -> bool:
        """Whether the arm has said nothing for long."""
        return self._heard_us < 0 or self._clock() - self._heard_us > SILENT_US

    def poll(self) -> None:
        """Read what is there."""
        while (received := self._endpoint.receive_waiting()) is not None:
            data, peer = received
            for frame, _ in self._endpoint.cut(data, self._losses):
                self._peer, self._known = peer, True
                values = cast(Numbers, frame.payload_values)
                count = len(self._joints.q)
                if frame.message_id == message_ids.ARM_JOINT_STATE:
                    position, velocity, _ = STATE_AT
                    q, qd = joined(values, *position, count), joined(values, *velocity, count)
                    self._heard(int(values[0]), q, qd)
                elif frame.message_id == message_ids.JOINT_ENCODERS:
                    self._heard(int(values[0]), joined(values, *ENCODERS_AT, count), None)
                else:
                    source = MessageSource(frame.system_id, frame.component_id, "arm")
                    self._inbox.accept(frame, source)

    def send(self, t_us: int, outputs: TickOutputs, q: JointVector | None) -> None:
        """Send where joints are to be [rad] at ``t_us`` [us], and which mode is flown."""
        if not self._known:
            return
        if q is not None:
            rest = (0.0,) * len(q)
            arrays = (*base(q), *base(rest), *base(rest), SYSTEM_ID, 0, len(q))
            values = (t_us, *arrays, *more(q), *more(rest), *more(rest))
            self._send(message_ids.ARM_JOINT_SETPOINT, *values)
        if outputs.mode is not self._mode or t_us - self._reported_us >= _REPORT_US:
            self._mode, self._reported_us = outputs.mode, t_us
            kind = dialect.MAV_TYPE_GENERIC
            beat = vehicle_heartbeat(outputs.mode, kind, armed=outputs.armed)
            self._send(message_ids.HEARTBEAT, *beat)

    def acknowledge(self, ack: CommandAck) -> None:
        """Answer a command that came here."""
        if self._known:
            self._send(message_ids.COMMAND_ACK, *command_ack(ack))

    def close(self) -> None:
        """Close the socket."""
        self._endpoint.close()

    def _heard(self, stamp_us: int, q: JointVector, qd: JointVector | None) -> None:
        self._heard_us = self._clock()
        self._joints.measured(stamp_us, q, qd)

    def _send(self, message_id: int, *values: float | bytes) -> None:
        self._endpoint.send(self._writer.frame(message_id, *values), self._peer)


def servo_ranges(airframe: Airframe) -> tuple[tuple[float, float], ...]:
    """Least and most angle [rad] of each joint with the others at zero; half around without one."""
    ranges = []
    for k in range(airframe.bodies.joints):
        least, most = -math.pi, math.pi
        for limit in airframe.angle_limits:
            share = limit.row[k]
            if share != 0.0:
                ends = sorted((limit.low / share, limit.high / share))
                least, most = max(least, ends[0]), min(most, ends[1])
        ranges.append((least, most))
    return tuple(ranges)
