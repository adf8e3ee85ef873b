"""A stream of bytes to one peer that may come late, vanish and come back; nothing here waits.

A serial port that is unplugged, or whose adapter is not there yet, is looked for once a second, and
so is a TCP server. A listening end serves one client; a new one takes the place of one that may be
dead, as a cable that was pulled tells nobody.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import termios
from collections.abc import Callable
from typing import Final, Protocol

from messages.addresses import LinkError, SerialLine, StreamAddress, TcpEnd, address_text

RETRY_US: Final = 1_000_000
_ACCEPT_US: Final = 100_000
_UNSENT: Final = 4096  # bytes that wait for a line; more are dropped, whole datagrams at a time
_DIAL_US: Final = 5_000_000  # after which a call that nobody answers is made again
_DEAD_MS: Final = 10_000  # after which a connection whose bytes nobody acknowledges is over


class _Port(Protocol):
    """What has a handle to read and write, and can be closed."""

    def fileno(self) -> int: ...

    def close(self) -> None: ...


class ByteStream:
    """One end of the stream at an address."""

    def __init__(self, address: StreamAddress, clock: Callable[[], int]) -> None:
        """Begin to listen or look for the peer; the clock [us] is monotonic.

        Raises:
            LinkError: It listens, and the port is in use or the address is not of this machine.
        """
        self.address = address
        self.connections = 0  # how often there was one
        self.dropped = 0  # datagrams for which there was no room
        self.problem = ""  # why there is no connection, as the system says
        self._clock = clock
        self._looks_us = 0
        self._port: _Port | None = None
        self._dialling: socket.socket | None = None
        self._dialled_us = 0
        self._listener = _listener(address) if _listens(address) else None
        self._poll = select.poll()
        self._unsent = b""
        # Never ready: what to wait for while there is no connection.
        self._nothing = os.eventfd(0, os.EFD_CLOEXEC)
        self.look()

    @property
    def connected(self) -> bool:
        """Whether there is a connection."""
        return self._port is not None

    def fileno(self) -> int:
        """The handle, to wait for; another one after each connection."""
        for one in (self._port, self._listener):
            if one is not None:
                return one.fileno()
        return self._nothing

    def read(self, most: int) -> bytes:
        """Up to ``most`` bytes that are there; also looks for a peer when it is time."""
        if self._port is None or self._listener is not None:
            self.look()
        self._flush()
        port = self._port
        ready = self._poll.poll(0)
        if port is None or not ready:
            return b""
        if ready[0][1] & select.POLLIN:
            try:
                data = os.read(port.fileno(), most)
            except BlockingIOError:
                return b""
            except OSError as error:
                self._lose(_reason(error))
                return b""
            if data:
                return data
        # Ready, and nothing there: the other end is closed, or the device is unplugged.
        self._lose("closed by the other side")
        return b""

    def send(self, datagram: bytes) -> None:
        """Send all of it, now or when the line takes it; none of it where too much waits."""
        if self._port is None:
            return
        self._flush()
        if self._unsent and len(self._unsent) + len(datagram) > _UNSENT:
            self.dropped += 1
            return
        self._unsent += datagram
        self._flush()

    @property
    def listening_port(self) -> int | None:
        """Where it listens, if it does."""
        return None if self._listener is None else int(self._listener.getsockname()[1])

    def stop_listening(self) -> None:
        """Keep to the client that there is: nobody takes its place."""
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def close(self) -> None:
        """Give everything back; safe to call twice."""
        self._lose("")
        for one in (self._listener, self._dialling):
            if one is not None:
                one.close()
        self._listener = self._dialling = None
        if self._nothing >= 0:
            os.close(self._nothing)
            self._nothing = -1

    def _flush(self) -> None:
        if not self._unsent or self._port is None:
            return
        try:
            sent = os.write(self._port.fileno(), self._unsent)
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(_reason(error))
            return
        self._unsent = self._unsent[sent:]

    def look(self) -> None:
        """Open what can be opened now; :meth:`read` does so too."""
        now_us = self._clock()
        if now_us < self._looks_us or self._nothing < 0:
            return
        self._looks_us = now_us + (_ACCEPT_US if self._listener is not None else RETRY_US)
        try:
            if isinstance(self.address, SerialLine):
                self._take(_serial(self.address))
            elif self._listener is not None:
                self._accept(self._listener)
            elif not self.address.listens:
                self._dial(self.address)
        except OSError as error:
            self.problem = _reason(error)
        except (ValueError, termios.error):
            self.problem = "the port does not know this baud"

    def _accept(self, listener: socket.socket) -> None:
        try:
            client, _ = listener.accept()
        except BlockingIOError:
            return
        self._take(_tcp(client))

    def _dial(self, address: TcpEnd) -> None:
        """Begin to connect, or see what has become of it."""
        if self._dialling is None:
            self._dialling = _tcp(socket.socket(socket.AF_INET, socket.SOCK_STREAM))
            self._dialled_us = self._clock()
            try:
                self._dialling.connect((address.host, address.port))
            except BlockingIOError:
                # On this machine it is over at once.
                select.select((), (self._dialling,), (), 0.0)
        one, self._dialling = self._dialling, None
        problem = one.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if problem:
            one.close()
            raise OSError(problem, os.strerror(problem))
        try:
            one.getpeername()
        except OSError:
            self.problem = "no answer"
            if self._clock() - self._dialled_us < _DIAL_US:
                self._dialling = one  # it still tries
            else:
                one.close()
            return
        self._take(one)

    def _take(self, port: _Port) -> None:
        self._lose("another client has connected")
        self._port = port
        self._poll.register(port, select.POLLIN)
        self.connections += 1
        self.problem = ""

    def _lose(self, problem: str) -> None:
        port, self._port, self._unsent = self._port, None, b""
        if port is None:
            return
        self._poll.unregister(port)
        with contextlib.suppress(OSError, termios.error):  # the device may be gone
            port.close()
        self.problem = problem
        self._looks_us = self._clock() + RETRY_US if self._listener is None else 0


def _listens(address: StreamAddress) -> bool:
    return isinstance(address, TcpEnd) and address.listens


def _listener(address: StreamAddress) -> socket.socket:
    assert isinstance(address, TcpEnd)
    one = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        one.bind((address.host, address.port))
        one.listen(1)
    except OSError as error:
        one.close()
        reason = _reason(error)
        raise LinkError(
            f"cannot listen on {address_text(address)}: {reason[0].lower()}{reason[1:]}"
        ) from None
    one.setblocking(False)
    return one


def _tcp(one: socket.socket) -> socket.socket:
    one.setblocking(False)
    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _DEAD_MS)
    return one


def _serial(line: SerialLine) -> _Port:
    import serial  # by those alone who have such a line

    port: _Port = serial.Serial(line.device, line.baud, timeout=0, write_timeout=0, exclusive=True)
    return port


def _reason(error: OSError) -> str:
    """What the system says; pyserial puts a sentence around it."""
    return os.strerror(error.errno) if error.errno else str(error)
