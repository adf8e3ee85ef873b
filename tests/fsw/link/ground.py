"""A ground station's socket, and the links under test behind it."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import Vec3
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
from fsw.link.services.service import LinkService, TimeService
from fsw.link.signing.key_file import KeyFile, SigningKey
from fsw.link.signing.signing import SignedTimes, Signing
from fsw.link.telemetry.streams import API_RATES, GROUND_RATES
from fsw.storage.parameter_store import ParameterStore
from messages.frames import Frame, split
from tests.fsw.link.snapshots import CONTEXT, outputs_at


def station_socket() -> socket.socket:
    """A UDP socket of this machine that does not wait."""
    station = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    station.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    station.bind(("127.0.0.1", 0))
    station.setblocking(False)
    return station


@dataclass
class ManualClock:
    """Clocks that a test moves."""

    now_us: int = 0
    unix_us: int = 1_750_000_000_000_000

    def pass_s(self, seconds: float) -> None:
        self.now_us += round(1e6 * seconds)
        self.unix_us += round(1e6 * seconds)


@dataclass
class Ground:
    """One end of a link, with the link itself."""

    station: socket.socket
    link: GcsLink
    links: GroundLinks
    inbox: Inbox
    clock: ManualClock
    recorded: list[tuple[int, bytes]] = field(default_factory=list)
    t_us: int = 1_000_000
    ticks: int = 0

    def heard(self) -> list[Frame]:
        """Every frame that has arrived since the last call."""
        return [frame for datagram in self.datagrams() for frame in split(datagram)]

    def datagrams(self) -> list[bytes]:
        """The same as it arrived."""
        got = []
        while True:
            try:
                got.append(self.station.recv(2048))
            except BlockingIOError:
                return got

    def polled(self, datagram: bytes, sender: socket.socket | None = None) -> None:
        """Send something to the vehicle and let it read."""
        (sender or self.station).sendto(datagram, ("127.0.0.1", self.link.port))
        self.poll()

    def poll(self) -> None:
        """Let the vehicle read what has arrived."""
        self.link.read(self.t_us, 4096)

    def fly_silently(self, ticks: int) -> None:
        """Let some ticks pass, and what is sent wait for who listens."""
        for _ in range(ticks):
            self.t_us += 2_000
            self.links.publish(outputs_at(self.t_us))

    def fly(self, ticks: int, **changes: Any) -> list[Frame]:
        """Let some ticks pass; keyword arguments replace fields of the snapshot."""
        frames = []
        for _ in range(ticks):
            self.t_us += 2_000
            outputs = outputs_at(self.t_us)
            snapshot = replace(outputs.snapshot, **changes)
            self.links.publish(replace(outputs, shown=snapshot))
            self.ticks += 1
            if self.ticks % 100 == 0:
                frames += self.heard()
        return frames + self.heard()


class Unkept(KeyFile):
    """A file that keeps no key."""

    def __init__(self) -> None:
        super().__init__(Path(os.devnull))

    def read(self, latest: int) -> None:
        return None

    def write(self, key: SigningKey) -> None:
        pass

    def remove(self) -> None:
        pass


@contextmanager
def ground_station(
    *,
    services: Sequence[LinkService] = (),
    api: bool = False,
    key_file: KeyFile | None = None,  # none: the key ends with the link
    times: SignedTimes | None = None,
    sent: SentFrames | None = None,
) -> Iterator[Ground]:
    """A link to a ground station, or to a program, of its own."""
    station, inbox, clock = station_socket(), Inbox(), ManualClock()
    recorded: list[tuple[int, bytes]] = []
    rates = API_RATES if api else GROUND_RATES
    link = GcsLink(
        LinkSetup("test", station.getsockname(), 0, rates, unheard=not api),
        inbox,
        CONTEXT,
        Signing(0, lambda: clock.unix_us, key_file or Unkept(), times or SignedTimes()),
        lambda: clock.now_us,
        lambda t, frame: recorded.append((t, frame)),
        services,
        sent or SentFrames(),
    )
    links = GroundLinks([link], 2_000, lambda: clock.now_us)
    try:
        yield Ground(station, link, links, inbox, clock, recorded)
    finally:
        links.close()
        station.close()


@contextmanager
def whole_vehicle(folder: Path) -> Iterator[Ground]:
    """A link with everything that listens on one, disarmed; its flight's files are in a folder."""
    run = folder / "run-1"
    run.mkdir()
    (run / "flight.tlog").write_bytes(bytes(2000))
    logs = FlightLogs(run)
    services = (
        ParameterService(ParameterStore(FlightConfig(), lambda tuning: None)),
        MissionService(MissionStore(Site(_nowhere, lambda: 0.1))),
        LogService(logs),
        LogStreamService(logs),
        FtpService(vehicle_files(logs)),
        TimeService(),
    )
    with ground_station(services=services) as ground:
        ground.fly(5, armed=False)
        yield ground


def _nowhere(latitude: float, longitude: float, altitude: float) -> Vec3:
    return latitude, longitude, -altitude
