"""``pandion dialect``: other programs understand the private messages."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from fsw.link.telemetry.streams import STREAMS
from messages import dialect
from messages.frames import FrameWriter
from tests.cli.command import environment, one_sentence, pandion
from tests.fsw.link.snapshots import CONTEXT, outputs_at

PRIVATE = {id_: message.msgname for id_, message in dialect.mavlink_map.items() if id_ > 60199}
PORT = 14550


def capture(path: Path) -> list[str]:
    """What the vehicle sends within a second, as a capture of UDP; returns the messages' names."""
    snapshot = outputs_at(1_000_000).snapshot
    writers = {component: FrameWriter(1, component) for component in (1, 25)}
    written = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 262144, 1)
    names = []
    for stream in STREAMS:
        values = stream.encode(snapshot, CONTEXT)
        assert values is not None
        payload = writers[stream.component].frame(stream.message_id, *values)
        udp = struct.pack(">HHHH", 40000, PORT, 8 + len(payload), 0) + payload
        ip = struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0)
        packet = bytes(12) + b"\x08\x00" + ip + bytes((127, 0, 0, 1)) * 2 + udp
        written += struct.pack("<IIII", 0, 0, len(packet), len(packet)) + packet
        names.append(dialect.mavlink_map[stream.message_id].msgname)
    path.write_bytes(written)
    return names


def test_the_definition_is_printed(tmp_path: Path) -> None:
    printed = pandion("dialect", "xml", cwd=tmp_path).stdout
    names = {message.get("name") for message in ET.fromstring(printed).iter("message")}
    assert set(PRIVATE.values()) <= names
    path = pandion("dialect", "xml", "--path", cwd=tmp_path).stdout.strip()
    assert Path(path).read_text(encoding="utf-8").strip() == printed.strip()


def test_pymavlink_makes_a_dialect_of_what_is_installed(tmp_path: Path) -> None:
    reported = pandion("dialect", "install", "--out", "definitions", cwd=tmp_path)
    assert reported.returncode == 0
    folder = tmp_path / "definitions"
    assert f"MDEF={folder} mavproxy.py --dialect=pandion" in reported.stdout
    # mavutil would write into the installed pymavlink; mavgen is what it calls.
    made = tmp_path / "pandion.py"
    mavgen = [sys.executable, "-m", "pymavlink.tools.mavgen", "--wire-protocol=2.0"]
    subprocess.run(
        [*mavgen, "--lang=Python3", "-o", str(made), str(folder / "v1.0" / "pandion.xml")],
        check=True,
        capture_output=True,
    )
    code = f"import pandion as p; print(sorted(i for i in p.mavlink_map if i in {set(PRIVATE)}))"
    found = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, check=True, capture_output=True, text=True
    )
    assert found.stdout.strip() == str(sorted(PRIVATE))


def test_the_place_is_the_user_s_if_none_is_named(tmp_path: Path) -> None:
    home = {**environment(), "HOME": str(tmp_path), "XDG_DATA_HOME": ""}
    for what in ("install", "wireshark"):
        command = [sys.executable, "-m", "pandion", "dialect", what]
        subprocess.run(command, env=home, check=True, capture_output=True)
    place = tmp_path / ".local"
    assert (place / "share/pandion/message_definitions/v1.0/pandion.xml").exists()
    assert (place / "lib/wireshark/plugins/pandion.lua").exists()


@pytest.mark.parametrize("what", ["install", "wireshark"])
def test_a_place_that_cannot_be_written_is_said(tmp_path: Path, what: str) -> None:
    (tmp_path / "file").write_text("")
    refused = pandion("dialect", what, "--out", "file", cwd=tmp_path)
    assert refused.returncode == 2
    assert "cannot write" in refused.stderr
    assert one_sentence(refused.stderr)


def test_the_wireshark_plugin_names_every_private_message(tmp_path: Path) -> None:
    pandion("dialect", "wireshark", "--out", "plugins", cwd=tmp_path)
    plugin = (tmp_path / "plugins" / "pandion.lua").read_text(encoding="utf-8")
    named = dict(re.findall(r"\[(\d+)\] = '(\w+)'", plugin))
    assert {id_: named.get(str(id_)) for id_ in PRIVATE} == PRIVATE
    assert 'DissectorTable.get("udp.port"):add(14540, mavlink_proto)' in plugin


@pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")
def test_tshark_shows_what_the_vehicle_sends(tmp_path: Path) -> None:
    sent = capture(tmp_path / "flight.pcap")
    pandion("dialect", "wireshark", "--out", ".", cwd=tmp_path)
    tshark = ["tshark", "-r", "flight.pcap", "-X", "lua_script:pandion.lua", "-V"]
    shown = subprocess.run(tshark, cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert re.findall(r"^ +Message id: (\w+) ", shown, re.M) == sent
    assert "Malformed" not in shown
