"""Inputs as JSON, by either of two encoders: read back to the bit."""

from __future__ import annotations

import dataclasses
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.signals import PlanTimings
from fsw.log import json_codec
from fsw.log.encoder import LogEncoder
from fsw.log.json_codec import JsonCodec
from tests.fsw.link.snapshots import PLAN, VEHICLE


@dataclasses.dataclass(frozen=True)
class Anything:
    numbers: tuple[float, ...]
    whole: int
    text: str
    perhaps: float | None


@dataclasses.dataclass(frozen=True)
class Repeated:
    one: Anything


@given(
    st.builds(
        Anything,
        st.lists(st.floats()).map(tuple),
        st.integers(-(2**70), 2**70),
        st.text(st.characters(codec="utf-8")) | st.text(st.characters(max_codepoint=0x7F)),
        st.none() | st.floats(),
    )
)
def test_what_is_written_is_read_to_the_bit_and_is_ascii(one: Anything) -> None:
    codec = JsonCodec(Anything)
    for name in codec.names:
        text = codec.encode(name, getattr(one, name))
        assert text.isascii()
        assert min(text) >= 0x20, "a control character"
        assert repr(codec.decode(name, text)) == repr(getattr(one, name))


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1).map(tuple))
def test_finite_numbers_are_those_of_the_standard_library(numbers: tuple[float, ...]) -> None:
    text = JsonCodec(Anything).encode("numbers", numbers)
    assert repr(json.loads(text)) == repr(list(numbers))


def test_a_name_that_is_there_twice_is_refused() -> None:
    codec = JsonCodec(Repeated)
    with pytest.raises(ValueError, match="input one cannot be read: has 'whole' 2 times"):
        codec.decode("one", b'{"numbers":[],"whole":1,"whole":2,"text":"","perhaps":null}')


@pytest.mark.parametrize("measured", [True, False], ids=["real time", "lockstep"])
def test_a_plan_is_written_by_the_fast_encoder(
    measured: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The tick that a plan comes in has the most to write."""
    encoder = LogEncoder(measured=measured, airframe=VEHICLE)
    monkeypatch.delattr(json_codec, "_ENCODER")
    text = encoder.inputs.encode("plan", PLAN)
    times = PLAN.timings if measured else PlanTimings(-1.0, -1.0, -1.0)
    assert encoder.inputs.decode("plan", text) == dataclasses.replace(PLAN, timings=times)
