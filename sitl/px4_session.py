"""A flight with PX4 at the other end: a stream, in lockstep."""

from __future__ import annotations

from command_line.process import Events, StopRequest
from sitl.arguments import SitlOptions
from sitl.flight import FlownSession, Watch
from sitl.link.px4_messages import Px4Encoder
from sitl.link.px4_server import Px4Exchange, serve_px4
from sitl.link.stream_endpoint import ByteStream
from sitl.simulation import STEP_US, Simulation


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
        timing = serve_px4(
            *(simulation, exchange, Px4Encoder(options.origin), stop),
            *(watch.progress, watch.truth, watch.begun),
            every=round(1e6 * period_s) // STEP_US,
            pace_s=None if options.speed is None else period_s / options.speed,
        )
        return FlownSession(timing, exchange.counts, silent=not self._stream.connected)

    def _answers(self, number: int) -> None:
        self._events.report("answering", f"sitl: PX4 answers from step {number} on", step=number)
