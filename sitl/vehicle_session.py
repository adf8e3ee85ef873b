"""A flight with our own flight software at the other end: datagrams, in lockstep or real time."""

from __future__ import annotations

from command_line.process import StopRequest
from sitl.arguments import SitlOptions
from sitl.faults.keys import LINKS
from sitl.flight import FlownSession, Watch
from sitl.link.encode import StepEncoder
from sitl.link.endpoints import PeerSocket
from sitl.link.exchange import Exchange, Lockstep, RealTime
from sitl.link.faulty_endpoint import Endpoint, FaultyEndpoint
from sitl.link.pilot import flight_plan
from sitl.link.server import serve, shut_down
from sitl.result import EndKind
from sitl.simulation import START_US, STEP_US, Simulation


class VehicleSession:
    """The link to it, and the scenario's pilot."""

    def __init__(self, options: SitlOptions, endpoint: PeerSocket) -> None:
        """Take a socket whose peer is the flight software."""
        self._options = options
        self._endpoint = endpoint

    def fly(self, simulation: Simulation, watch: Watch, stop: StopRequest) -> FlownSession:
        """See :class:`sitl.flight.Session`."""
        clock = simulation.clock
        encoder = StepEncoder(
            lockstep=not self._options.realtime,
            measured=simulation.measurements() is not None,
            origin=self._options.origin,
        )
        plan = flight_plan(
            simulation.scenario,
            lambda t_us: clock.target_at(1e-6 * (t_us - START_US)),
            lambda t_us: clock.yaw_at(1e-6 * (t_us - START_US)),
        )
        exchange = self._exchange(simulation, stop)
        timing = serve(
            *(simulation, plan, exchange, encoder, stop),
            *(watch.progress, watch.truth, watch.begun),
        )
        silent_since = exchange.silent_since
        if silent_since is not None:
            simulation.note_silence(silent_since)
        tries = _tries(simulation, silent_since is not None)
        heard = shut_down(self._endpoint, encoder, tries)
        return FlownSession(timing, exchange.counts, silent=not heard)

    def _exchange(self, simulation: Simulation, stop: StopRequest) -> Exchange:
        endpoint = self._link(simulation)
        vehicle = simulation.vehicle
        period_s = 1e-6 * STEP_US
        if self._options.realtime:
            return RealTime(endpoint, vehicle, period_s, stop)
        speed = self._options.speed
        paced_s = None if speed is None else period_s / speed
        return Lockstep(endpoint, vehicle, paced_s, stop)

    def _link(self, simulation: Simulation) -> Endpoint:
        """The way to the vehicle, with a network in between that fails if the scenario has one."""
        if not any(fault.unit in LINKS for fault in simulation.scenario.faults):
            return self._endpoint
        faults = simulation.faults
        return FaultyEndpoint(self._endpoint, lambda: faults.active, self._options.seed)


def _tries(simulation: Simulation, silent: bool) -> int:
    """How often to send the shutdown command; a silent vehicle may not receive it."""
    end = simulation.ended
    if end is not None and end.kind is EndKind.STOPPED:
        return 0
    if silent:
        return 1
    return 2 if end is not None and end.kind is EndKind.INTERRUPTED else 4
