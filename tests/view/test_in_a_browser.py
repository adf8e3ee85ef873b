"""The pages in a real browser: Chromium, without a window. `make test-long` runs these."""

from __future__ import annotations

import io
import json
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
import websockets.exceptions
from PIL import Image
from websockets.sync.client import connect

from docs.figures.browser import Page, chromium, page
from tests.cli.command import PANDION, environment
from tests.interop.vehicle import standing_vehicle
from tests.processes.both_processes import free_port
from view.live_link import VehicleLink
from view.live_page import LivePage
from view.log_flight import LogFlight
from view.log_page import LogPage
from view.page import Server, address, open_server
from view.vehicle import places

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(chromium() is None, reason="no chromium on PATH: apt-get install chromium"),
]

SIZE = (1000, 640)
TIME = "document.querySelector('[data-pandion=time]')?.textContent"
ANSWER = "document.querySelector('[data-pandion=answer]')?.textContent"
PATIENCE_S = 60.0


def eventually(is_so: Callable[[], Any], patience_s: float = PATIENCE_S) -> Any:
    until_s = time.monotonic() + patience_s
    while time.monotonic() < until_s:
        if found := is_so():
            return found
        time.sleep(0.05)
    raise AssertionError("it never was so")


def picture(browser: Page, tmp_path: Path) -> np.ndarray:
    """The left part of the page, where the canvas is (rows, columns, 3)."""
    path = tmp_path / "page.png"
    browser.screenshot(path)
    whole = np.asarray(Image.open(io.BytesIO(path.read_bytes())).convert("RGB"))
    return whole[200:330, 50:550].astype(int)


def assert_clean(browser: Page, server: Server) -> None:
    """No complaint in the console, and nothing was asked of another host."""
    assert browser.complaints == []
    own = f"127.0.0.1:{server.get_port()}"
    asked = {urlsplit(one) for one in browser.requests}
    assert {one.netloc for one in asked if one.scheme not in ("data", "blob", "about")} == {own}
    assert {one.path for one in asked if one.scheme == "blob" and own not in one.path} == set()


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("flights") / "walls"
    command = [*PANDION, "fly", "walls", "--lockstep", "--duration", "20", "--out", str(out)]
    subprocess.run(command, env=environment(), check=True, stdout=subprocess.DEVNULL)
    return out


@pytest.fixture(scope="module")
def log_page(flown: Path) -> Iterator[tuple[Page, Server]]:
    server = open_server("127.0.0.1", free_port(), "a flight")
    shown = LogPage(server, LogFlight(flown))
    with page(*SIZE) as browser:
        browser.open(address(server))
        browser.wait_for(TIME, PATIENCE_S)
        yield browser, server
    shown.close()
    server.stop()


def test_a_log_is_drawn_and_moves_when_it_is_played(
    log_page: tuple[Page, Server], tmp_path: Path
) -> None:
    browser, _ = log_page
    eventually(lambda: len(np.unique(picture(browser, tmp_path).reshape(-1, 3), axis=0)) > 200)
    before, at = picture(browser, tmp_path), browser.value(TIME)
    browser.press_on("▶ play / pause")
    eventually(lambda: browser.value(TIME).split()[0] > "1" and browser.value(TIME) != at)
    time.sleep(3.0)
    browser.press_on("▶ play / pause")
    moved = np.abs(picture(browser, tmp_path) - before).max(axis=2) > 40
    assert moved.sum() > 50, "the vehicle is where it was"


def test_the_jump_to_the_worst_moment_shows_the_number_of_the_result(
    log_page: tuple[Page, Server], flown: Path
) -> None:
    browser, _ = log_page
    result = json.loads((flown / "result.json").read_text())
    judged = json.loads((flown / "sitl.json").read_text())
    worst = browser.value("document.querySelector('[data-pandion=worst]').dataset.metres")
    assert float(worst) == result["min_margin_m"]
    browser.press_on("worst margin")
    at = f"{judged['min_margin_time_s']:.2f} s"
    browser.wait_for(f"{TIME} === '{at}'", PATIENCE_S)
    now = browser.value("document.querySelector('[data-pandion=margin]').textContent")
    assert float(now.split()[0]) == pytest.approx(1e3 * result["min_margin_m"], abs=10.0)


def test_a_log_page_asks_nothing_of_other_hosts(log_page: tuple[Page, Server]) -> None:
    assert_clean(*log_page)


def test_a_page_of_another_site_cannot_reach_it(log_page: tuple[Page, Server]) -> None:
    _, server = log_page
    where = address(server).replace("http", "ws")
    with pytest.raises(websockets.exceptions.InvalidStatus, match="403"):
        connect(where, origin="http://elsewhere.example", subprotocols=["viser-v0.0.0"])


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
        link = VehicleLink(where, commands=True)
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
    tip = np.array(places(posture).tip)
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
