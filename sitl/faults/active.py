"""The faults of one flight: which are active now, and what they do."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sitl.faults.actuators import MotorFault, battery_charge, scaled, thrust_share
from sitl.faults.keys import SENSORS, Fault
from sitl.faults.sensors import FrameFault, SuiteFault
from sitl.faults.signal import Windows
from sitl.seeds import stream
from sitl.sensors.channel import Measurement
from sitl.sensors.exact import SensorReadings


@dataclass
class _Entry:
    """One fault, its steps and, while it lasts, what applies it."""

    fault: Fault
    number: int  # names its stream of random numbers
    first: int  # step
    end: float  # step, from which on all is as without
    applied: object = None


class Faults:
    """Switches faults on and off, step by step; without any it costs a comparison a step.

    Each draws from a stream of its own, of the seed and its place in the order of all.
    """

    def __init__(
        self,
        faults: tuple[Fault, ...],
        seed: int,
        *,
        step_us: int,
        full: tuple[float, ...],
        joints: int,
        exact: bool,
        sags: bool = False,
    ) -> None:
        """Rotors give up to ``full`` (r,) [N]; the states are ``exact`` or a suite's.

        A battery that ``sags`` is simulated, and takes thrust by itself.
        """
        self._sags = sags
        self._seed = seed
        self._step_us = step_us
        self._full = full
        self._exact = exact
        self._joints = joints
        self._entries: list[_Entry] = []
        self._count = 0  # of all faults so far
        self._change: float = math.inf  # the next step at which one begins or ends
        self._begun: list[Fault] = []
        self.locked = (False,) * joints
        self.limp = (False,) * joints
        self.active: tuple[Fault, ...] = ()
        self._frames: list[FrameFault] = []
        self._suites: list[SuiteFault] = []
        self._motors: list[MotorFault] = []
        self._silences: list[Windows] = []  # of the data link
        self.charge = 1.0  # of the battery, at most
        self.of_battery = False  # whether it has failed, now or before
        self._share = 1.0  # of the thrust that the battery leaves
        self.clock_us = 0  # by which the sensors' clock is ahead
        for fault in faults:
            self._add(fault, round(1e6 * fault.start_s / step_us))

    @property
    def none(self) -> bool:
        """Whether there has been no fault, and none is to come."""
        return not self._entries

    def at(self, step: int) -> bool:
        """Bring it to a step; whether any fault is active."""
        if step >= self._change:
            self._switch(step)
        return bool(self.active)

    def inject(self, fault: Fault, step: int) -> None:
        """Begin at this step; a fault that is there already goes on."""
        if not any(one.fault == fault and one.first <= step < one.end for one in self._entries):
            self._add(fault, step)

    def clear(self, unit: str, number: int, step: int) -> tuple[Fault, ...]:
        """End at this step all faults of a unit, or of one motor or joint of it; which they were.

        One that all motors share ends for all of them or for none.
        """
        ended = []
        for one in self._entries:
            same = one.fault.unit == unit and number in (0, one.fault.number)
            if same and one.first <= step < one.end:
                one.end = step
                self._change = step
                ended.append(one.fault)
        return tuple(ended)

    def take_begun(self) -> list[Fault]:
        """Faults that began since the last call."""
        begun, self._begun = self._begun, []
        return begun

    def frame(self, exact: SensorReadings) -> SensorReadings:
        """What is sent of the ``exact`` states; to be called once a step."""
        for one in self._frames:
            exact = one.spoil(exact)
        if self.clock_us:
            exact = exact._replace(t_us=exact.t_us + self.clock_us)
        return exact

    def suite(self, t_us: int, arrived: tuple[Measurement, ...]) -> tuple[Measurement, ...]:
        """What arrives from a suite in the step of ``t_us`` [us]; to be called once a step."""
        for one in self._suites:
            arrived = one.spoil(t_us, arrived)
        if self.clock_us:
            ahead = self.clock_us
            arrived = tuple([one._replace(t_us=one.t_us + ahead) for one in arrived])
        return arrived

    def motors(self, command: tuple[float, ...], t_us: int) -> tuple[float, ...]:
        """What takes effect at ``t_us`` [us] of a ``command`` (r,) [N]; called once a step."""
        for one in self._motors:
            command = one.through(command, t_us)
        return scaled(self._share, command) if self._share < 1.0 else command

    def drives(self, torques: tuple[float, ...]) -> tuple[float, ...]:
        """What reaches the joints of ``torques`` [N·m]."""
        if not any(self.limp):
            return torques
        return tuple(0.0 if limp else t for t, limp in zip(torques, self.limp, strict=True))

    def pilot_silent(self, t_us: int) -> bool:
        """Whether nothing of the pilot's data link comes through at ``t_us`` [us]."""
        return any(one.silent(t_us) for one in self._silences)

    def _add(self, fault: Fault, first: int) -> None:
        steps = round(1e6 * fault.duration_s / self._step_us)
        end = first + steps if steps else math.inf
        self._entries.append(_Entry(fault, self._count, first, end))
        self._count += 1
        self._change = min(self._change, first)

    def _switch(self, step: int) -> None:
        self._entries = [one for one in self._entries if step < one.end]
        lasting = [one for one in self._entries if one.first <= step]
        for one in lasting:
            if one.applied is None:
                one.applied = self._applied(one.number, one.fault)
                self._begun.append(one.fault)
        self.active = tuple(one.fault for one in lasting)
        applied = [one.applied for one in lasting]
        self._frames = [one for one in applied if isinstance(one, FrameFault)]
        self._suites = [one for one in applied if isinstance(one, SuiteFault)]
        self._motors = [one for one in applied if isinstance(one, MotorFault)]
        self._silences = [one for one in applied if isinstance(one, Windows)]
        charges = [battery_charge(one) for one in self.active if one.unit == "battery"]
        self.charge = min(charges, default=1.0)
        self.of_battery = self.of_battery or bool(charges)
        self._share = thrust_share(self.charge) if charges and not self._sags else 1.0
        jumps = [one.jump_s for one in self.active if one.unit == "clock"]
        self.clock_us = round(1e6 * sum(jumps))
        self.locked, self.limp = self._of_joints("stuck"), self._of_joints("off")
        edges = [edge for one in self._entries for edge in (one.first, one.end) if edge > step]
        self._change = min(edges, default=math.inf)

    def _of_joints(self, kind: str) -> tuple[bool, ...]:
        faults = [one for one in self.active if one.unit == "joint" and one.kind == kind]
        return tuple(any(one.hits(k) for one in faults) for k in range(self._joints))

    def _applied(self, number: int, fault: Fault) -> object:
        random = stream(self._seed, "fault", str(number), fault.unit, fault.kind)
        if fault.unit in SENSORS:
            return FrameFault(fault, random) if self._exact else SuiteFault(fault, random)
        if fault.unit == "motor":
            return MotorFault(fault, random, self._full, self._step_us)
        if fault.unit == "mavlink":
            return Windows(1.0 if fault.kind == "off" else fault.share, random)
        return True
