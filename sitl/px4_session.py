"""A flight with PX4 at the other end: a stream, in lockstep."""

from __future__ import annotations

import contextlib
from dataclasses import replace

from command_line.process import Events, StopRequest
from sitl.arguments import SitlOptions
from sitl.flight import FlownSession, Watch
from sitl.link.companion import Companion
from sitl.link.encode import StepEncoder
from sitl.link.endpoints import ByteStream, PeerSocket, parse_address
from sitl.link.pilot import flight_plan
from sitl.link.px4_messages import Px4Encoder
from sitl.link.px4_server import Px4Exchange, serve_px4
from sitl.plant.state import P_WB
from sitl.sensors.channel import Measurement
from sitl.simulation import START_US, STEP_US, Simulation
from sitl.start import hovering


class Px4Session:
    """The connection that PX4 has opened."""

    def __init__(self, options: SitlOptions, stream: ByteStream, events: Events) -> None:
        """Take a stream whose peer is PX4."""
        self._options = options
        self._stream = stream
        self._events = events

    def fly(self, simulation: Simulation, watch: Watch, stop: StopRequest) -> FlownSession:
        """See :class:`sitl.flight.Session`."""
        options = self._options
        period_s = 1.0 / options.rate_hz
        exchange = Px4Exchange(self._stream, simulation.vehicle, period_s, stop, self._answers)
        with contextlib.ExitStack() as open_ends:
            companion = self._companion(simulation, open_ends)
            timing = serve_px4(
                *(simulation, exchange, Px4Encoder(options.origin), stop),
                *(watch.progress, watch.truth, watch.begun),
                every=round(1e6 * period_s) // STEP_US,
                pace_s=None if options.speed is None else period_s / options.speed,
                beside=_nobody if companion is None else companion.step,
            )
        return FlownSession(timing, exchange.counts, silent=not self._stream.connected)

    def _companion(
        self, simulation: Simulation, open_ends: contextlib.ExitStack
    ) -> Companion | None:
        """Who speaks to the planner above PX4, where there is one."""
        if self._options.companion is None:
            return None
        peer = PeerSocket.connected(parse_address(self._options.companion), 0.0)
        open_ends.callback(peer.close)
        clock = simulation.clock
        plan = flight_plan(
            simulation.scenario,
            lambda t_us: clock.target_at(1e-6 * (t_us - START_US)),
            lambda t_us: clock.yaw_at(1e-6 * (t_us - START_US)),
        )
        # On the ground no pilot asks for it; the planner's is told all the same.
        plan = replace(plan, target_at=lambda t_us: clock.target_at(1e-6 * (t_us - START_US)))
        first = clock.target_at(0.0).p
        place, _ = hovering(simulation.vehicle, simulation.scenario, first)
        x, y, z = (float(one) for one in place[P_WB : P_WB + 3])
        return Companion(peer, plan, StepEncoder(lockstep=True, measured=True), (x, y, z))

    def _answers(self, number: int) -> None:
        self._events.report("answering", f"sitl: PX4 answers from step {number} on", step=number)


def _nobody(simulation: Simulation, measured: list[Measurement]) -> None:
    """Stands beside PX4 where there is no planner above it."""
