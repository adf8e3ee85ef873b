"""The page of a log in a real browser: Chromium, without a window; `make test-long` runs it."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import websockets.exceptions
from websockets.sync.client import connect

from docs.figures.browser import Page, page
from tests.cli.command import PANDION, environment
from tests.processes.both_processes import free_port
from tests.view.browsing import (
    IN_A_BROWSER,
    PATIENCE_S,
    SIZE,
    TIME,
    assert_clean,
    eventually,
    picture,
)
from view.log_flight import LogFlight
from view.log_page import LogPage
from view.page import Server, address, open_server

pytestmark = IN_A_BROWSER


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
    port = where.rsplit(":", 1)[1]
    with pytest.raises(websockets.exceptions.InvalidStatus, match="403"):
        connect(where, origin=f"http://elsewhere.example:{port}", subprotocols=["viser-v0.0.0"])
