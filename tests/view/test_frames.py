"""A frame that cannot be drawn costs that frame alone, and is told once."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from scipy.spatial import QhullError

from fsw.autopilot.model.airframe import AIRFRAME
from tests.processes.both_processes import free_port
from tests.waiting import wait_for
from view import panels
from view.live_page import LivePage
from view.page import Server, open_server
from view.scene import Scene

_PATIENCE_S = 20.0


class MovingLink:
    """A link to a vehicle of which every frame is another."""

    airframe = AIRFRAME
    commands = False
    watched = False
    _t = 0.0

    def scene(self) -> Scene:
        self._t += 0.01
        return Scene(t=self._t)

    def read(self, what: Callable[[Any], Any]) -> Any:
        return what(_Telemetry())


@dataclasses.dataclass
class _Telemetry:
    events: tuple[Any, ...] = ()
    heard: dict[str, Any] = dataclasses.field(default_factory=dict)
    parameters: dict[str, float] = dataclasses.field(default_factory=dict)


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    opened = open_server("127.0.0.1", free_port(), "a vehicle")
    monkeypatch.setattr(opened, "get_clients", lambda: {0: None})
    yield opened
    opened.stop()


def test_the_live_page_goes_on_after_a_frame_that_cannot_be_drawn(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[str] = []
    html = panels.refusal_html

    def noted(sentence: str, *, good: bool = False) -> str:
        told.append(sentence)
        return html(sentence, good=good)

    monkeypatch.setattr(panels, "refusal_html", noted)
    link: Any = MovingLink()
    page = LivePage(server, link)
    drawn: list[float] = []

    def show(now: Scene) -> None:
        drawn.append(now.t)
        raise QhullError("QH6154 initial simplex is flat\nand much more\n")

    monkeypatch.setattr(page.stage, "show", show)
    until = time.monotonic() + _PATIENCE_S
    while len(drawn) < 5 and time.monotonic() < until:
        time.sleep(0.02)
    page.close()
    assert len(drawn) >= 5
    assert told == ["not drawn: QH6154 initial simplex is flat"]


def watch_three_pictures(server: Server, link: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait until the page of a ``link`` has drawn so many."""
    page = LivePage(server, link)
    drawn: list[float] = []
    monkeypatch.setattr(page.stage, "show", lambda now: drawn.append(now.t))
    wait_for(lambda: len(drawn) > 2, "pictures")
    page.close()


def test_the_live_page_goes_on_after_a_scene_that_cannot_be_made(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Doubtful(MovingLink):
        def scene(self) -> Scene:
            now = super().scene()
            if now.t < 0.05:
                raise ValueError("matmul: Input operand 1 has a mismatch")
            return now

    watch_three_pictures(server, Doubtful(), monkeypatch)


def test_a_vehicle_whose_clock_stands_is_drawn_again(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What of it is old by then is not known any more."""

    class Standing(MovingLink):
        def scene(self) -> Scene:
            return Scene(t=1.0)

    watch_three_pictures(server, Standing(), monkeypatch)
