"""The link to the simulator: one datagram in, one datagram out, per step.

Only texts that have no room in the answer go ahead of it, in datagrams of their own.

The simulator sends everything that belongs to step t_k with HIL_SENSOR last, as the barrier: either
the true state, or what sensors have measured; its HEARTBEAT says which. The answer ends with
exactly one HIL_ACTUATOR_CONTROLS of the same time stamp. In lockstep the simulator repeats a step
whose answer got lost: the same answer is sent again and no tick runs.

Stamps on the wire are of the sensors' clock, all others of the vehicle's time: see
``sensor_clock.py``.
"""

from __future__ import annotations

from collections import deque
from typing import Final, cast

from fsw.autopilot.measurements import Sample
from fsw.autopilot.ports import Clock, VehicleFacts
from fsw.autopilot.signals import (
    CommandAck,
    CommandRequest,
    MessageSource,
    Mode,
    SensorFrame,
    Severity,
    StatusText,
    TickOutputs,
    frame_of_samples,
)
from fsw.frozen import replace
from fsw.link.inbox import MAX_SAMPLES, Inbox
from fsw.link.outbox import packed
from fsw.link.routed_commands import RoutedCommands
from fsw.link.sensor_clock import SensorClock
from fsw.link.vehicle_link import Pacing
from fsw.link.wire import decode
from fsw.link.wire.decode import Numbers
from fsw.link.wire.decode_sensors import SampleDecoder
from fsw.link.wire.encode_standard import command_ack, hil_actuator_controls, vehicle_heartbeat
from fsw.link.wire.outgoing import PX4
from messages import dialect, message_ids, status_text
from messages.addresses import Address
from messages.frames import Frame, FrameWriter, split
from messages.message_ids import ACCEPTED, AUTOPILOT, CMD_REBOOT_SHUTDOWN, SYSTEM_ID
from messages.udp import PeerSocket

PATIENCE_S: Final = 0.2  # one wait for a datagram; also the interval of announcements

_ANSWERS: Final = 32  # steps with answers that are remembered: more than can be late or repeated
_POWER_OFF: Final = 2.0  # its second parameter here: shut the autopilot down
_REPORT_US: Final = 1_000_000  # the mode is reported when it changes, and this often
_SENSOR_AT: Final = 15  # place of HIL_SENSOR's id; the step's clock has 0
_LOCKSTEP_BIT, _MEASURED_BIT = 1, 2  # of the custom_mode in the simulator's HEARTBEAT
_NO_ANSWER: Final = "the simulator does not answer: a fault may have begun or ended, or not"


class SimLink:
    """Sensors in, actuators out, over one UDP connection."""

    def __init__(self, simulator: Address, inbox: Inbox, facts: VehicleFacts, clock: Clock) -> None:
        self.pacing: Pacing | None = None  # known with the first step in lockstep
        self.measured = False  # what comes is measured by sensors, each at its own time
        self.shutdown = False  # the simulator has ended the run
        self.retransmissions = 0
        self.notices: list[StatusText] = []  # for the operator; the loop empties it
        self.routed_acks: list[CommandAck] = []  # of the simulator to what was routed; the same
        self._endpoint = PeerSocket.connected(simulator, PATIENCE_S)
        self._inbox = inbox
        others = {message_ids.BATTERY_STATUS}
        self._for_inbox = inbox.message_ids - {message_ids.HEARTBEAT} | others
        self._airframe = facts.airframe
        self._joints = self._airframe.bodies.joints
        self._decoder = SampleDecoder(inbox.locate, self._joints)
        self._writer = FrameWriter(SYSTEM_ID, AUTOPILOT)
        self._steps = SensorClock(
            facts.tick_period_us, clock, self._note_what_is_odd, inbox.accept_clock_jump
        )
        self._answered_in = deque[tuple[int, int]](maxlen=_ANSWERS)  # stamps and numbers of steps
        self._early: list[Sample] = []  # of the next step, which had no room for them
        self._answer: tuple[int, list[bytes]] = (-1, [])  # with the stamp of its step
        self._acks: list[CommandAck] = []
        self._texts: tuple[StatusText, ...] = ()  # of the last tick, after its answer
        self._routed = RoutedCommands()
        self._text_id = 0
        self._reported_us = -_REPORT_US
        self._reported_mode: Mode | None = None

    def announce(self) -> None:
        """Send a heartbeat, until the simulator sends steps."""
        values = (0, self._airframe.mav_type, PX4, 0, dialect.MAV_STATE_STANDBY, 3)
        self._endpoint.send(self._writer.frame(message_ids.HEARTBEAT, *values))

    def wait_for_step(self) -> SensorFrame | None:
        """Wait for the sensors of the next new step; what else came with it is in the inbox.

        None when nothing new came within the patience, or when the run is over.
        """
        datagram = self._endpoint.receive()
        if datagram is None:
            self._steps.silences += 1
            return None
        step = self._read(datagram)
        if step is None and self.pacing is not Pacing.LOCKSTEP:
            self._steps.looks += 1  # in lockstep no other step comes before the answer
        return step

    def newest(self) -> SensorFrame | None:
        """The newest of the steps that are there; what came with all of them is in the inbox."""
        newest = None
        datagram = self._endpoint.receive_waiting()
        while datagram is not None:
            newest = self._read(datagram) or newest
            datagram = self._endpoint.receive_waiting() if self._endpoint.has_waiting() else None
        self._steps.looks += 1
        if newest is not None:
            self._steps.note_time()
        return newest

    def wait(self, wait_s: float) -> bool:
        """Wait until a datagram is there; False when the time is over."""
        return self._endpoint.wait(wait_s)

    def queue_ack(self, ack: CommandAck) -> None:
        """Send an acknowledgement with the next answer."""
        self._acks.append(ack)

    def route(self, request: CommandRequest) -> None:
        """Send a command on with the next answer, and again until it is answered."""
        self._routed.add(request)

    def queue_texts(self, texts: tuple[StatusText, ...]) -> None:
        """Send texts with the next answer."""
        self._texts += texts

    def send_actuators(self, t_us: int, outputs: TickOutputs) -> None:
        """Send the actuator command that belongs to the step of ``t_us``."""
        stamp_us = t_us + self._steps.ahead_us
        controls = self._controls(stamp_us, outputs)
        due = t_us - self._reported_us >= _REPORT_US
        changed = due or outputs.mode is not self._reported_mode
        texts = (*self._texts, *outputs.texts) if self._texts else outputs.texts
        routed = self._due(t_us) if self._routed else b""
        if self._acks or texts or changed or routed:
            mode = self._mode(t_us, outputs)
            # Last, in the datagram of the controls: texts without room in it are of no use there.
            self._send((stamp_us, packed([mode, *self._replies(texts), routed + controls])))
        else:
            self._send((stamp_us, [controls]))

    def _due(self, t_us: int) -> bytes:
        """Commands to send on now; what was not answered for long is answered here."""
        for ack in self._routed.given_up(t_us):
            self.routed_acks.append(ack)
            self.notices.append(StatusText(Severity.CRITICAL, _NO_ANSWER, prompt=True))
        return self._routed.due(t_us)

    def close(self) -> None:
        """Close the socket."""
        self._endpoint.close()

    def _read(self, datagram: bytes) -> SensorFrame | None:
        """Decode one datagram; None unless it carries a whole new step."""
        frames = split(datagram)
        found = {frame.message_id: frame for frame in frames}  # of each kind the last one
        if message_ids.HEARTBEAT in found:
            custom_mode = cast(int, found[message_ids.HEARTBEAT].payload_values[0])
            self.pacing = Pacing(custom_mode & _LOCKSTEP_BIT)
            self.measured = bool(custom_mode & _MEASURED_BIT)
        barrier = found.get(message_ids.HIL_SENSOR)
        if barrier is None or barrier.payload_values[_SENSOR_AT] != 0:
            self._read_between_steps(frames)
            return None
        if self.measured:
            samples = self._decoder.samples(frames)
            sensors = self._new_measured(barrier, samples)
        else:
            odometry = found.get(message_ids.ODOMETRY)
            sensors = self._new(barrier, odometry, found.get(message_ids.ARM_JOINT_STATE))
        if message_ids.COMMAND_ACK in found:
            self._note_answers((_stamp(barrier), barrier.sequence), frames)
        if sensors is None or self._for_inbox.isdisjoint(found):
            return sensors
        for frame in frames:
            if frame.message_id == message_ids.BATTERY_STATUS:
                self._inbox.accept_battery(cast(Numbers, frame.payload_values))
            elif frame.message_id in self._for_inbox:
                self._inbox.accept(frame, _source(frame))
        return sensors

    def _note_answers(self, step: tuple[int, int], frames: list[Frame]) -> None:
        """What the simulator says about commands that were routed to it, once for each ``step``.

        A datagram that another has overtaken brings an answer all the same.
        """
        if step in self._answered_in:
            return
        self._answered_in.append(step)
        acks = []
        for frame in frames:
            if frame.message_id == message_ids.COMMAND_ACK:
                command, result, _, _, system, component = cast(Numbers, frame.payload_values)
                acks.append(CommandAck(int(command), int(result), int(system), int(component)))
        awaited = self._routed.answered(acks)
        if not awaited:
            return  # it was asked again meanwhile, and both are answered
        self.routed_acks += awaited
        for severity, sentence in status_text.graded(frames):
            # No worse than a refusal: an emergency passes every limit, and is the vehicle's own.
            grade = Severity.CRITICAL if severity <= Severity.CRITICAL else Severity.WARNING
            self.notices.append(StatusText(grade, sentence, prompt=True))

    def _note_what_is_odd(self, sentence: str) -> None:
        self.notices.append(StatusText(Severity.WARNING, sentence))

    def _new(self, barrier: Frame, odometry: Frame | None, arm: Frame | None) -> SensorFrame | None:
        """The sensors of a step that is whole and not known yet; a known one is answered again."""
        if odometry is None or arm is None or not self._is_next(barrier):
            return None
        frame = decode.sensor_frame(odometry, arm, barrier, self._joints)
        ahead_us = self._steps.ahead_us
        return frame if not ahead_us else replace(frame, t_us=frame.t_us - ahead_us)

    def _new_measured(self, barrier: Frame, samples: list[Sample]) -> SensorFrame | None:
        """The time of a new step, whose samples are in the inbox; a known one is answered again."""
        if not self._is_next(barrier):
            return None
        t_us = _stamp(barrier)
        if self._early or self._steps.ahead_us:
            samples = self._steps.in_vehicle_time([*self._early, *samples])
            self._early.clear()
            t_us -= self._steps.ahead_us
        self._inbox.accept_samples(samples)
        return frame_of_samples(t_us, samples, self._joints)

    def _is_next(self, barrier: Frame) -> bool:
        """Whether a step is a new one, which it is only once; a known one is answered again."""
        t_us = _stamp(barrier)
        if self._steps.follows(t_us, barrier.sequence):
            return True
        if t_us == self._answer[0]:
            self.retransmissions += 1
            self._send(self._answer)
        return False

    def _send(self, answer: tuple[int, list[bytes]]) -> None:
        self._answer = answer
        for datagram in answer[1]:
            self._endpoint.send(datagram)

    def _read_between_steps(self, frames: list[Frame]) -> None:
        """What ends the run, and measurements for which the next step has no room."""
        if self.measured:
            self._early += self._decoder.samples(frames)
            del self._early[:-MAX_SAMPLES]
        for frame in frames:
            if frame.message_id == message_ids.COMMAND_LONG and decode.for_this_vehicle(frame):
                request = decode.command_long(frame)
                if request.command == CMD_REBOOT_SHUTDOWN and request.params[1] == _POWER_OFF:
                    self.shutdown = True
                    self._endpoint.send(self._ack_frame(request.answer(ACCEPTED)))

    def _replies(self, texts: tuple[StatusText, ...]) -> list[bytes]:
        frames = [self._ack_frame(ack) for ack in self._acks]
        self._acks.clear()
        self._texts = ()
        for text in texts:
            self._text_id = self._text_id % 0xFFFF + 1
            for values in status_text.pieces(text.text, text.severity, self._text_id):
                frames.append(self._writer.frame(message_ids.STATUSTEXT, *values))
        return frames

    def _controls(self, stamp_us: int, outputs: TickOutputs) -> bytes:
        """HIL_ACTUATOR_CONTROLS of a step."""
        values = hil_actuator_controls(self._airframe, stamp_us, outputs)
        return self._writer.frame(message_ids.HIL_ACTUATOR_CONTROLS, *values)

    def _mode(self, t_us: int, outputs: TickOutputs) -> bytes:
        """HEARTBEAT: the simulator sees whether its trajectory is being flown."""
        self._reported_us, self._reported_mode = t_us, outputs.mode
        values = vehicle_heartbeat(outputs.mode, self._airframe.mav_type, armed=outputs.armed)
        return self._writer.frame(message_ids.HEARTBEAT, *values)

    def _ack_frame(self, ack: CommandAck) -> bytes:
        return self._writer.frame(message_ids.COMMAND_ACK, *command_ack(ack))


def _stamp(barrier: Frame) -> int:
    """By the sensors' clock [us]."""
    return cast(int, barrier.payload_values[0])


def _source(frame: Frame) -> MessageSource:
    """The simulator is the only peer of its link, whichever port it has."""
    return MessageSource(frame.system_id, frame.component_id, "simulator")
