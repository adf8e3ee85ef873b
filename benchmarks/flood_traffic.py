"""Traffic that no vehicle should act on, at a steady rate; a process of its own.

Four fifths are no frames at all: random bytes, truncated, bit-flipped and wrong-CRC frames, from
many sockets. One fifth are valid frames that ask for nonsense, from one socket.
"""

from __future__ import annotations

import math
import random
import signal
import socket
import sys
import time
from collections.abc import Callable
from typing import Final

from messages.frames import FrameWriter, as_version_1, split

SYSTEM: Final = 66  # of the flood; its component too
_POOL: Final = 2000  # different datagrams of each kind, made before the flood
_BURST_S: Final = 0.002
_GARBAGE_SOCKETS: Final = 8
_NAN: Final = math.nan

_ARM, _FORCED, _SET_MODE, _TAKEOFF, _SET_INTERVAL = 400, 21196.0, 176, 22, 511  # MAV_CMD
_COMMAND_LONG, _COMMAND_INT, _PARAM_SET = 76, 75, 23
_POSITION_TARGET, _ATTITUDE_TARGET, _END_EFFECTOR_TARGET, _WALL = 84, 82, 60202, 60207


def _of_either_version(frame: bytes, chance: random.Random) -> bytes:
    return (as_version_1(frame) if chance.random() < 0.5 else None) or frame


def dangerous(writer: FrameWriter, chance: random.Random) -> bytes:
    """A frame that would hurt if it were believed after it has been damaged."""
    numbers = chance.choice(
        (
            (0.0, _FORCED, *(0.0,) * 5, _ARM, 1, 1, 0),  # forced disarm in flight
            (1.0, 4.0, 6.0, *(0.0,) * 4, _SET_MODE, 1, 1, 0),  # land
            (30.0, 1e6, *(0.0,) * 5, _SET_INTERVAL, 1, 1, 0),  # attitude once a second
        )
    )
    return _of_either_version(writer.frame(_COMMAND_LONG, *numbers), chance)


def noise(writer: FrameWriter, chance: random.Random) -> bytes:
    """Random bytes, two thirds of them behind a start marker of MAVLink 2 or 1."""
    marker = chance.choice((b"\xfd", b"\xfe", b""))
    return marker + chance.randbytes(chance.randrange(1, 280))


def truncated(writer: FrameWriter, chance: random.Random) -> bytes:
    """The beginning of a frame."""
    frame = dangerous(writer, chance)
    return frame[: chance.randrange(1, len(frame))]


def flipped(writer: FrameWriter, chance: random.Random) -> bytes:
    """A frame with one to three bits the other way round; never a valid one."""
    while True:
        frame = bytearray(dangerous(writer, chance))
        for _ in range(chance.randrange(1, 4)):
            frame[chance.randrange(len(frame))] ^= 1 << chance.randrange(8)
        if not split(bytes(frame)):
            return bytes(frame)


def wrong_crc(writer: FrameWriter, chance: random.Random) -> bytes:
    """A whole frame with another checksum."""
    frame = dangerous(writer, chance)
    checksum = int.from_bytes(frame[-2:], "little") ^ chance.randrange(1, 1 << 16)
    return frame[:-2] + checksum.to_bytes(2, "little")


def out_of_range(writer: FrameWriter, chance: random.Random) -> bytes:
    """A valid frame that asks for what cannot be."""
    wild = chance.choice((_NAN, math.inf, -math.inf, 1e30, -1e30))
    nothing = (0.0,) * 4
    name = b"MIS_TAKEOFF_ALT"
    message_id, values = chance.choice(
        (
            (_COMMAND_LONG, (wild, 0.0, *nothing, 0.0, _ARM, 1, 1, 0)),
            (_COMMAND_LONG, (*nothing, 0.0, 0.0, 1e30, _TAKEOFF, 1, 1, 0)),
            (_COMMAND_LONG, (1.0, 77.0, wild, *nothing, _SET_MODE, 1, 1, 0)),
            (_COMMAND_LONG, (wild, wild, *nothing, 0.0, _SET_INTERVAL, 1, 1, 0)),
            (_COMMAND_LONG, (0.0, _FORCED, *nothing, 0.0, _ARM, 9, 1, 0)),  # another vehicle's
            (_COMMAND_INT, (wild, *nothing[:3], 2**31 - 1, -(2**31), 0.0, _ARM, 1, 1, 0, 0, 0)),
            (_PARAM_SET, (wild, 1, 1, name, 9)),
            (_POSITION_TARGET, (0, *(wild,) * 11, 0, 1, 1, 1)),
            (_ATTITUDE_TARGET, (0, *(wild,) * 4, *nothing[:3], wild, 1, 1, 0)),
            (_END_EFFECTOR_TARGET, (2**40, *(wild,) * 11, 0, 1, 1, 1, wild)),
            (_END_EFFECTOR_TARGET, (2**40, *(0.0,) * 11, 0, 1, 1, 99, 0.0)),  # no such frame
            (_WALL, (0.0, 0.0, 0.0, wild, -1.0, 1, 1, 0, 1, 0)),
        )
    )
    return _of_either_version(writer.frame(message_id, *values), chance)


KINDS: Final[tuple[Callable[[FrameWriter, random.Random], bytes], ...]] = (
    noise,
    truncated,
    flipped,
    wrong_crc,
    out_of_range,
)


class Flood:
    """The traffic, made beforehand so that sending is all the work that is left."""

    def __init__(self, seed: int) -> None:
        chance, writer = random.Random(seed), FrameWriter(SYSTEM, SYSTEM)
        self._pools = [[kind(writer, chance) for _ in range(_POOL)] for kind in KINDS]

    def send(self, port: int, rate_hz: float, duration_s: float) -> tuple[int, int]:
        """Send until the time is over.

        Args:
            port: Of the vehicle, on this machine.
            rate_hz: Datagrams a second.
            duration_s: How long.

        Returns:
            How many were sent, and how many of these were valid frames.
        """
        valid, *garbage = (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(1 + _GARBAGE_SOCKETS)
        )
        vehicle = ("127.0.0.1", port)
        begin = time.monotonic()
        sent = sent_valid = 0
        while (elapsed := time.monotonic() - begin) < duration_s:
            for number in range(sent, int(elapsed * rate_hz)):
                kind = number % len(KINDS)
                datagram = self._pools[kind][number // len(KINDS) % _POOL]
                if kind == len(KINDS) - 1:
                    valid.sendto(datagram, vehicle)
                    sent_valid += 1
                else:
                    garbage[number % _GARBAGE_SOCKETS].sendto(datagram, vehicle)
                sent += 1
            time.sleep(_BURST_S)
        for one in (valid, *garbage):
            one.close()
        return sent, sent_valid


if __name__ == "__main__":
    # Its parent ends it; a Ctrl-C at the terminal is for the flight.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    traffic = Flood(seed=1)
    words = sys.stdin.readline().split()
    if words:
        port, rate_hz, duration_s = words
        print(*traffic.send(int(port), float(rate_hz), float(duration_s)))
