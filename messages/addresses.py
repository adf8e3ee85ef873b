"""Addresses of links: ``udp:HOST:PORT``, ``tcp:HOST:PORT``, ``tcpin:HOST:PORT``, a serial line.

A stream of bytes has one peer; so that it is known as peers of a UDP socket are, it has a name and
a number as well.
"""

from __future__ import annotations

import re
import socket
from dataclasses import dataclass
from typing import Final, TypeAlias

Address: TypeAlias = tuple[str, int]
"""Host and port of a UDP socket; of a stream its name and its port or baud."""

FORMS: Final = "udp:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT or serial:DEVICE:BAUD"
_FORM: Final = re.compile(
    r"(?P<kind>udp|tcp|tcpin|serial):(?P<where>[^\0]+):(?P<number>\d{1,9})", re.ASCII
)
_HOST: Final = re.compile(r"[^:\s]+")
_SLOWEST, _FASTEST = 9_600, 4_000_000  # baud


class LinkError(Exception):
    """A link that cannot be opened, in one sentence for the operator."""


@dataclass(frozen=True, slots=True)
class SerialLine:
    """A serial port, of 8 data bits, no parity and 1 stop bit."""

    device: str
    baud: int

    @property
    def peer(self) -> Address:
        """Who speaks on it."""
        return f"serial:{self.device}", self.baud

    @property
    def bytes_per_s(self) -> float:
        """What the line carries [bytes/s]: 10 bits a byte."""
        return 0.1 * self.baud


@dataclass(frozen=True, slots=True)
class TcpEnd:
    """One end of a TCP connection: it connects, or listens for one client at a time."""

    host: str
    port: int
    listens: bool = False

    @property
    def peer(self) -> Address:
        """Who speaks on it."""
        return f"tcpin:{self.host}" if self.listens else f"tcp:{self.host}", self.port

    @property
    def bytes_per_s(self) -> None:
        """Not known of a network."""
        return None


StreamAddress: TypeAlias = SerialLine | TcpEnd
LinkAddress: TypeAlias = Address | StreamAddress


def parse_address(text: str, *, any_port: bool = False) -> Address:
    """Read ``udp:HOST:PORT``; port 0, which lets the system choose, only with ``any_port``.

    Raises:
        LinkError: The text has another form, the port is out of range, or the host is unknown.
    """
    kind, host, number = _parts(text, "udp:HOST:PORT")
    if kind != "udp":
        raise LinkError(f"address {text!r} is not of the form udp:HOST:PORT")
    return _host(text, host, "udp:HOST:PORT"), _port(text, number, 0 if any_port else 1)


def parse_link_address(text: str) -> LinkAddress:
    """Read an address of any kind.

    Raises:
        LinkError: As of :func:`parse_address`; or the baud of a serial line is out of range.
    """
    kind, where, number = _parts(text, FORMS)
    if kind == "serial":
        if not _SLOWEST <= number <= _FASTEST:
            raise LinkError(f"address {text!r}: baud {number} is outside {_SLOWEST}..{_FASTEST}")
        return SerialLine(where, number)
    host, port = _host(text, where, FORMS), _port(text, number, 1)
    return (host, port) if kind == "udp" else TcpEnd(host, port, listens=kind == "tcpin")


def parse_listener(text: str) -> TcpEnd:
    """Read ``tcp:HOST:PORT`` of this machine, to listen there; port 0 lets the system choose.

    Raises:
        LinkError: As of :func:`parse_address`.
    """
    form = "tcp:HOST:PORT"
    kind, host, number = _parts(text, form)
    if kind not in ("tcp", "tcpin"):
        raise LinkError(f"address {text!r} is not of the form {form}")
    return TcpEnd(_host(text, host, form), _port(text, number, 0), listens=True)


def address_text(address: LinkAddress) -> str:
    """The opposite of :func:`parse_link_address`."""
    if isinstance(address, tuple):
        return f"udp:{address[0]}:{address[1]}"
    name, number = address.peer
    return f"{name}:{number}"


def _parts(text: str, forms: str) -> tuple[str, str, int]:
    match = _FORM.fullmatch(text)
    if match is None:
        raise LinkError(f"address {text!r} is not of the form {forms}")
    return match["kind"], match["where"], int(match["number"])


def _host(text: str, host: str, forms: str) -> str:
    if _HOST.fullmatch(host) is None:
        raise LinkError(f"address {text!r} is not of the form {forms}")
    try:
        return socket.gethostbyname(host)
    except (OSError, UnicodeError):
        raise LinkError(f"address {text!r}: host {host!r} is not known") from None


def _port(text: str, port: int, lowest: int) -> int:
    if not lowest <= port <= 65535:
        raise LinkError(f"address {text!r}: port {port} is outside {lowest}..65535")
    return port
