"""A flight in one process that anybody talks to: messages of all of the dialect, drawn at random.

Frames are made, cut and handed on as a link does, to the inbox and to the services of missions and
parameters, each from one of a few senders: the simulator, a ground station, and two strangers, one
of whom writes the ids of the first. Half of what is drawn is any payload at all, half is what an
adversary would send: zones on and around the vehicle, targets below the ground and far away,
setpoints, missions and fences, mode after mode, and parameters, at an end of a range or between.
Left out is what ends a flight by its meaning (termination, disarming by force), and the speed that
is judged.
"""

from __future__ import annotations

import math
import random
import struct
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Final

from docs.pages.messages import heard
from fsw.autopilot.flight.tuned_autopilot import TunedAutopilot
from fsw.autopilot.geometry.geodesy import to_local
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.autopilot.signals import (
    Arm,
    Command,
    CommandAction,
    CommandRequest,
    MessageSource,
    Mode,
    Place,
    SwitchMode,
    TakeOff,
    TickInputs,
    TickOutputs,
    Vec3,
)
from fsw.link.inbox import Inbox
from fsw.link.services.mission_service import MissionService
from fsw.link.services.mission_store import MissionStore, Site
from fsw.link.services.parameter_service import ParameterService
from fsw.link.services.service import LinkService
from fsw.storage.parameter_store import ParameterStore
from messages import dialect
from messages import message_ids as ids
from messages.frames import FrameWriter, split, wire_fields
from sitl.result import EndKind
from sitl.scenario_file import parse_scenario
from sitl.simulation import STEP_US, Simulation
from studies.flight.closed_loop import ClosedLoop, InlinePlanner
from studies.flight.collector import collector_off
from studies.flight.result import processor_time_us
from tests.fsw.link.test_any_payload import frame as any_payload
from tests.fsw.storage.threads import AtOnce

SENDERS: Final = (
    MessageSource(1, 195, "simulator"),
    MessageSource(255, 190, "gcs", "127.0.0.1:14550"),
    MessageSource(66, 6, "gcs", "127.0.0.1:5555"),
    MessageSource(1, 195, "api", "127.0.0.1:5556"),
)
_SCENARIO: Final = """
duration_s = 36000.0
body = "full"
[start]
kind = "{start}"
[pilot]
plan = "none"
[trajectory]
kind = "hold"
position_m = [0.0, 0.0, -1.2]
"""
_OWNERS: Final = ((-1.0, 0.0, 0.0, -0.795), 0.1, (0.0,) * 3, 0, 0)
_WALL: Final = """
[[walls]]
name = "front"
normal = [-1.0, 0.0, 0.0]
offset_m = -0.8
clearance_m = 0.1
"""
_LOCAL_NED: Final = 1
_CONTACTS: Final = (EndKind.COLLISION, EndKind.CRASH, EndKind.DIVERGED)
_ENDING: Final = (185, 400, 246, 420)  # terminate, (dis)arm, reboot, inject a failure
# Drawn with values of their own, from whom they may come.
_OF_OTHERS: Final = (
    ids.PARAM_SET, ids.OBSTACLE_WALL, ids.OBSTACLE_POINT, ids.OBSTACLE_SHAPE, ids.WORKSPACE_SPHERE
)  # fmt: skip
_MAIN_SUB: Final = (
    (4, 2),
    (4, 3),
    (4, 3),
    (4, 4),
    (4, 5),
    (4, 6),
    (4, 11),
    (4, 11),
    (6, 0),
    (6, 0),
)
_ANY: Final = (math.nan, math.inf, -math.inf, 3.396e38, -3.4e38, 1e20, 1e30, 0.0, -1.0, 1e4)
_SET: Final = [one for one in PARAMETERS if one.name != "STR_V_MAX"]
_STREAM_S: Final = 0.1
_QUIET_S: Final = 2.0  # of a message's follow-ups


@dataclass
class Outcome:
    """What a flight came to."""

    flown_s: float = 0.0
    contact: str = ""
    fastest: float = 0.0  # m/s, of the base
    fastest_s: float = 0.0
    modes: Counter[str] = field(default_factory=Counter)  # ticks in each
    texts: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=60))
    sent: int = 0
    refusals: int = 0
    last: deque[tuple[float, str]] = field(default_factory=lambda: deque(maxlen=60))


class Talkers:
    """Everybody who talks to the vehicle of one flight."""

    def __init__(self, seed: int, config: FlightConfig, *, wall: bool, start: str) -> None:
        self.chance, self.wall = random.Random(seed), wall
        # Whoever owns the safe set may take the wall away, and then nobody knows of it.
        self.announcers = SENDERS[1:] if wall else SENDERS
        text = _SCENARIO.format(start=start) + (_WALL if wall else "")
        self.simulation = Simulation(parse_scenario(text, "talked to", "perfect"), seed)
        self.flight = TunedAutopilot(config)
        self.inbox = Inbox()
        self.missions = MissionStore(
            Site(
                locate=partial(to_local, config.origin),
                clearance=lambda: config.limits.fence_clearance,
            )
        )
        self.parameters = ParameterStore(config, self.flight.prepare)
        self.parameters.open(AtOnce(), save=lambda values: None)
        self.services: list[LinkService] = [
            MissionService(self.missions), ParameterService(self.parameters)
        ]  # fmt: skip
        planner = InlinePlanner(Planner(config.planner, config.airframe, processor_time_us))
        self.loop = ClosedLoop(self.simulation, self.flight.tick, planner, config.airframe)
        self.outcome = Outcome()
        self.writers = {sender: FrameWriter(*_ids(sender)) for sender in SENDERS}
        self.later: list[tuple[float, Callable[[], None]]] = []  # messages that follow others
        self.pilot: tuple[CommandAction, ...] = ()  # what the operator wants now
        self.listened = sorted(heard() - {ids.SETUP_SIGNING})

    # ------------------------------------------------------------ sending

    def send(self, sender: MessageSource, message_id: int, **fields: Any) -> None:
        """A message with these fields, by name; an array whole, and zero where none is given."""
        flat: dict[str, float] = {"target_system": 1, "target_component": 1}
        for name, value in fields.items():
            entries = enumerate(value) if isinstance(value, tuple) else ()
            flat |= {f"{name}[{k}]": one for k, one in entries} or {name: value}
        names = wire_fields(message_id)
        assert set(flat) - {"target_system", "target_component"} <= set(names), (message_id, flat)
        values = [flat.get(name, 0) for name in names]
        self.raw(sender, self.writers[sender].frame(message_id, *values))

    def raw(self, sender: MessageSource, datagram: bytes) -> None:
        """Hand frames on as a link does."""
        t_us = self.simulation.t_us
        for frame in split(datagram):
            self.outcome.sent += 1
            name = dialect.mavlink_map[frame.message_id].msgname
            shown = f"{sender} {name} {frame.payload_values}"
            self.outcome.last.append((round(self.simulation.time_s, 2), shown))
            self.inbox.accept(frame, sender)
            for service in self.services:
                if frame.message_id in service.message_ids:
                    service.source = sender
                    service.handle(frame, t_us)

    def command(self, sender: MessageSource, number: int, *params: float) -> None:
        """A COMMAND_LONG."""
        if number in _ENDING:
            return
        given = (*params, *(math.nan,) * 7)[:7]
        named = {f"param{k}": value for k, value in enumerate(given, start=1)}
        self.send(sender, ids.COMMAND_LONG, command=number, confirmation=0, **named)

    # ------------------------------------------------------------ what is drawn

    def draw(self) -> None:
        """Send something."""
        chance = self.chance
        sender = chance.choice(SENDERS)
        if chance.random() < 0.35:
            if self.wall and not self.loop.state.vehicle.armed:
                return  # disarmed, the safe set is anybody's, as the manual says
            chance.choice(
                (self._wall, self._point, self._shape, self._shape, self._shape, self._sphere)
            )(chance.choice(self.announcers))
            return
        if chance.random() < 0.3:
            number = chance.choice(self.listened)
            datagram = any_payload(number, chance, chance.randrange(256))
            frames = split(datagram)
            if not any(_ends(frame.message_id, frame.payload_values) for frame in frames):
                self.raw(sender, datagram)
            return
        chance.choice(
            (self._targets, self._targets, self._setpoints, self._setpoints, self._attitudes,
             self._joints, self._mode, self._mode, self._places, self._speeds, self._mission,
             self._fence, self._nothing, self._parameter)
        )(sender)  # fmt: skip

    def near(self, spread: float = 1.5) -> Vec3:
        """A place near the vehicle, mostly; sometimes anywhere."""
        chance, at = self.chance, self.simulation.truth().p_WB
        if chance.random() < 0.1:
            spread = chance.choice((10.0, 100.0, 2000.0))
        x, y, z = (value + chance.gauss(0.0, spread) for value in at)
        return x, y, z

    def number(self, usual: float, spread: float) -> float:
        """A number near the usual one, mostly; sometimes any."""
        chance = self.chance
        return chance.choice(_ANY) if chance.random() < 0.06 else chance.gauss(usual, spread)

    def _normal(self) -> Vec3:
        chance = self.chance
        if chance.random() < 0.4:
            return chance.choice(((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0),
                                  (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)))  # fmt: skip
        n = [chance.gauss(0.0, 1.0) for _ in range(3)]
        length = math.hypot(*n) or 1.0
        return n[0] / length, n[1] / length, n[2] / length

    def _wall(self, sender: MessageSource) -> None:
        n, p, count = self._normal(), self.simulation.truth().p_WB, self.chance.choice((1, 1, 2))
        for index in range(count):
            offset = sum(map(float.__mul__, n, p)) - self.number(0.6, 0.5)
            clearance = abs(self.number(0.1, 0.1))
            self.send(sender, ids.OBSTACLE_WALL, normal=n, offset=offset, clearance=clearance,
                      index=index, count=count)  # fmt: skip
            n = (-n[0], -n[1], -n[2])

    def _point(self, sender: MessageSource) -> None:
        clearance = abs(self.number(0.3, 0.3))
        self.send(sender, ids.OBSTACLE_POINT, position=self.near(), clearance=clearance,
                  index=0, count=1)  # fmt: skip

    def _sphere(self, sender: MessageSource) -> None:
        centre = (self.number(0.0, 0.05), self.number(0.0, 0.05), self.number(-0.225, 0.1))
        self.send(sender, ids.WORKSPACE_SPHERE, offset=centre, radius=self.number(0.4, 0.3))

    def _shape(self, sender: MessageSource) -> None:
        chance, moves = self.chance, self.chance.random() < 0.6
        kind = chance.randrange(6)
        x, y, z = self.near()
        size = abs(self.number(0.5, 0.4))
        numbers = {
            0: (*self._normal(), self.number(0.0, 2.0)),
            1: (x, y, z, size),
            2: (self.number(0.0, 0.1), self.number(0.0, 0.1), self.number(-0.2, 0.2), size),
            3: (x, y, z - size, z + abs(self.number(1.0, 1.0)), size),
            4: (x, y, z, *self.near(), size),
            5: (x, y, z, size, abs(self.number(0.5, 0.3)), size, 1.0, 0.0, 0.0, 0.0),
        }[kind]  # fmt: skip
        velocity = (
            tuple(self.number(0.0, 0.7) for _ in range(3)) if moves and kind != 2 else (0.0,) * 3
        )
        t_us = self.simulation.t_us + chance.choice((0, 0, 0, -1_000_000, 2_000_000, 10**9))
        flags = int(kind == 2 or chance.random() < 0.2)

        drawn = numbers, abs(self.number(0.1, 0.1)), velocity, kind, flags
        # With the wall that another source owns in front: what does not grow is not refused for it.
        zones = (_OWNERS, drawn) if chance.random() < 0.5 else (drawn,)
        for index, (numbers, clearance, velocity, kind, flags) in enumerate(zones):
            if chance.random() < 0.05:
                continue  # lost
            self.send(
                sender, ids.OBSTACLE_SHAPE, time_usec=max(t_us, 0), clearance=clearance,
                velocity=velocity, numbers=(*numbers, *(0.0,) * 16)[:16],
                index=index, count=len(zones), kind=kind, flags=flags,
            )  # fmt: skip

    def _targets(self, sender: MessageSource) -> None:
        """A stream for some seconds, which jumps, runs or hides below the ground."""
        chance = self.chance
        if chance.random() < 0.7:
            self.later.append((self.simulation.time_s + 0.1, partial(self._switch, sender, 4, 11)))
        begin, p, v = (
            self.simulation.time_s,
            list(self.near(1.0)),
            [chance.gauss(0.0, 0.5) for _ in range(3)],
        )
        jump = chance.choice((0.0, 0.0, 0.3, 5.0))
        lasts = chance.uniform(0.5, 6.0)
        count = round(lasts / _STREAM_S)

        def target(k: int) -> None:
            at = [p[i] + v[i] * k * _STREAM_S + chance.gauss(0.0, 1.0) * jump for i in range(3)]
            t_us = self.simulation.t_us + chance.choice((200_000, 200_000, 0, 1_000_000))
            self.send(
                sender, ids.END_EFFECTOR_TARGET, time_usec=t_us, position=tuple(at),
                velocity=tuple(self.number(one, 0.01) for one in v),
                acceleration=(0.0, 0.0, 0.0), yaw=chance.choice((0.0, 0.0, self.number(0.0, 1.0))),
                coordinate_frame=_LOCAL_NED,
            )  # fmt: skip

        self.later += [(begin + k * _STREAM_S, partial(target, k)) for k in range(count)]

    def _switch(self, sender: MessageSource, main: int, sub: int) -> None:
        self.command(sender, 176, 1.0, float(main), float(sub))

    def _setpoints(self, sender: MessageSource) -> None:
        """Offboard for some seconds."""
        chance, begin = self.chance, self.simulation.time_s
        if chance.random() < 0.7:
            self.later.append((begin + 0.1, partial(self._switch, sender, 6, 0)))
        x, y, z = self.near(1.0)
        velocity = tuple(self.number(0.0, 1.5) for _ in range(3))
        mask = chance.choice((0x1F8, 0x1C7, 0x03F, 0x1C0, 0x1F8, 0x1C7)) | chance.choice(
            (0xC00, 0x400, 0)
        )
        frame = chance.choice((1, 1, 1, 8, 12, 6))
        end_effector = chance.random() < 0.4

        def setpoint() -> None:
            if end_effector:
                self.send(
                    sender, ids.END_EFFECTOR_TARGET, position=(x, y, z), velocity=velocity,
                    acceleration=velocity, type_mask=mask, coordinate_frame=1,
                )  # fmt: skip
                return
            vx, vy, vz = velocity
            self.send(
                sender, ids.SET_POSITION_TARGET_LOCAL_NED, x=x, y=y, z=z, vx=vx, vy=vy, vz=vz,
                afx=vx, afy=vy, afz=vz, yaw=0.3, yaw_rate=0.2, type_mask=mask,
                coordinate_frame=frame,
            )  # fmt: skip

        count = round(chance.uniform(0.5, 6.0) / _STREAM_S)
        self.later += [(begin + k * _STREAM_S, setpoint) for k in range(count)]

    def _attitudes(self, sender: MessageSource) -> None:
        chance, begin = self.chance, self.simulation.time_s
        if chance.random() < 0.7:
            self.later.append((begin + 0.1, partial(self._switch, sender, 6, 0)))
        thrust, rates = self.number(0.5, 0.3), [self.number(0.0, 0.5) for _ in range(3)]
        angle = chance.gauss(0.0, 0.3)
        q = (math.cos(angle), math.sin(angle), 0.0, 0.0)
        mask = chance.choice((0x07, 0x80))

        def setpoint() -> None:
            rolls, pitches, yaws = rates
            self.send(
                sender, ids.SET_ATTITUDE_TARGET, q=q, body_roll_rate=rolls, body_pitch_rate=pitches,
                body_yaw_rate=yaws, thrust=thrust, type_mask=mask,
            )  # fmt: skip

        count = round(chance.uniform(0.5, 4.0) / _STREAM_S)
        self.later += [(begin + k * _STREAM_S, setpoint) for k in range(count)]

    def _joints(self, sender: MessageSource) -> None:
        self.command(sender, 187, self.number(0.0, 0.5), self.number(0.0, 0.5))

    def _mode(self, sender: MessageSource) -> None:
        self._switch(sender, *self.chance.choice(_MAIN_SUB))

    def _places(self, sender: MessageSource) -> None:
        """Reposition, home, orbit, takeoff, region of interest, in local coordinates."""
        chance = self.chance
        x, y, z = self.near(3.0)
        number = chance.choice((192, 192, 179, 34, 22, 195))
        p1, p2, p3, p4 = (self.number(1.0, 1.0) for _ in range(4))
        if number == 192:
            p2 = 1.0
        if number == 34:
            p1, p2, p3, p4 = self.number(2.0, 1.0), self.number(0.5, 0.5), 0.0, 0.0
        if number == 179:
            p1 = 0.0
        if not math.hypot(x, y) < 2e5:
            return
        self.send(
            sender, ids.COMMAND_INT, command=number, frame=1, param1=p1, param2=p2, param3=p3,
            param4=p4, x=round(1e4 * x), y=round(1e4 * y), z=z,
        )  # fmt: skip

    def _speeds(self, sender: MessageSource) -> None:
        self.command(sender, 178, 1.0, abs(self.number(1.0, 1.0)))

    def _mission(self, sender: MessageSource) -> None:
        """An upload, started or not."""
        chance, count = self.chance, self.chance.randrange(1, 6)
        self.send(sender, ids.MISSION_COUNT, count=count, mission_type=0)
        for seq in range(count):
            x, y, z = self.near(2.0)
            command = chance.choice((16, 16, 16, 22, 21, 20, 178, 93, 19))
            p1, p2 = (
                (1.0, abs(self.number(1.0, 2.0)))
                if command == 178
                else (self.number(0.5, 0.5), 0.0)
            )
            self.send(
                sender, ids.MISSION_ITEM_INT, seq=seq, frame=1, command=command, autocontinue=1,
                param1=abs(p1), param2=p2, param4=self.number(0.0, 90.0),
                x=_whole(1e4 * x), y=_whole(1e4 * y), z=chance.choice((z, z, 0.0, -0.05, -50.0)),
                mission_type=0,
            )  # fmt: skip
        if chance.random() < 0.7:
            self.later.append(
                (self.simulation.time_s + 0.2, partial(self.command, sender, 300, 0.0, 0.0))
            )

    def _fence(self, sender: MessageSource) -> None:
        """A circle to stay in or out of, or the sphere that rides with the target."""
        chance = self.chance
        x, y, z = self.near(1.0)
        command, frame = chance.choice(((5003, 1), (5004, 1), (5003, 7), (5003, 1)))
        self.send(sender, ids.MISSION_COUNT, count=1, mission_type=1)
        self.send(
            sender, ids.MISSION_ITEM_INT, seq=0, frame=frame, command=command,
            param1=abs(self.number(2.0, 1.5)), x=_whole(1e4 * x), y=_whole(1e4 * y), z=z,
            mission_type=1,
        )  # fmt: skip

    def _parameter(self, sender: MessageSource) -> None:
        """Any of them, at an end of its range, between, or near what it is."""
        chance, one = self.chance, self.chance.choice(_SET)
        now, values = self.parameters.values[one.name], (one.least, one.most)
        value = chance.choice((*values, chance.uniform(*values), now * chance.uniform(0.5, 2.0)))
        if one.choices:
            value = chance.choice(one.choices)[0]
        value = round(value) if one.integer else value
        if self.loop.state.vehicle.armed or not self.wall:  # disarmed, whose wall it is may be set
            bits = struct.unpack("<f", struct.pack("<i", value))[0] if one.integer else value
            self.send(
                sender, ids.PARAM_SET, param_id=one.name.encode(), param_value=bits,
                param_type=dialect.MAV_PARAM_TYPE_INT32 if one.integer
                else dialect.MAV_PARAM_TYPE_REAL32,
            )  # fmt: skip

    def _nothing(self, sender: MessageSource) -> None:
        self.send(sender, ids.MISSION_CLEAR_ALL, mission_type=self.chance.choice((0, 1, 255)))

    # ------------------------------------------------------------ the flight

    def _operator(self, time_s: float, outputs: TickOutputs | None) -> tuple[Command, ...]:
        """An operator who takes off again whenever the vehicle has come down."""
        step = self.simulation.step
        if step == 0 and outputs is None:
            wanted: tuple[CommandAction, ...] = (Arm(),)
        elif outputs is None or step % 500 != 0 or time_s < 2.0:
            return ()
        else:
            snapshot = outputs.snapshot
            if snapshot.mode is Mode.DISARMED:
                wanted = (Arm(),)
            elif snapshot.landed:
                wanted = (TakeOff(Place()),)
            elif self.chance.random() < 0.05:
                wanted = (SwitchMode(Mode.HOLD),)
            else:
                return ()
        return tuple(
            Command(action, CommandRequest(20_000 + step, (0.0,) * 7, 255, 190))
            for action in wanted
        )

    def _speak(self, time_s: float, share: float) -> None:
        """Send what is due, and with a chance of ``share`` [1] something else."""
        if time_s > 2.0 and self.chance.random() < share:
            self.draw()
        if self.later:
            due = [action for at_s, action in self.later if at_s <= time_s]
            self.later = [one for one in self.later if one[0] > time_s]
            for action in due:
                action()

    def _inputs(self, time_s: float, outputs: TickOutputs | None) -> TickInputs:
        """What the next tick is given."""
        sensors, samples = self.loop.observe()
        inputs = self.inbox.take_inputs(
            sensors,
            self.loop.planner.take(sensors.t_us),
            self.parameters.take_tuning(),
            self.missions.take_update(),
        )
        heard_now = inputs.ground_station_heard or self.simulation.step % 500 == 0
        return replace(
            inputs,
            samples=samples,
            commands=(*inputs.commands, *self._operator(time_s, outputs)),
            announced=(*self.loop.announced(), *inputs.announced),
            ground_station_heard=heard_now,
        )

    @collector_off()
    def fly(self, seconds: float, rate: float) -> Outcome:
        """Fly while ``rate`` [1/s] messages are drawn."""
        simulation, outcome, loop = self.simulation, self.outcome, self.loop
        outputs: TickOutputs | None = None
        share = rate * 1e-6 * STEP_US
        while simulation.ended is None and simulation.time_s < seconds:
            time_s = simulation.time_s
            self._speak(time_s, share)
            inputs = self._inputs(time_s, outputs)
            outputs = loop.step(inputs)
            self._answer(inputs, outputs)
            outcome.modes[outputs.snapshot.mode.value] += 1
            outcome.texts.extend((round(time_s, 2), one.text) for one in outputs.texts)
            if simulation.step % 10 == 0:
                speed = math.hypot(*simulation.truth().v_WB)
                if speed > outcome.fastest:
                    outcome.fastest, outcome.fastest_s = speed, time_s
        outcome.flown_s = simulation.time_s
        if outputs is not None:
            outcome.refusals = outputs.snapshot.safety.refusals
        end = simulation.ended
        if end is not None and end.kind in _CONTACTS:
            outcome.contact = end.sentence
        elif end is not None:
            outcome.contact = f"ended: {end.sentence}"
        return outcome

    def _answer(self, inputs: TickInputs, outputs: TickOutputs) -> None:
        """Let those who set or uploaded something know what the tick made of it."""
        self.missions.observe(outputs.snapshot)
        self.inbox.owner = outputs.snapshot.safe_set_owner
        if inputs.tuning is not None:
            self.parameters.settle(outputs.tuning_taken)
        if inputs.mission is not None:
            self.missions.settle(outputs.upload_taken)
        for service in self.services:
            service.poll(inputs.sensors.t_us)


def _ids(sender: MessageSource) -> tuple[int, int]:
    return sender.system, sender.component


def _ends(message_id: int, values: tuple[Any, ...]) -> bool:
    """Whether any payload happens to end the flight by its meaning."""
    at = {ids.COMMAND_LONG: 7, ids.COMMAND_INT: 7}.get(message_id)
    return (at is not None and values[at] in _ENDING) or message_id in _OF_OTHERS


def _whole(value: float) -> int:
    return max(min(round(value), 2**31 - 2), -(2**31))


def fly_talked_to(
    seed: int,
    seconds: float,
    *,
    rate: float = 4.0,
    wall: bool | None = None,
    start: str = "airborne",
) -> Outcome:
    """One flight; by its seed beside a wall that the simulator owns, or with no owner."""
    wall = seed % 2 == 1 if wall is None else wall
    return Talkers(seed, flight_config(body="full"), wall=wall, start=start).fly(seconds, rate)
