"""Looking before sleeping: nothing is lost, patience is kept, and looking in vain stops."""

from __future__ import annotations

import socket
import struct
import time

import pytest

from messages.busy_poll import BusyPollReceiver

PATIENCE_S = 0.02


def connected() -> tuple[socket.socket, socket.socket]:
    one, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    one.setsockopt(
        socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack("ll", 0, round(PATIENCE_S * 1e6))
    )
    return one, other


def test_datagrams_come_in_order_whether_looked_for_or_slept_on() -> None:
    one, other = connected()
    receive = BusyPollReceiver(one, 100)
    for number in range(50):
        other.send(bytes([number]))
    assert [receive() for _ in range(50)] == [bytes([number]) for number in range(50)]


def test_silence_ends_with_the_sockets_patience() -> None:
    one, _other = connected()
    receive = BusyPollReceiver(one, 100)
    begin = time.perf_counter()
    with pytest.raises(BlockingIOError):
        receive()
    assert 0.9 * PATIENCE_S < time.perf_counter() - begin < 10.0 * PATIENCE_S


class Slow:
    """A socket whose datagrams come only to those who sleep."""

    def __init__(self) -> None:
        self.looks = 0

    def recv(self, _size: int, flags: int = 0) -> bytes:
        if flags & socket.MSG_DONTWAIT:
            self.looks += 1
            raise BlockingIOError
        return b"late"


def test_looking_in_vain_is_given_up_for_a_while_and_tried_again() -> None:
    slow = Slow()
    receive = BusyPollReceiver(slow, 100)  # type: ignore[arg-type]
    looked = []
    for _ in range(5520):
        before = slow.looks
        assert receive() == b"late"
        looked.append(slow.looks > before)
    assert all(looked[:10])  # a start may be slow
    assert not any(looked[10:5010])
    assert looked[5010:5013] == [True, True, False]


class LateOnceInFifty(Slow):
    """A socket of which forty-nine datagrams in fifty are there at the first look."""

    def __init__(self) -> None:
        super().__init__()
        self.received = 0

    def recv(self, size: int, flags: int = 0) -> bytes:
        if self.received % 50 == 49:
            datagram = super().recv(size, flags)
        else:
            assert flags & socket.MSG_DONTWAIT, "it has given up looking"
            datagram = b"there"
        self.received += 1
        return datagram


def test_one_late_answer_in_fifty_does_not_end_the_looking() -> None:
    receive = BusyPollReceiver(LateOnceInFifty(), 100)  # type: ignore[arg-type]
    answers = [receive() for _ in range(1000)]
    assert answers.count(b"late") == 20
