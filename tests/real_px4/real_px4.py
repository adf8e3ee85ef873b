"""A real PX4: its process, its operator, the plant under it and the planner above it."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.link.px4.arm import servo_ranges
from fsw.link.px4.messages import shares_of
from messages.frames import Frame, FrameWriter, split

BUILD = os.environ.get("PX4_BUILD", "")
NO_BUILD = "PX4_BUILD does not name a folder with bin/px4 and etc: a build of PX4's SITL"
HOLD, OFFBOARD, LAND = (4, 3), (6, 0), (4, 6)
ARM, SET_MODE, TAKEOFF, SET_ACTUATOR = 400, 176, 22, 187
ORIGIN = (473977420, 85455940, 488000)  # of `pandion px4 params`
COMPANION, ARM_LINK = "udp:127.0.0.1:14580", "udp:127.0.0.1:14582"
# Nobody holds sticks, and a lost stream is to end in Hold.
WITHOUT_RADIO = {"COM_RC_IN_MODE": 4, "COM_OBL_RC_ACT": 5, "NAV_DLL_ACT": 0, "COM_RCL_EXCEPT": 7}


def there_is_one() -> bool:
    return bool(BUILD) and (Path(BUILD) / "bin" / "px4").exists()


@dataclass
class Operator:
    """A ground station of PX4."""

    mode: tuple[int, int] = (0, 0)
    armed: bool = False
    landed: bool = True
    p: tuple[float, ...] = (0.0, 0.0, 0.0)
    t_s: float = 0.0  # since PX4 has started, by its own clock
    texts: list[str] = field(default_factory=list)
    acks: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.setblocking(False)
        self.writer = FrameWriter(255, 190)
        self.beat_s = 0.0

    def send(self, message: int, *values: float) -> None:
        self.socket.sendto(self.writer.frame(message, *values), ("127.0.0.1", 18570))

    def command(self, number: int, *params: float) -> None:
        self.send(76, *params, *(0.0,) * (7 - len(params)), number, 1, 1, 0)

    def poll(self) -> None:
        if time.monotonic() - self.beat_s > 0.5:
            self.beat_s = time.monotonic()
            self.send(0, 0, 6, 8, 0, 4, 3)
        while True:
            try:
                data = self.socket.recv(4096)
            except OSError:
                return
            for frame in split(data):
                if (frame.system_id, frame.component_id) == (1, 1):
                    self._hear(frame)

    def _hear(self, frame: Frame) -> None:
        values = cast("tuple[Any, ...]", frame.payload_values)
        if frame.message_id == 0:
            self.armed = bool(values[3] & 128)
            self.mode = (values[0] >> 16 & 0xFF, values[0] >> 24 & 0xFF)
        elif frame.message_id == 245:
            self.landed = values[1] <= 1
        elif frame.message_id == 32:
            self.t_s, self.p = 1e-3 * values[0], values[1:4]
        elif frame.message_id == 77:
            self.acks.append((values[0], values[1]))
        elif frame.message_id == 253:
            self.texts.append(values[1].rstrip(b"\0").decode("utf-8", "replace"))

    def until(self, reached: Any, seconds: float, again: Any = lambda: None) -> bool:
        """Wait for something, asking ``again`` once a second."""
        end_s = time.monotonic() + seconds
        asked_s = 0.0
        while time.monotonic() < end_s:
            if time.monotonic() - asked_s > 1.0:
                asked_s = time.monotonic()
                again()
            self.poll()
            if reached():
                return True
            time.sleep(0.01)
        return False

    def wait(self, seconds: float) -> None:
        """Let PX4's time pass, at most ten times as long by the wall's."""
        end_s = self.t_s + seconds
        self.until(lambda: self.t_s >= end_s, 10.0 * seconds)

    def set_origin(self) -> None:
        self.send(48, *ORIGIN, 1, 0)

    def set_mode(self, mode: tuple[int, int]) -> None:
        self.command(SET_MODE, 1.0, float(mode[0]), float(mode[1]))

    def take_off(self, metres: float) -> None:
        """Arm and climb, from a PX4 that has just started."""
        assert self.until(lambda: self.mode != (0, 0), 60.0), "PX4 is not heard"
        self.set_origin()
        climb = ORIGIN[2] * 1e-3 + metres
        nan = float("nan")
        assert self.until(
            lambda: self.armed, 90.0, lambda: (self.set_origin(), self.command(ARM, 1.0))
        ), self.texts[-5:]
        self.command(TAKEOFF, nan, nan, nan, nan, nan, nan, climb)
        assert self.until(lambda: not self.landed and self.p[2] < -0.5 * metres, 60.0)
        assert self.until(lambda: self.p[2] < -metres + 0.25, 60.0), self.p
        self.set_mode(HOLD)
        assert self.until(lambda: self.mode == HOLD, 10.0)

    def fold(self) -> None:
        """Bring the arm to its home posture, from where plans begin."""
        joints = AIRFRAME.bodies.joints
        shares = shares_of(servo_ranges(AIRFRAME), tuple(AIRFRAME.home_posture[:joints]))
        for _ in range(4):
            self.move_joints(shares)
            self.wait(1.0)

    def move_joints(self, shares: tuple[float, ...]) -> None:
        """Send servos to shares of their ranges."""
        self.command(SET_ACTUATOR, *shares, *(float("nan"),) * (6 - len(shares)))

    def give(self) -> bool:
        """Give the vehicle to the planner; whether PX4 accepts it."""
        return self.until(lambda: self.mode == OFFBOARD, 20.0, lambda: self.set_mode(OFFBOARD))


@contextmanager
def started(command: list[str], log: Path, **more: Any) -> Iterator[subprocess.Popen[bytes]]:
    with log.open("wb") as out:
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, **more)
        try:
            yield process
        finally:
            process.terminate()
            try:
                process.wait(10.0)
            except subprocess.TimeoutExpired:
                process.kill()


@dataclass
class Loop:
    operator: Operator
    sitl: subprocess.Popen[bytes]
    px4: subprocess.Popen[bytes]
    fsw: subprocess.Popen[bytes] | None
    folder: Path

    def result(self) -> dict[str, Any]:
        """Of the plant, which ends now."""
        self.sitl.terminate()
        self.sitl.wait(20.0)
        return cast("dict[str, Any]", json.loads((self.folder / "sitl.json").read_text()))

    def said(self, who: str) -> str:
        return (self.folder / f"{who}.log").read_text(errors="replace")


@contextmanager
def flying(
    scenario: str,
    folder: Path,
    *,
    seed: int = 0,
    speed: str = "1",
    planner: tuple[str, ...] | None = (),
    seconds: float = 600.0,
    sensors: str = "mocap",
    px4: dict[str, float] | None = None,
) -> Iterator[Loop]:
    """The plant under a PX4 that has just started; with ``planner`` options, our planner above."""
    pandion = [sys.executable, "-m", "pandion"]
    plant = [scenario, "--sensors", sensors]
    with ExitStack() as stack:
        beside = ["--companion", ARM_LINK] if planner is not None else []
        sitl = stack.enter_context(
            started(
                [*pandion, "sitl", *plant, "--for", "px4", "--seed", str(seed), "--speed", speed,
                 "--duration", str(seconds), "--out", str(folder), *beside],
                folder / "sitl.log",
            )
        )  # fmt: skip
        lines = subprocess.run(
            [*pandion, "px4", "env", *plant], capture_output=True, text=True, check=True
        ).stdout.split()
        told = {f"PX4_PARAM_{k}": str(v) for k, v in {**WITHOUT_RADIO, **(px4 or {})}.items()}
        environment = {**os.environ, **dict(one.split("=", 1) for one in lines), **told}
        _until_said(folder / "sitl.log", "ready", 240.0)
        root = str(folder / "px4")  # its log stays there
        Path(root).mkdir()
        build = Path(BUILD).resolve()
        flown = stack.enter_context(
            started(
                [str(build / "bin" / "px4"), "-d", str(build / "etc"), "-w", root],
                folder / "px4.log", env=environment, cwd=root,
            )
        )  # fmt: skip
        fsw = None
        if planner is not None:
            fsw = stack.enter_context(
                started(
                    [*pandion, "fsw", "--autopilot-link", COMPANION, "--arm-link", ARM_LINK,
                     "--arm-servos", "--out", str(folder / "fsw"), "--wait", "300", *planner],
                    folder / "fsw.log",
                )
            )  # fmt: skip
            _until_said(folder / "fsw.log", "looking for PX4", 900.0)
        yield Loop(Operator(), sitl, flown, fsw, folder)


def _until_said(log: Path, what: str, seconds: float) -> None:
    end_s = time.monotonic() + seconds
    while time.monotonic() < end_s:
        if log.exists() and what in log.read_text(errors="replace"):
            return
        time.sleep(0.2)
    raise AssertionError(f"{log.name} did not say {what!r}: {log.read_text(errors='replace')}")
