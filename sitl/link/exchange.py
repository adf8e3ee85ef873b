"""One step with the vehicle: sensors out, actuators in. In lockstep or in real time."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from command_line.process import StopRequest
from sitl.link import decode
from sitl.link.decode import VehicleReply
from sitl.link.endpoints import RESEND_S
from sitl.link.faulty_endpoint import Endpoint
from sitl.link.step_grid import StepGrid
from sitl.simulation import Controls
from vehicles.description import Vehicle

STALL_S: Final = 1.2  # so that 2 s after a stall both processes have ended; a pause of 1 s passes
SILENT_S: Final = 0.1  # from then on a vehicle that ends so counts as silent
# Real time: older controls are not held, the rotors stop. PX4 waits as long for the setpoints of a
# computer (COM_OF_LOSS_T). Until then see ``sitl.stand_in``.
HOLD_S: Final = 1.0
_FIRST_PLAN_S: Final = 0.05  # between the first answer and the start of the clock


class SimulatorError(Exception):
    """A run that cannot go on, in one sentence that names the step."""


@dataclass(slots=True)
class ExchangeCounts:
    """What happened on the link."""

    resent: int = 0  # lockstep: steps that were sent again
    missed: int = 0  # real time: steps whose answer was not there at the end of the step
    pauses: int = 0  # real time: how often the simulator was suspended and moved its grid
    paused_s: float = 0.0  # real time: by how much in all
    waited_s: float = 0.0  # lockstep: for answers, sending included, the first step's left out


class Lockstep:
    """Waits for the answer of every step, and repeats a step whose answer does not come."""

    def __init__(
        self, endpoint: Endpoint, vehicle: Vehicle, period_s: float | None, stop: StopRequest
    ) -> None:
        """Steps begin ``period_s`` of wall time apart, or as soon as possible.

        The endpoint's patience is the interval of repetition; ``stop`` ends a wait for a vehicle
        that was interrupted as well.
        """
        self.counts = ExchangeCounts()
        self._stop = stop
        self._endpoint = endpoint
        self._vehicle = vehicle
        self._period_s = period_s
        self._start_s = time.perf_counter()
        self._number = 0
        self._listened_s = 0.0  # in vain, for the answer to this step

    held_s: float | None = None  # controls are waited for, and never held

    @property
    def silent_since(self) -> int | None:
        """Step of the last answer, if the vehicle has been silent for 0.1 s; None if not."""
        return self._number - 1 if self._number and self._listened_s >= SILENT_S else None

    def send_ahead(self, datagram: bytes) -> None:
        """Send what belongs to the next step and has no room in its datagram."""
        self._endpoint.send(datagram)

    def step(
        self, number: int, t_us: int, datagram: bytes, meanwhile: Callable[[], None]
    ) -> VehicleReply:
        """Send the datagram of a step, from 0, stamped ``t_us``; returns what to apply during it.

        ``meanwhile`` is work that can be done while the vehicle thinks; it is called once.

        Raises:
            SimulatorError: The vehicle has been silent for too long.
        """
        if self._period_s is not None:
            due_s = self._start_s + number * self._period_s
            time.sleep(max(due_s - time.perf_counter(), 0.0))
        begin_s = sent_s = time.perf_counter()
        self._endpoint.send(datagram)
        meanwhile()
        self._number, self._listened_s = number, 0.0
        looked_s = time.perf_counter()
        while True:
            received = self._endpoint.receive()
            if received is not None:
                if number:
                    self.counts.waited_s += time.perf_counter() - begin_s
                answer = decode.read_reply(received, self._vehicle)
                if answer is not None and answer.t_us == t_us:
                    return answer
            # Ctrl-C goes to the vehicle too: that it is silent from then on is not held against it.
            if self._stop.requested:
                raise SimulatorError(f"interrupted at step {number}")
            now_s = time.perf_counter()
            # More than its patience a receive takes only if this process itself was suspended.
            self._listened_s += min(now_s - looked_s, RESEND_S)
            looked_s = now_s
            if self._listened_s >= STALL_S:
                raise SimulatorError(
                    f"the flight software did not answer step {number} within {STALL_S:g} s"
                )
            # A peer that is gone ends the wait early; repeating at once would only spin.
            if received is None and now_s - sent_s >= 0.9 * RESEND_S:
                self.counts.resent += 1
                sent_s = now_s
                self._endpoint.send(datagram)


class RealTime:
    """Never waits for the vehicle: what has arrived when the step is over is what was applied.

    With the answer in time this is what lockstep applies; without it the last controls are held,
    and the step is counted as missed. Only the first step is waited for: the clock starts when the
    vehicle has answered it and had a moment to make its first plan.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        vehicle: Vehicle,
        period_s: float,
        stop: StopRequest,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """A step takes ``period_s`` of the clock; ``stop`` ends the wait for the first answer."""
        self._first = Lockstep(endpoint, vehicle, None, stop)
        self.counts = ExchangeCounts()
        self._endpoint = endpoint
        self._vehicle = vehicle
        self._period_s = period_s
        self._clock = clock
        self._grid = StepGrid(period_s, clock, sleep)
        self._held = Controls.off(self._vehicle)
        self._heard_s = clock()
        self._heard_step = 0
        self._silent_s = 0.0  # at the end of the last step

    @property
    def held_s(self) -> float:
        """For how long [s] the last controls have been held."""
        return self._silent_s

    @property
    def silent_since(self) -> int | None:
        """As of :class:`Lockstep`."""
        return self._heard_step if self._silent_s > SILENT_S else None

    def send_ahead(self, datagram: bytes) -> None:
        """Send what belongs to the next step and has no room in its datagram."""
        self._endpoint.send(datagram)

    def step(
        self, number: int, t_us: int, datagram: bytes, meanwhile: Callable[[], None]
    ) -> VehicleReply:
        """As of :class:`Lockstep`."""
        if number == 0:
            return self._first_step(t_us, datagram, meanwhile)
        self._endpoint.send(datagram)
        meanwhile()
        self._wait(number)
        answers = self._waiting()
        if answers:
            self._heard_s, self._heard_step = self._clock(), number
            self._held = max(answers, key=lambda answer: answer.t_us).controls
        self._silent_s = self._clock() - self._heard_s
        if self._silent_s > HOLD_S:
            self._held = Controls.off(self._vehicle)
        if self._silent_s > STALL_S:
            raise SimulatorError(
                f"the flight software sent nothing for {STALL_S:g} s after step {self._heard_step}"
            )
        if not any(answer.t_us == t_us for answer in answers):
            self.counts.missed += 1
        return VehicleReply(
            t_us,
            self._held,
            acks=tuple(ack for answer in answers for ack in answer.acks),
            texts=tuple(text for answer in answers for text in answer.texts),
            custom_mode=next(
                (a.custom_mode for a in reversed(answers) if a.custom_mode is not None), None
            ),
            injections=tuple(one for answer in answers for one in answer.injections),
        )

    def _first_step(
        self, t_us: int, datagram: bytes, meanwhile: Callable[[], None]
    ) -> VehicleReply:
        """Wait for the first answer as lockstep does, then start the grid."""
        answer = self._first.step(0, t_us, datagram, meanwhile)
        self._held = answer.controls
        self._heard_s = self._clock()
        self._grid.begin(self._heard_s + _FIRST_PLAN_S)
        self._wait(0)
        return answer

    def _wait(self, number: int) -> None:
        """Sleep until the step is over; a suspension here is no silence of the vehicle."""
        paused_s = self._grid.wait(number)
        if paused_s > 0.0:
            self.counts.pauses += 1
            self.counts.paused_s += paused_s
            self._heard_s += paused_s

    def _waiting(self) -> list[VehicleReply]:
        answers = []
        while (received := self._endpoint.receive_waiting()) is not None:
            answer = decode.read_reply(received, self._vehicle)
            if answer is not None:
                answers.append(answer)
        return answers


Exchange = Lockstep | RealTime
"""How a step is exchanged with the vehicle."""
