"""The live page in a real browser: Chromium, without a window; `make test-long` runs it."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from docs.figures.browser import Page, page
from fsw.autopilot.model.airframe import AIRFRAME
from tests.interop.vehicle import standing_vehicle
from tests.processes.both_processes import free_port
from tests.view.browsing import (
    ANSWER,
    IN_A_BROWSER,
    PATIENCE_S,
    SIZE,
    TIME,
    assert_clean,
    eventually,
)
from view.live_link import VehicleLink
from view.live_page import LivePage
from view.page import Server, address, open_server
from view.vehicle import tip_of

pytestmark = IN_A_BROWSER


@pytest.fixture(scope="module")
def live(
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[tuple[Page, Server, VehicleLink]]:
    folder = tmp_path_factory.mktemp("live")
    with standing_vehicle(folder, "--lockstep", "--speed", "1") as vehicle:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
            station.bind(("127.0.0.1", vehicle.gcs_port))
            station.settimeout(10.0)
            _, where = station.recvfrom(2048)
        link = VehicleLink(where, AIRFRAME, commands=True)
        link.start()
        server = open_server("127.0.0.1", free_port(), "a vehicle")
        shown = LivePage(server, link)
        with page(*SIZE) as browser:
            browser.open(address(server))
            browser.wait_for(TIME, PATIENCE_S)
            yield browser, server, link
        shown.close()
        link.close()
        server.stop()


def test_a_refused_command_shows_its_reason(live: tuple[Page, Server, VehicleLink]) -> None:
    browser, _, _ = live
    browser.press_on("Command")
    browser.press_on("Return")
    said = browser.wait_for(ANSWER, PATIENCE_S)
    assert said.startswith("NAV_RETURN_TO_LAUNCH")
    assert "no reason" not in said
    assert len(said.partition(": ")[2]) > 10, said


def test_dragging_the_gizmo_moves_the_target(live: tuple[Page, Server, VehicleLink]) -> None:
    browser, server, link = live
    browser.press_on("Take off")
    eventually(lambda: (now := link.scene().estimate) is not None and now.p[2] < -1.0)
    eventually(lambda: link.scene().mode == "hold")
    browser.press_on("drag its target")
    eventually(lambda: link.scene().mode == "offboard")
    before = eventually(lambda: link.scene().target)
    posture = link.scene().estimate
    assert posture is not None
    tip = np.array(tip_of(posture, AIRFRAME))
    (client,) = server.get_clients().values()
    begin, end = (seen(browser, client.camera, tip + along) for along in ARROW)
    browser.drag(begin, end)
    target = eventually(
        lambda: (
            (now := link.scene().target) is not None
            and np.linalg.norm(np.subtract(now, before)) > 0.05
            and now
        )
    )
    assert abs(target[1] - before[1]) > 0.05, "the arrow to the east moves it east or west"


def test_an_obstacle_that_is_added_is_kept_and_shown(
    live: tuple[Page, Server, VehicleLink],
) -> None:
    browser, _, link = live
    browser.press_on("Add a ball")
    safe_set = eventually(lambda: link.scene().safe_set)
    (zone,) = eventually(lambda: (now := link.scene().safe_set) is not None and now.zones)
    assert (zone.shape.kind, zone.shape.numbers[0]) == ("ball", 1.0), safe_set


ARROW = (np.array((0.0, 0.25, 0.0)), np.array((0.0, 0.65, 0.0)))  # m: on it, and where to


def seen(browser: Page, camera: Any, point: np.ndarray) -> tuple[float, float]:
    """Where a point [m, NED] is in the window [px]."""
    box = browser.value(
        "(() => { const b = document.querySelector('canvas').getBoundingClientRect();"
        " return [b.x, b.y, b.width, b.height]; })()"
    )
    w, x, y, z = camera.wxyz
    R = np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
    )
    right, down, ahead = R.T @ (point - camera.position)
    focal = 0.5 * box[3] / np.tan(0.5 * camera.fov)
    return (
        box[0] + 0.5 * box[2] + focal * right / ahead,
        box[1] + 0.5 * box[3] + focal * down / ahead,
    )


def test_a_live_page_shows_who_speaks_and_asks_nothing_of_other_hosts(
    live: tuple[Page, Server, VehicleLink],
) -> None:
    browser, server, link = live
    browser.press_on("Messages")
    browser.wait_for(
        "document.querySelector('[data-pandion=messages]').textContent.includes('BARRIER_MARGIN')"
        " || document.querySelector('[data-pandion=messages]').textContent.includes('MPC_HORIZON')",
        PATIENCE_S,
    )
    assert link.scene().horizon is not None
    assert_clean(browser, server)
