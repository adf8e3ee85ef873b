"""The page beside a flight: served while it flies, gone when it ends."""

from __future__ import annotations

import re
import subprocess
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from tests.cli.command import PANDION, environment
from tests.processes.both_processes import free_port

pytestmark = pytest.mark.long


def page_at(address: str) -> bytes:
    """What is served there, at once: the address is not told before."""
    with urllib.request.urlopen(address, timeout=10.0) as answer:
        return bytes(answer.read())


def test_the_page_lives_as_long_as_the_flight(tmp_path: Path) -> None:
    said = tmp_path / "said.txt"
    command = [
        *(*PANDION, "fly", "ground", "--realtime", "--view", "--duration", "15", "--api", "none"),
        *(f"--gcs=udp:127.0.0.1:{free_port()}", f"--out={tmp_path / 'flight'}"),
    ]
    with said.open("wb") as output:
        flight = subprocess.Popen(command, env=environment(), stdout=output, stderr=output)
    try:
        while (found := re.search(r"view: open (\S+)", said.read_text())) is None:
            assert flight.poll() is None, said.read_text()
            time.sleep(0.2)
        address = found[1]
        assert b"<html" in page_at(address).lower()
        flight.wait(240.0)
    finally:
        flight.kill()
    assert "the view ended by itself" not in said.read_text()
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(address, timeout=5.0)
