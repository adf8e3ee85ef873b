"""What a planner above PX4 is told beside PX4: joints, the trajectory and the safe set.

PX4 knows of none of them. Once PX4 has given the vehicle, the planner is asked to go where the
trajectory begins, then for that, which begins when the end-effector is at its first point.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, cast

from messages import message_ids
from messages.frames import FrameWriter, split
from messages.message_ids import PATH_PLANNER, SIMULATOR, SYSTEM_ID
from sitl.earth import DEFAULT_ORIGIN, place_of
from sitl.link import pilot
from sitl.link.encode import StepEncoder
from sitl.link.encode_sensors import SensorEncoder
from sitl.link.endpoints import PeerSocket
from sitl.link.pilot import FlightPlan, Phase, PilotState
from sitl.link.pilot_messages import Ack, Heard
from sitl.scenario import V3
from sitl.sensors.channel import Measurement
from sitl.sensors.encoders import JointMeasurement
from sitl.simulation import Simulation

_HOLD: Final = 4 << 16 | 3 << 24
_ARMED: Final = 128
_COMMAND_INT, _REPOSITION, _GLOBAL = 75, 192, 5
_THERE_M: Final = 0.06
_SETTLES_S: Final = 4.0
_PATIENCE_S: Final = 15.0  # in which it gets there
_NEAR_M: Final = 0.12  # to the first point, for a trajectory to begin
_SLOW_M_S: Final = 0.25
_STILL_S: Final = 0.5
_LEAD_S: Final = 2.5  # later than the last point that was sent ahead


class Companion:
    """The scenario's pilot and the arm's encoders, towards the planner."""

    def __init__(
        self, endpoint: PeerSocket, plan: FlightPlan, encoder: StepEncoder, start: V3
    ) -> None:
        """Take a socket whose peer is the planner's link to the arm.

        The body is at ``start`` [m, NED] where the trajectory begins.
        """
        self._endpoint, self._plan, self._encoder = endpoint, plan, encoder
        self._start, self._pilot = start, FrameWriter(SYSTEM_ID, PATH_PLANNER)
        self._since_us = 0  # of the way there
        self._state = PilotState(Phase.IDLE)
        self._joints = SensorEncoder(FrameWriter(SYSTEM_ID, SIMULATOR), DEFAULT_ORIGIN)
        self._asked = False  # for the trajectory
        self._still_since_s = math.inf
        self._mode: int | None = None

    def step(self, simulation: Simulation, measurements: list[Measurement]) -> None:
        """Say what has been measured since the last step, and what the pilot says."""
        self._listen(simulation)
        self._begin(simulation)
        self._state, messages = pilot.speak(self._plan, self._state, simulation.t_us)
        arm = [one for one in measurements if isinstance(one, JointMeasurement)]
        datagram = b"".join(self._joints.encoders(max(one.t_us, 0), one.angles) for one in arm[-1:])
        if messages:
            datagram += self._encoder.spoken(messages)
        if datagram:
            self._endpoint.send(datagram)

    def close(self) -> None:
        """Close the socket."""
        self._endpoint.close()

    def _listen(self, simulation: Simulation) -> None:
        while (datagram := self._endpoint.receive_waiting()) is not None:
            for frame in split(datagram):
                values = cast("tuple[float, ...]", frame.payload_values)
                heard = Heard()
                if frame.message_id == message_ids.COMMAND_ACK:
                    if int(values[5]) not in (0, PATH_PLANNER):
                        continue
                    heard = Heard(acks=(Ack(int(values[0]), int(values[1])),))
                elif frame.message_id == message_ids.HEARTBEAT:
                    self._mode = int(values[0])
                    armed = bool(int(values[3]) & _ARMED)
                    if armed and self._mode == _HOLD and not self._asked:
                        self._approach(simulation)
                    if self._state.phase is Phase.FOLLOWING:
                        heard = Heard(custom_mode=self._mode)
                self._state = pilot.listen(self._plan, self._state, heard, simulation.t_us)

    def _approach(self, simulation: Simulation) -> None:
        """Ask for the place where the trajectory begins; once it is there, for the trajectory."""
        now_us, truth = simulation.t_us, simulation.truth()
        self._since_us = self._since_us or now_us
        waited_s = 1e-6 * (now_us - self._since_us)
        there = math.dist(truth.p_WB, self._start) < _THERE_M
        if (there and waited_s > _SETTLES_S) or waited_s > _PATIENCE_S:
            self._asked = True
            self._state = replace(
                self._state, phase=Phase.FOLLOW, since_us=now_us, next_ask_us=now_us
            )
            return
        latitude, longitude, altitude = place_of(DEFAULT_ORIGIN, self._start)
        where = (round(1e7 * latitude), round(1e7 * longitude), altitude)
        values = (-1.0, 0.0, 0.0, math.nan, *where, _REPOSITION, SYSTEM_ID, 1, _GLOBAL, 0, 0)
        self._endpoint.send(self._pilot.frame(_COMMAND_INT, *values))

    def _begin(self, simulation: Simulation) -> None:
        """Begin the trajectory once the vehicle waits at its first point; end it if it leaves."""
        clock, now_s = simulation.clock, simulation.time_s
        if self._state.left is not None:
            simulation.leave_trajectory(simulation.t_us, self._state.left)
            self._state = replace(self._state, left=None)
        if self._state.phase is not Phase.FOLLOWING or clock.starts_s is not None:
            return
        truth = simulation.truth()
        off = math.dist(truth.p_WE, clock.place_at(0.0))
        if off > _NEAR_M or math.hypot(*truth.v_WB) > _SLOW_M_S:
            self._still_since_s = math.inf
            return
        self._still_since_s = min(self._still_since_s, now_s)
        if now_s - self._still_since_s >= _STILL_S:
            clock.starts_s = now_s + _LEAD_S
