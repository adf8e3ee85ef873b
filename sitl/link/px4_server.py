"""The plant as a simulator of PX4: TCP, in lockstep with what PX4 answers.

PX4 connects and leaves the first steps unanswered while it starts. Until its first answer steps go
on by themselves, in real time; from then on each is waited for.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from typing import Final

from command_line.process import StopRequest
from messages.byte_stream import ByteStream
from messages.frames import Losses
from messages.stream_reader import StreamReader
from sitl.faults.keys import Fault
from sitl.link.exchange import ExchangeCounts, SimulatorError
from sitl.link.px4_messages import Px4Answer, Px4Encoder, read_answer
from sitl.link.server import PROGRESS_S, PROGRESS_STEPS, Progress, RunTiming, end_if_over
from sitl.result import EndKind
from sitl.sensors.channel import Measurement
from sitl.servos import PositionServos
from sitl.simulation import STEP_US, Controls, Simulation
from sitl.start import effects
from vehicles.description import Vehicle

STALL_S: Final = 5.0  # PX4's scripts and logger take their time
_SLICE_S: Final = 0.1  # after which a request to stop is seen
_READ: Final = 4096


Beside = Callable[[Simulation, list[Measurement]], None]


class Px4Exchange:
    """Steps with PX4 at the other end of a stream."""

    def __init__(
        self,
        stream: ByteStream,
        vehicle: Vehicle,
        period_s: float,
        stop: StopRequest,
        answers: Callable[[int], None] = lambda number: None,
    ) -> None:
        """A step takes ``period_s`` of simulated time; ``answers`` is told the first answered."""
        self.counts = ExchangeCounts()
        self.answered_from: int | None = None  # step of the first answer
        self._stream = stream
        self._reader = StreamReader()
        self._losses = Losses()
        self._vehicle = vehicle
        self._period_s = period_s
        self._stop = stop
        self._answers = answers

    def step(
        self, number: int, t_us: int, message: bytes, meanwhile: Callable[[], None]
    ) -> Px4Answer | None:
        """Send a step, from 0, stamped ``t_us``; the answer, None while PX4 starts.

        ``meanwhile`` is work that can be done while PX4 thinks; it is called once.

        Raises:
            SimulatorError: PX4 has gone, or been silent for too long.
        """
        begin_s = time.perf_counter()
        self._stream.send(message)
        meanwhile()
        if self.answered_from is None:
            answer = self._first_answer(number, begin_s + self._period_s)
            self.counts.missed += answer is None
            return answer
        until_s = time.perf_counter() + STALL_S
        while True:
            for answer in self._waiting(number, until_s):
                if answer.t_us == t_us:
                    self.counts.waited_s += time.perf_counter() - begin_s
                    return answer
            if time.perf_counter() >= until_s:
                hint = "; 500 Hz needs the parameters of pandion px4 params"
                raise SimulatorError(
                    f"PX4 did not answer step {number} within {STALL_S:g} s"
                    + hint * (self._period_s < 0.003)
                )

    def _first_answer(self, number: int, until_s: float) -> Px4Answer | None:
        """Any answer that comes before the step is over, in real time."""
        while time.perf_counter() < until_s:
            answers = self._waiting(number, until_s)
            if answers:
                self.answered_from = number
                self._answers(number)
                return answers[-1]
        return None

    def _waiting(self, number: int, until_s: float) -> list[Px4Answer]:
        """Answers that are there or come within a moment."""
        data = self._stream.read(_READ)
        if not data:
            if not self._stream.connected:
                raise SimulatorError(f"PX4 closed the connection at step {number}")
            if self._stop.requested:
                raise SimulatorError(f"interrupted at step {number}")
            left_s = min(until_s - time.perf_counter(), _SLICE_S)
            if left_s > 0.0:
                select.select((self._stream,), (), (), left_s)
            return []
        frames = self._reader.cut(data, self._losses)
        answers = (read_answer(frame, self._vehicle) for frame, _ in frames)
        return [answer for answer in answers if answer is not None]


def wait_for_px4(stream: ByteStream, wait_s: float, stop: StopRequest) -> bool:
    """Wait until PX4 has connected; False if it has not in time."""
    until_s = time.perf_counter() + wait_s
    while not stop.requested and (left_s := until_s - time.perf_counter()) > 0.0:
        select.select((stream,), (), (), min(left_s, _SLICE_S))
        stream.look()
        if stream.connected:
            stream.stop_listening()
            return True
    return False


def serve_px4(
    simulation: Simulation,
    exchange: Px4Exchange,
    encoder: Px4Encoder,
    stop: StopRequest,
    progress: Progress,
    truth: Callable[[Simulation], None],
    begun: Callable[[Fault], None],
    *,
    every: int,
    pace_s: float | None,
    beside: Beside = lambda _simulation, _measured: None,
) -> RunTiming:
    """Step until the simulation, a signal or PX4 ends the run; PX4 is asked every so many steps.

    Whoever is ``beside`` PX4 is given what has been measured since the last exchange.

    Exchanges begin ``pace_s`` [s] of wall time apart, or as soon as possible. The reason for the
    end is in ``simulation.ended``.
    """
    step_s = 1e-6 * STEP_US
    vehicle, angles = simulation.vehicle, simulation.healthy().q_arm
    servos = PositionServos(vehicle, effects(simulation.scenario), angles, step_s)
    off = Controls.off(vehicle)
    answer = Px4Answer(0, off.thrust, off.torque, off.armed)
    arrived: list[Measurement] = []
    begin_s = reported_s = time.perf_counter()

    def meanwhile() -> None:
        truth(simulation)
        simulation.catch_up()

    while simulation.ended is None:
        for fault in simulation.faults.take_begun() if simulation.faults.active else ():
            begun(fault)
        arrived += simulation.measurements() or ()
        try:
            if simulation.step % every == 0:
                number, message = simulation.step // every, b""
                if pace_s is not None:
                    time.sleep(max(begin_s + number * pace_s - time.perf_counter(), 0.0))
                message = encoder.step(simulation.sensor_time_us, arrived)
                beside(simulation, arrived)
                arrived.clear()
                stamp_us = simulation.sensor_time_us
                answer = exchange.step(number, stamp_us, message, meanwhile) or answer
                if exchange.answered_from == number:  # PX4 may take its time until then
                    begin_s = time.perf_counter() - simulation.time_s
            else:
                meanwhile()
            readings = simulation.healthy()
            torques = servos.torques(
                answer.joints, readings.q_arm, readings.qd_arm, powered=answer.armed
            )
            simulation.advance(Controls(answer.thrust, torques, answer.armed))
        except SimulatorError as error:
            end_if_over(simulation, stop)
            simulation.end(EndKind.STOPPED, str(error))
            break
        end_if_over(simulation, stop)
        if simulation.step % PROGRESS_STEPS == 0:
            now_s = time.perf_counter()
            if now_s - reported_s >= PROGRESS_S:
                reported_s = now_s
                speed = simulation.time_s / max(now_s - begin_s, 1e-9)
                progress(simulation.time_s, simulation.min_margin_m, speed)
    wall_s = max(time.perf_counter() - begin_s, 1e-9)
    return RunTiming(simulation.step, wall_s, simulation.time_s / wall_s)
