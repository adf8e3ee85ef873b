"""A vehicle with its link to a ground station, in one process: no clock on the wall takes part.

Plant, tick and planner are joined as in ``tests/closed_loop``; link, services and sockets are the
flight software's. So what a ground station sends over UDP flies the whole vehicle, and a second of
flight takes less than a tenth of one.
"""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from fsw.autopilot.geometry.geodesy import to_local
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.ports import LoopHealth
from fsw.link.bounded_memory import SentFrames
from fsw.link.files.ftp_service import FtpService
from fsw.link.files.log_service import LogService
from fsw.link.files.log_stream import LogStreamService
from fsw.link.files.vehicle_files import FlightLogs, vehicle_files
from fsw.link.gcs_link import GcsLink, LinkSetup
from fsw.link.ground_links import GroundLinks
from fsw.link.inbox import Inbox
from fsw.link.services.mission_service import MissionService
from fsw.link.services.mission_store import MissionStore, Site
from fsw.link.services.parameter_service import ParameterService
from fsw.link.services.service import TimeService
from fsw.link.signing.signing import SignedTimes, Signing
from fsw.link.telemetry.streams import GROUND_RATES
from fsw.link.wire.outgoing import TelemetryContext
from fsw.runtime.assembly import vehicle_facts
from fsw.storage.parameter_store import ParameterStore
from messages import dialect
from messages.frames import as_version_1
from sitl.scenario import Scenario
from tests.closed_loop.harness import Flight, on_the_ground
from tests.fsw.link.ground import Unkept
from tests.fsw.storage.threads import AtOnce

Message = Any
TICK_S = 0.002

PARAMETER_FILE = Path("/var/vehicle.params")  # of the vehicle; the earlier flight was its too


@dataclass
class Connected:
    """The vehicle, and the ground station's end of its link."""

    flight: Flight
    links: GroundLinks
    inbox: Inbox
    parameters: ParameterStore
    missions: MissionStore
    station: socket.socket
    version_1: bool = False  # what the ground station speaks
    heard: list[Message] = field(default_factory=list)
    markers: set[int] = field(default_factory=set)  # of the frames that came

    def __post_init__(self) -> None:
        self.become(255, 190, 6)
        self._reader = dialect.MAVLink(None)
        self._reader.robust_parsing = True
        self._beat_s = 0.0

    def become(self, system: int, component: int, kind: int) -> None:
        """Be a program of some identity and MAV_TYPE."""
        self.mav = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self.kind = kind

    @property
    def t_s(self) -> float:
        """The vehicle's time."""
        return TICK_S * self.flight.sim.step

    def send(self, message: Message) -> None:
        """Say something, in the version that is spoken."""
        packed = bytes(message.pack(self.mav))
        if self.version_1:
            old = as_version_1(packed)
            assert old is not None, "MAVLink 1 has no such message"
            packed = old
        self.station.sendto(packed, ("127.0.0.1", self.links.links[0].port))

    def run(self, seconds: float, until: Callable[[Message], bool] | None = None) -> Message:
        """Fly on; returns the first message that is wanted, None if none came."""
        end = self.t_s + seconds
        while self.t_s < end:
            if self.t_s >= self._beat_s:
                self._beat_s = self.t_s + 1.0
                self.send(dialect.MAVLink_heartbeat_message(self.kind, 8, 192, 0, 4, 3))
            self._step()
            arrived = self._arrived()
            self.heard += arrived
            found = next((m for m in arrived if until is not None and until(m)), None)
            if found is not None:
                return found
        return None

    def _step(self) -> None:
        flight, inbox = self.flight, self.inbox
        sensors = flight.closed.observe()[0]
        tuning = self.parameters.take_tuning()
        inputs = inbox.take_inputs(
            sensors, flight.closed.planner.take(sensors.t_us), tuning, self.missions.take_update()
        )
        outputs = flight.step_with(inputs)
        self.missions.observe(outputs.snapshot)
        inbox.owner = outputs.snapshot.safe_set_owner
        if tuning is not None:
            self.parameters.settle(outputs.tuning_taken)
        if inputs.mission is not None:
            self.missions.settle(outputs.upload_taken)
        for ack in outputs.acks:
            self.links.acknowledge(sensors.t_us, ack)
        self.links.publish(outputs)
        self.links.poll(sensors.t_us)

    def _arrived(self) -> list[Message]:
        found: list[Message] = []
        with contextlib.suppress(BlockingIOError):
            while True:
                datagram = self.station.recv(4096)
                self.markers.add(datagram[0])
                found += self._reader.parse_buffer(bytearray(datagram)) or ()
        return found


@contextlib.contextmanager
def connected(
    folder: Path, config: FlightConfig, scenario: Scenario | None = None
) -> Iterator[Connected]:
    """A vehicle that stands disarmed or in a scenario, an earlier flight's log beside its own."""
    station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    station.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    station.bind(("127.0.0.1", 0))
    station.setblocking(False)
    flight, inbox = Flight(scenario or on_the_ground(), config=config), Inbox()
    parameters = ParameterStore(config, lambda tuning: None)
    parameters.open(AtOnce(), lambda values: None)
    missions = MissionStore(Site(partial(to_local, config.origin), lambda: 0.1))
    health = LoopHealth()
    facts = vehicle_facts(config)
    context = TelemetryContext(facts, health, origin=config.origin, plan_ids=missions.ids)
    logs = FlightLogs(folder, PARAMETER_FILE)
    services = (
        TimeService(),
        ParameterService(parameters),
        MissionService(missions),
        LogService(logs),
        LogStreamService(logs),
        FtpService(vehicle_files(logs)),
    )
    now_us = lambda: 2_000 * flight.sim.step  # noqa: E731
    link = GcsLink(
        LinkSetup("gcs", station.getsockname(), 0, GROUND_RATES, unheard=True),
        inbox,
        context,
        Signing(0, now_us, Unkept(), SignedTimes()),
        now_us,
        None,
        services,
        SentFrames(),
    )
    links = GroundLinks([link], config.tick_period_us, now_us)
    try:
        yield Connected(flight, links, inbox, parameters, missions, station)
    finally:
        links.close()
        station.close()
