"""Both processes of a flight, and a network between them that misbehaves."""

from __future__ import annotations

import json
import os
import random
import selectors
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from messages.frames import split

HIL_ACTUATOR_CONTROLS = 93


def free_port() -> int:
    """A UDP port of this machine that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class SystemProcess:
    """``python -m sitl`` or ``python -m fsw`` and its events."""

    def __init__(self, module: str, *arguments: str) -> None:
        self.name = module
        self.events: list[dict[str, Any]] = []
        if module == "fsw" and "--api" not in arguments:
            # The programs' port is for the tests of a program.
            arguments = (*arguments, "--api", "none")
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, *arguments, "--events", "json"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )

    def wait_for(self, event: str, patience_s: float = 60.0) -> dict[str, Any]:
        """Read events until one of this name."""
        assert self.process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self.process.stdout, selectors.EVENT_READ)
            until = time.monotonic() + patience_s
            while time.monotonic() < until:
                if not selector.select(timeout=0.1):
                    continue
                line = self.process.stdout.readline()
                if not line:
                    break
                self.events.append(json.loads(line))
                if self.events[-1]["event"] == event:
                    return self.events[-1]
        raise AssertionError(f"no {event!r} in {self.events}, {self.errors()}")

    def finish(self, patience_s: float = 30.0) -> int:
        """Wait for the end; returns the exit code."""
        assert self.process.stdout is not None
        code = self.process.wait(timeout=patience_s)
        self.events += [json.loads(line) for line in self.process.stdout.readlines()]
        return code

    def errors(self) -> str:
        """Standard error of a process that has ended."""
        assert self.process.stderr is not None
        return self.process.stderr.read().decode() if self.process.poll() is not None else ""

    def signal(self, number: signal.Signals) -> None:
        """Send a signal."""
        self.process.send_signal(number)

    def __enter__(self) -> SystemProcess:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        for pipe in (self.process.stdout, self.process.stderr):
            assert pipe is not None
            pipe.close()


@dataclass
class Misbehaviour:
    """Shares of datagrams that the network loses, doubles or delivers too late."""

    lost: float = 0.0
    doubled: float = 0.0
    late: float = 0.0
    random: random.Random = field(default_factory=lambda: random.Random(11))


class Network:
    """Relays between fsw, which connects to this port, and sitl; records the traffic."""

    def __init__(self, simulator_port: int, misbehaviour: Misbehaviour) -> None:
        self.to_fsw: list[bytes] = []  # as sitl sent it
        self.to_sitl: list[bytes] = []  # as fsw sent it
        self.dropped = 0
        self._misbehaviour = misbehaviour
        self._vehicle_side = self._socket()
        self._simulator_side = self._socket()
        self._simulator_side.connect(("127.0.0.1", simulator_port))
        self._vehicle: Any = None
        self._held: dict[bool, list[bytes]] = {True: [], False: []}
        self.port = int(self._vehicle_side.getsockname()[1])
        self._closing = False
        self._thread = threading.Thread(target=self._forward, daemon=True)
        self._thread.start()

    @staticmethod
    def _socket() -> socket.socket:
        side = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        side.bind(("127.0.0.1", 0))
        return side

    def close(self) -> None:
        """Stop forwarding."""
        self._closing = True
        self._thread.join()
        self._vehicle_side.close()
        self._simulator_side.close()

    def _forward(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._vehicle_side, selectors.EVENT_READ)
            selector.register(self._simulator_side, selectors.EVENT_READ)
            while not self._closing:
                for key, _ in selector.select(timeout=0.05):
                    self._pass_on(key.fileobj is self._vehicle_side)

    def _pass_on(self, from_vehicle: bool) -> None:
        try:
            if from_vehicle:
                datagram, self._vehicle = self._vehicle_side.recvfrom(4096)
                self.to_sitl.append(datagram)
            else:
                datagram = self._simulator_side.recv(4096)
                self.to_fsw.append(datagram)
        except ConnectionRefusedError:
            return
        bad, held = self._misbehaviour, self._held[from_vehicle]
        dice = bad.random.random()
        if dice < bad.lost:
            self.dropped += 1
        elif dice < bad.lost + bad.late:
            held.append(datagram)
        else:
            copies = 2 if dice > 1.0 - bad.doubled else 1
            for _ in range(copies):
                self._send(from_vehicle, datagram)
            while held:
                self._send(from_vehicle, held.pop())

    def _send(self, from_vehicle: bool, datagram: bytes) -> None:
        try:
            if from_vehicle:
                self._simulator_side.send(datagram)
            elif self._vehicle is not None:
                self._vehicle_side.sendto(datagram, self._vehicle)
        except ConnectionRefusedError:
            pass


@dataclass
class Capture:
    """One flight through a network."""

    sitl_exit: int
    fsw_exit: int
    result: dict[str, Any]
    fsw_json: dict[str, Any]
    to_fsw: list[bytes]
    to_sitl: list[bytes]
    dropped: int
    warned: list[str]  # by the flight software, on the console

    def actuators(self) -> dict[int, tuple[float | bytes, ...]]:
        """Actuator commands by step time; a repeated one must be the same."""
        stream: dict[int, tuple[float | bytes, ...]] = {}
        for datagram in self.to_sitl:
            for frame in split(datagram):
                if frame.message_id == HIL_ACTUATOR_CONTROLS:
                    t_us = int(frame.payload_values[0])
                    assert stream.setdefault(t_us, frame.payload_values) == frame.payload_values
        return stream


def fly_through(
    misbehaviour: Misbehaviour, out: Path, *sitl_arguments: str, scenario: str = "walls"
) -> Capture:
    """Fly a scenario with a network in between."""
    gcs = f"udp:127.0.0.1:{free_port()}"
    with SystemProcess("sitl", scenario, "--listen", "udp:127.0.0.1:0", *sitl_arguments) as sitl:
        port = sitl.wait_for("listening")["port"]
        network = Network(port, misbehaviour)
        sim = f"udp:127.0.0.1:{network.port}"
        with SystemProcess(
            "fsw", "--sim", sim, "--gcs", gcs, "--out", str(out), "--wait", "90"
        ) as fsw:
            ended = sitl.wait_for("ended", patience_s=90.0)
            codes = sitl.finish(), fsw.finish()
        network.close()
    fsw_json = json.loads((out / "fsw.json").read_text())
    warned = [event["message"] for event in fsw.events if event["event"] == "text"]
    return Capture(
        *codes, ended["result"], fsw_json, network.to_fsw, network.to_sitl, network.dropped, warned
    )
