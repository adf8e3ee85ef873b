"""Flights of the plant under the stand-in for PX4, in one process."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from command_line.process import StopRequest
from messages.addresses import TcpEnd
from messages.byte_stream import ByteStream
from sitl.earth import DEFAULT_ORIGIN
from sitl.link.px4_messages import Px4Encoder
from sitl.link.px4_server import Px4Exchange, serve_px4, wait_for_px4
from sitl.link.server import RunTiming
from sitl.scenario_file import load_scenario
from sitl.simulation import STEP_US, Simulation
from sitl.start import on_the_ground
from tests.px4_stand_in import Airframe, Connected, Operator, Px4StandIn


def wall_us() -> int:
    return time.monotonic_ns() // 1000


@dataclass
class Px4Flight:
    """What became of one flight."""

    simulation: Simulation
    stand_in: Px4StandIn
    timing: RunTiming
    exchange: Px4Exchange
    times_s: np.ndarray
    places: np.ndarray  # (n, 3) m, NED
    angles: np.ndarray  # (n, j) rad


@dataclass
class _Trace:
    rows: list[tuple[float, ...]] = field(default_factory=list)

    def add(self, simulation: Simulation) -> None:
        if simulation.step % 5 == 0:
            exact = simulation.healthy()
            self.rows.append((simulation.time_s, *exact.p_WB, *exact.q_arm))


@contextmanager
def listening() -> Iterator[tuple[ByteStream, int]]:
    with closing(ByteStream(TcpEnd("127.0.0.1", 0, listens=True), wall_us)) as stream:
        port = stream.listening_port
        assert port is not None
        yield stream, port


def airframe(simulation: Simulation) -> Airframe:
    vehicle = simulation.vehicle
    return Airframe(
        mass=vehicle.mass,
        inertia=vehicle.base.inertia[:3],
        arm=vehicle.rotors[2].position[0],
        yaw_ratio=vehicle.rotors[0].torque_per_thrust,
        thrust_max=vehicle.rotors[0].thrust_max,
        joints=len(vehicle.joints),
    )


def fly(
    scenario: str,
    operator: Operator,
    *,
    suite: str = "mocap",
    seconds: float = 10.0,
    rate_hz: int = 250,
    seed: int = 0,
    skipped: int = 10,
) -> Px4Flight:
    """Fly a scenario from the ground under the stand-in."""
    flown = replace(load_scenario(scenario, suite), duration_s=seconds)
    simulation = Simulation(on_the_ground(flown), seed)
    stand_in = Px4StandIn(airframe(simulation), operator, skipped=skipped)
    stop, trace = StopRequest(), _Trace()
    with listening() as (stream, port):
        connected = Connected(stand_in, port)
        connected.start()
        assert wait_for_px4(stream, 10.0, stop)
        exchange = Px4Exchange(stream, simulation.vehicle, 1.0 / rate_hz, stop)
        timing = serve_px4(
            *(simulation, exchange, Px4Encoder(DEFAULT_ORIGIN), stop),
            *(lambda *_: None, trace.add, lambda _: None),
            every=round(1e6 / rate_hz) // STEP_US,
            pace_s=None,
        )
    connected.join(5.0)
    rows = np.array(trace.rows)
    return Px4Flight(simulation, stand_in, timing, exchange, rows[:, 0], rows[:, 1:4], rows[:, 4:])
