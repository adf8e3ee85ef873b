"""What tests of pages in a browser share."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image

from docs.figures.browser import Page, chromium
from view.page import Server

IN_A_BROWSER = [
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
