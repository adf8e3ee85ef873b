"""Frames in a stream of bytes: pieces, noise, cuts."""

from __future__ import annotations

import random
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from messages.frames import FrameWriter, Losses, announcing_signature, as_version_1, cut
from messages.stream_reader import StreamReader

_HEARTBEAT, _ATTITUDE, _TEXT, _PLAY_TUNE = 0, 30, 253, 400


def frames(count: int, seed: int) -> list[bytes]:
    """Frames of several kinds, some signed and some of MAVLink 1."""
    random_ = random.Random(seed)
    writer = FrameWriter(7, 190)
    made = []
    for k in range(count):
        kind = random_.randrange(4)
        if kind == 0:
            frame = writer.frame(_HEARTBEAT, random_.getrandbits(32), 6, 8, 0, 4, 3)
        elif kind == 1:
            numbers = [random_.uniform(-10.0, 10.0) for _ in range(6)]
            frame = writer.frame(_ATTITUDE, k, *numbers)
        else:
            # A text may look like the beginning of a frame.
            text = bytes(random_.choice(b"\xfd\xfe\x00\x1eabc") for _ in range(50))
            frame = writer.frame(_TEXT, random_.randrange(8), text, 0, 0)
        if kind == 3:
            frame = announcing_signature(frame) + random_.randbytes(13)
        made.append(frame)
    return made


def read(pieces: list[bytes], losses: Losses | None = None) -> list[bytes]:
    """What is read of a stream that comes in these pieces, followed by a pause."""
    reader, losses = StreamReader(), losses or Losses()
    found = [raw for piece in pieces if piece for _, raw in reader.cut(piece, losses)]
    return found + [raw for _, raw in reader.cut(b"", losses)]


def cut_at_random(stream: bytes, seed: int, most: int = 40) -> list[bytes]:
    random_, pieces, at = random.Random(seed), [], 0
    while at < len(stream):
        size = random_.randint(1, most)
        pieces.append(stream[at : at + size])
        at += size
    return pieces


@given(seed=st.integers(0, 1 << 32), most=st.sampled_from([1, 7, 40, 512]))
def test_every_frame_is_read_however_the_stream_comes(seed: int, most: int) -> None:
    sent, losses = frames(20, seed), Losses()
    assert read(cut_at_random(b"".join(sent), seed, most), losses) == sent
    assert (losses.bytes, losses.frames) == (0, 0)


@given(seed=st.integers(0, 1 << 32), most=st.sampled_from([1, 7, 40, 512]))
def test_noise_between_frames_costs_none(seed: int, most: int) -> None:
    random_, sent = random.Random(seed), frames(20, seed)
    stream = b""
    for frame in sent:
        noise = bytes(random_.choice(b"\xfd\x00\x01\x1e\x7f") for _ in range(random_.randrange(60)))
        stream += noise + frame
    losses = Losses()
    found = read(cut_at_random(stream, seed, most), losses)
    assert [raw for raw in found if raw in sent] == sent
    assert losses.bytes == len(stream) - sum(map(len, found))


@given(seed=st.integers(0, 1 << 32), most=st.sampled_from([1, 40, 512]))
def test_a_frame_that_is_cut_off_takes_no_other_with_it(seed: int, most: int) -> None:
    random_, sent = random.Random(seed), frames(20, seed)
    halves = [frame[: random_.randrange(1, len(frame))] for frame in frames(20, seed + 1)]
    stream = b"".join(half + frame for half, frame in zip(halves, sent, strict=True))
    found = read(cut_at_random(stream, seed, most))
    assert [raw for raw in found if raw in sent] == sent


@pytest.mark.parametrize("error_rate", [1e-4, 1e-3, 1e-2])
def test_with_bit_errors_every_frame_without_one_is_read(error_rate: float) -> None:
    random_, sent = random.Random(5), frames(2000, 5)
    damaged = [
        bytes(
            byte ^ (1 << random_.randrange(8)) if random_.random() < 8 * error_rate else byte
            for byte in frame
        )
        for frame in sent
    ]
    intact = [one for one, was in zip(damaged, sent, strict=True) if one == was]
    found = read(cut_at_random(b"".join(damaged), 5, 512))
    assert 100 < len(intact) < len(sent)
    assert [raw for raw in found if raw in intact] == intact


def test_a_marker_in_noise_holds_up_what_follows_only_for_a_pause() -> None:
    frame = frames(1, 0)[0]
    claim = b"\xfd\xff\x00\x00\x00\x01\x01" + _TEXT.to_bytes(3, "little")  # of 255 bytes
    reader, losses = StreamReader(), Losses()
    assert reader.cut(claim + frame, losses) == []
    assert reader.waits
    assert [raw for _, raw in reader.cut(b"", losses)] == [frame]
    assert not reader.waits
    assert (losses.bytes, losses.frames) == (len(claim), 2)  # 253, in it, is a marker as well


def test_mavlink_1_is_read_behind_noise_too() -> None:
    old = [as_version_1(frame) for frame in frames(40, 3) if not frame[2]]
    sent = [frame for frame in old if frame is not None]
    stream = b"".join(b"\x11\xfe\x22" + a + b for a, b in zip(sent[::2], sent[1::2], strict=False))
    found = read(cut_at_random(stream, 1))
    whole = sent[: len(sent) // 2 * 2]
    assert [raw for raw in found if raw in whole] == whole


def test_a_stream_means_what_its_datagrams_would() -> None:
    stream = b"".join(frames(200, 9))
    reader, losses = StreamReader(), Losses()
    assert reader.cut(stream, losses) == list(cut(stream))


def test_noise_alone_is_no_frame_and_costs_little() -> None:
    noise = random.Random(1).randbytes(200_000)
    reader, losses = StreamReader(), Losses()
    begin = time.process_time()
    found = [
        one for k in range(0, len(noise), 512) for one in reader.cut(noise[k : k + 512], losses)
    ]
    spent = time.process_time() - begin
    assert found == []
    assert spent < 0.5  # s; a line of 921,600 baud takes 2.2 s for as much


def test_markers_alone_cost_little() -> None:
    reader, losses = StreamReader(), Losses()
    claims = (b"\xfd\xff\x00\x00\x00\x01\x01\xfd\x00\x00" * 52)[:512]
    begin = time.process_time()
    for _ in range(100):
        assert reader.cut(claims, losses) == []
    assert time.process_time() - begin < 0.5
