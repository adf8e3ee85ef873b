"""The simulator server: one run of a simulation with the vehicle at the other end of the link."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from command_line.process import StopRequest
from messages.frames import split
from messages.message_ids import ACCEPTED, CMD_REBOOT_SHUTDOWN
from sitl.faults.keys import Fault
from sitl.link import decode, pilot
from sitl.link.decode import VehicleReply
from sitl.link.encode import StepEncoder
from sitl.link.endpoints import PeerSocket
from sitl.link.exchange import Exchange, SimulatorError
from sitl.link.failures import Injector
from sitl.link.pilot import FlightPlan, PilotState
from sitl.link.pilot_messages import Heard, PilotMessage, SendCommand
from sitl.result import EndKind
from sitl.sensors.exact import SensorReadings
from sitl.simulation import STEP_US, Controls, Simulation
from sitl.stand_in import StandIn

_HEARTBEAT_STEPS: Final = 500  # 1 Hz
PROGRESS_S: Final = 0.1  # wall time between two reports
PROGRESS_STEPS: Final = 25  # how often the wall clock is looked at
_SILENT: Final = math.nan
_SHUTDOWN: Final = SendCommand(
    CMD_REBOOT_SHUTDOWN, (0.0, 2.0, _SILENT, _SILENT, _SILENT, _SILENT, _SILENT)
)


Progress = Callable[[float, float | None, float], None]
"""Takes simulated time [s], the smallest margin so far [m] and the speed, ten times a second."""


@dataclass(frozen=True, slots=True)
class RunTiming:
    """Speed of a run."""

    steps: int
    wall_s: float
    real_time_factor: float


def wait_for_vehicle(endpoint: PeerSocket, wait_s: float, stop: StopRequest) -> bool:
    """Serve the first sender of a valid frame; False if none came in time."""
    until_s = time.perf_counter() + wait_s
    while time.perf_counter() < until_s and not stop.requested:
        received = endpoint.receive_from_anyone()
        if received is not None and any(split(received[0])):
            endpoint.serve(received[1])
            return True
    return False


def serve(
    simulation: Simulation,
    plan: FlightPlan,
    exchange: Exchange,
    encoder: StepEncoder,
    stop: StopRequest,
    progress: Progress,
    truth: Callable[[Simulation], None],
    begun: Callable[[Fault], None] = lambda _: None,
) -> RunTiming:
    """Step until the simulation, the pilot, a signal or silence ends the run.

    ``begun`` takes each fault when it begins. The reason for the end is in ``simulation.ended``.
    """
    answered = b""  # to those who asked for a fault
    state = PilotState(plan.first_phase)
    spoken = pilot.speak(plan, state, simulation.t_us)
    begin_s = reported_s = time.perf_counter()

    def meanwhile() -> None:
        """What need not wait for the answer, while the vehicle thinks."""
        nonlocal spoken
        truth(simulation)
        simulation.catch_up()
        spoken = pilot.speak(plan, state, simulation.t_us + STEP_US)

    injector, stand_in = Injector(simulation), StandIn(simulation.vehicle)
    while simulation.ended is None:
        stamp_us = simulation.sensor_time_us
        # The pilot has a clock of its own, which does not fail with the sensors'.
        t_us, seen = simulation.t_us, simulation.healthy()
        state, messages = spoken
        if simulation.faults.active:
            messages = _heard_of(simulation, messages, begun)
        datagram = _datagram(simulation, encoder, messages, exchange, answered, stamp_us)
        try:
            answer = exchange.step(simulation.step, stamp_us, datagram, meanwhile)
            if simulation.step == 0:  # the vehicle may take its time for the first answer
                begin_s = time.perf_counter()
            answered = _injected(injector, encoder, answer) if answer.injections else b""
            _advance(simulation, answer.controls, exchange.held_s, stand_in)
        except SimulatorError as error:
            _end_if_over(simulation, state, stop, t_us)
            simulation.end(EndKind.STOPPED, str(error))
            break
        if pilot.attends(state) or answer.says_more:
            heard = pilot.listen(plan, state, _heard(answer, seen), t_us)
            if heard is not state:  # what was to be said is not any more
                state, spoken = heard, pilot.speak(plan, heard, simulation.t_us)
        _end_if_over(simulation, state, stop, t_us)
        if simulation.step % PROGRESS_STEPS == 0:
            now_s = time.perf_counter()
            if now_s - reported_s >= PROGRESS_S:
                reported_s = now_s
                speed = simulation.time_s / (now_s - begin_s)
                progress(simulation.time_s, simulation.min_margin_m, speed)
    wall_s = time.perf_counter() - begin_s
    return RunTiming(simulation.step, wall_s, simulation.time_s / max(wall_s, 1e-9))


def _end_if_over(simulation: Simulation, state: PilotState, stop: StopRequest, t_us: int) -> None:
    if state.left is not None:
        simulation.leave_trajectory(t_us, state.left)
    if state.refusal is not None:
        simulation.end(EndKind.REFUSED, state.refusal)
    elif state.done:
        simulation.end(EndKind.MISSION, f"landed and disarmed after {simulation.time_s:.1f} s")
    else:
        end_if_over(simulation, stop)


def end_if_over(simulation: Simulation, stop: StopRequest) -> None:
    """End the run if it was interrupted."""
    if stop.requested:
        endless = math.isinf(simulation.scenario.duration_s)  # and has no other end than this
        by = ": ended by you" if endless else ""
        simulation.end(EndKind.INTERRUPTED, f"interrupted at step {simulation.step}{by}")


def _heard_of(
    simulation: Simulation, messages: tuple[PilotMessage, ...], begun: Callable[[Fault], None]
) -> tuple[PilotMessage, ...]:
    """What comes through of the pilot's ``messages`` while something fails."""
    faults = simulation.faults
    for fault in faults.take_begun():
        begun(fault)
    return () if faults.pilot_silent(simulation.t_us) else messages


def _injected(injector: Injector, encoder: StepEncoder, answer: VehicleReply) -> bytes:
    """Begin and end the faults that were asked for; returns what their senders are told."""
    return b"".join(encoder.answer(one, injector.answer(one)) for one in answer.injections)


def _datagram(
    simulation: Simulation,
    encoder: StepEncoder,
    messages: tuple[PilotMessage, ...],
    exchange: Exchange,
    answered: bytes,
    stamp_us: int,
) -> bytes:
    """The datagram of this step, stamped ``stamp_us``; what has no room in it is sent ahead."""
    heartbeat = encoder.heartbeat() if simulation.step % _HEARTBEAT_STEPS == 0 else b""
    opening = heartbeat + answered
    battery = simulation.battery()
    if battery is not None:
        opening += encoder.battery(*battery)
    measured = simulation.measurements()
    if measured is None:
        return opening + encoder.datagram(simulation.sense(), messages)
    ahead, datagram = encoder.measured_datagrams(stamp_us, measured, messages, opening)
    for one in ahead:
        exchange.send_ahead(one)
    return datagram


def shut_down(endpoint: PeerSocket, encoder: StepEncoder, tries: int) -> bool:
    """Command the vehicle to shut down; True once it has acknowledged."""
    for _ in range(tries):
        endpoint.send(encoder.spoken((_SHUTDOWN,)))
        until_s = time.perf_counter() + 0.25
        while time.perf_counter() < until_s:
            received = endpoint.receive()
            if received is None:
                break
            for ack in decode.acknowledgements(split(received)):
                if ack.command == CMD_REBOOT_SHUTDOWN and ack.result == ACCEPTED:
                    return True
    return False


def _advance(
    simulation: Simulation, controls: Controls, held_s: float | None, stand_in: StandIn
) -> None:
    """Apply what came, ``held_s`` [s] ago; None: it is of this step."""
    if held_s is not None:
        controls = stand_in.applied(controls, held_s, simulation.healthy())
    try:
        simulation.advance(controls)
    except ValueError as error:
        raise SimulatorError(f"the flight software sent unusable controls: {error}") from None


def _heard(answer: VehicleReply, readings: SensorReadings) -> Heard:
    return Heard(
        answer.acks,
        answer.texts,
        answer.controls.armed,
        height_m=-readings.p_WB[2],
        speed_m_s=math.hypot(*readings.v_WB),
        custom_mode=answer.custom_mode,
    )
