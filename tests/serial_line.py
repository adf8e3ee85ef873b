"""A serial line made of a pseudo-terminal, as slow and as noisy as a real one."""

from __future__ import annotations

import os
import random
import threading
import time
import tty
from dataclasses import dataclass, field


@dataclass
class SerialLine:
    """The far end of a line at a ``baud``; ``device`` is the name of the near end.

    Both directions are paced: in either of them a byte takes as long as on a line, and a fraction
    of the bits is wrong.
    """

    baud: int
    error_rate: float = 0.0  # of a bit
    seed: int = 0
    device: str = ""
    got: bytearray = field(default_factory=bytearray)  # what came out of the far end
    taken: int = 0  # bytes that the line has carried away
    errors: int = 0

    def __post_init__(self) -> None:
        self._random = random.Random(self.seed)
        self._to_send = bytearray()
        self._lock = threading.Lock()
        self._ended = False
        self.plug_in()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def plug_in(self) -> None:
        """Another pseudo-terminal, as an adapter that is plugged in again."""
        self._far, near = os.openpty()
        tty.setraw(near)
        os.set_blocking(self._far, False)
        self.device, self._near = os.ttyname(near), near

    def unplug(self) -> None:
        """Both ends go, as a device does."""
        with self._lock:
            os.close(self._near)
            os.close(self._far)
            self._far = -1

    def send(self, data: bytes) -> None:
        """Let the line carry this to the near end."""
        with self._lock:
            self._to_send += data

    def take(self) -> bytes:
        """What has come out of the far end."""
        with self._lock:
            data, self.got = bytes(self.got), bytearray()
        return data

    @property
    def idle(self) -> bool:
        """Whether everything that was sent has been carried."""
        with self._lock:
            return not self._to_send

    def close(self) -> None:
        self._ended = True
        self._thread.join()
        if self._far >= 0:
            self.unplug()

    def _run(self) -> None:
        out = back = 0.0
        last_s = time.perf_counter()
        while not self._ended:
            time.sleep(0.001)
            now_s = time.perf_counter()
            grown = 0.1 * self.baud * (now_s - last_s)
            last_s = now_s
            with self._lock:
                if self._far < 0:
                    continue
                out, back = min(out + grown, 4096), min(back + grown, 4096)
                out -= self._carry_out(int(out))
                back -= self._carry_back(int(back))

    def _carry_out(self, most: int) -> int:
        piece = self._noisy(bytes(self._to_send[:most]))
        if not piece:
            return most  # a line that is idle saves nothing up
        try:
            sent = os.write(self._far, piece)
        except OSError:
            return 0
        del self._to_send[:sent]
        return sent

    def _carry_back(self, most: int) -> int:
        if most == 0:
            return 0
        try:
            data = os.read(self._far, most)
        except OSError:
            return most
        self.taken += len(data)
        self.got += self._noisy(data)
        return most if len(data) < most else len(data)

    def _noisy(self, data: bytes) -> bytes:
        if not self.error_rate or not data:
            return data
        damaged = bytearray(data)
        share = 8.0 * self.error_rate
        for k in range(len(damaged)):
            if self._random.random() < share:
                damaged[k] ^= 1 << self._random.randrange(8)
                self.errors += 1
        return bytes(damaged)
