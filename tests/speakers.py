"""Vehicles of a test, each in a thread of its own, and one that never pauses."""

from __future__ import annotations

import contextlib
import socket
import threading

from messages import message_ids as ids
from messages.frames import FrameWriter


class Speaker:
    """Speaks over a socket, in a thread of its own, until it is closed."""

    def __init__(self, own: socket.socket) -> None:
        own.settimeout(0.1)
        self.socket, self._ended = own, False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._ended = True
        self._thread.join()
        self.socket.close()

    def _run(self) -> None:
        raise NotImplementedError


class Flood(Speaker):
    """A vehicle at the end of a TCP connection that never pauses."""

    def __init__(self) -> None:
        super().__init__(socket.create_server(("127.0.0.1", 0)))
        self.address = f"tcp:127.0.0.1:{self.socket.getsockname()[1]}"

    def _run(self) -> None:
        writer = FrameWriter(1, 1)
        said = b"".join(writer.frame(ids.ATTITUDE, 1000 + k, *(0.1,) * 6) for k in range(400)) * 100
        while not self._ended:
            with contextlib.suppress(TimeoutError, ConnectionError):
                peer, _ = self.socket.accept()
                with peer:
                    self._say(peer, said)

    def _say(self, peer: socket.socket, said: bytes) -> None:
        peer.settimeout(0.2)
        while not self._ended:
            with contextlib.suppress(TimeoutError):
                peer.sendall(said)
