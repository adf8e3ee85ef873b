"""Where on Earth the local frame begins, from the command line to the vehicle."""

from __future__ import annotations

import pytest

from command_line.options import as_words, read
from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN
from fsw.autopilot.signals import Origin
from fsw.link.link_choice import LinkChoice, parse_origin


def chosen(*words: str) -> LinkChoice:
    return read(LinkChoice, "test", "Links.", list(words))


def test_an_origin_is_latitude_longitude_altitude() -> None:
    assert chosen("--origin=-33.5,151.25,12").origin == Origin(-33.5, 151.25, 12.0)
    assert chosen().origin == DEFAULT_ORIGIN


def test_the_words_for_the_other_process_mean_the_same_origin() -> None:
    choice = chosen("--origin=-33.123456789012,151.25,12")
    assert chosen(*as_words(choice)).origin == choice.origin


@pytest.mark.parametrize("text", ["", "48,11", "48,11,x", "90,11,0", "nan,11,0", "48,181,0"])
def test_what_is_no_place_is_refused_in_one_sentence(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ValueError, match="origin"):
        parse_origin(text)
    with pytest.raises(SystemExit) as stop:
        chosen(f"--origin={text}")
    assert stop.value.code == 2
    assert capsys.readouterr().err.count("origin") >= 1
