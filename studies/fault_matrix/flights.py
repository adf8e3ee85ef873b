"""One flight in one mode beside a wall, in which one thing fails, and what the vehicle does."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final

from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.mpc.planner import Planner
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.ports import PlanService
from fsw.autopilot.signals import (
    Arm,
    Command,
    CommandAction,
    CommandRequest,
    FlyOrbit,
    MissionAction,
    MissionStep,
    MissionUpdate,
    Mode,
    MotionSetpoint,
    Place,
    Plan,
    PlanFailure,
    PlanRequest,
    SetHome,
    Severity,
    StartMission,
    SwitchMode,
    TakeOff,
    TickInputs,
    TickOutputs,
)
from sitl.faults.keys import SENSORS, Fault
from sitl.result import EndKind
from sitl.scenario import Scenario, vehicle_of
from sitl.scenario_file import PERFECT, load_scenario, parse_scenario
from sitl.simulation import STEP_US, Simulation
from studies.flight.closed_loop import ClosedLoop, InlinePlanner
from studies.flight.collector import collector_off
from studies.flight.kept_row import kept_row
from studies.flight.result import processor_time_us

# A wall whose clearance begins 0.24 m off the blades' tips.
_WALL: Final = """
duration_s = 600.0
body = "full"
[start]
kind = "{kind}"
[pilot]
plan = "{plan}"
[trajectory]
kind = "hold"
position_m = [0.0, 0.0, -1.2]
[[walls]]
name = "front"
normal = [-1.0, 0.0, 0.0]
offset_m = -0.8
clearance_m = 0.1
"""
_HEIGHT: Final = 1.425  # m, of the base above the origin at the start in the air
_STATION: Final = (255, 190)
_HEARTBEAT_STEPS: Final = 500
_SETPOINT_STEPS: Final = 25
_STATION_TIMEOUT_US: Final = 3_000_000  # the least that COM_DL_LOSS_T allows, for short flights

_LANDS: Final = (Mode.RETURN, Mode.LAND)  # a return that is complete

_FOLLOWS_S: Final = 0.1  # after that, a vehicle that is not in Trajectory has left it

_CONTACTS: Final = ("", "ground", "wall")

_SILENCE: Final = ("off", "intermittent")  # of a sensor

Spoken = tuple[float, CommandAction]  # at a time [s], and what is commanded


@dataclass(frozen=True, slots=True)
class Situation:
    """A mode, how the vehicle gets into it, and when something fails."""

    mode: Mode
    scenario: Callable[[str], Scenario]  # by suite of sensors
    commands: tuple[Spoken, ...]
    fault_s: float  # when it begins
    ends_s: float
    nominal: frozenset[Mode]  # modes that follow without a failsafe
    upload: MissionUpdate | None = None
    motion: MotionSetpoint | None = None  # streamed
    body: str = "full"
    packaged: str = ""  # the scenario that comes with Pandion; none: beside a wall

    def placed(self, faults: tuple[Fault, ...]) -> tuple[Fault, ...]:
        """Faults whose times count from that of the situation, in times of the simulation."""
        return tuple(replace(one, start_s=self.fault_s + one.start_s) for one in faults)


def beside_the_wall_text(kind: str, plan: str) -> str:
    """The scenario in TOML, with a start of this kind and a pilot with this plan."""
    return _WALL.format(kind=kind, plan=plan)


def _beside_the_wall(kind: str) -> Callable[[str], Scenario]:
    return lambda suite: parse_scenario(beside_the_wall_text(kind, "none"), "wall", suite)


_AIR, _GROUND = _beside_the_wall("airborne"), _beside_the_wall("ground")
_ARM: Final[Spoken] = (0.0, Arm())  # at once: until then the vehicle falls
# By force: with satellites alone the height does not tell that it is in the air.
_ARM_IN_THE_AIR: Final[Spoken] = (0.0, Arm(force=True))


def _go(north: float, east: float) -> MissionStep:
    return MissionStep(MissionAction.GO, (north, east, -1.2), hold_s=0.0)


def _in_the_air(
    mode: Mode, *commands: Spoken, then: tuple[Mode, ...] = (), **more: object
) -> Situation:
    return Situation(
        mode,
        _AIR,
        (_ARM_IN_THE_AIR, *commands),
        4.0,
        16.0,
        frozenset((mode, *then)),
        **more,  # type: ignore[arg-type]
    )


def _following(packaged: str, body: str = "full", fault_s: float = 4.0) -> Situation:
    return Situation(
        Mode.TRAJECTORY,
        lambda suite: load_scenario(packaged, suite),
        (_ARM, (0.01, SwitchMode(Mode.TRAJECTORY))),
        fault_s,
        fault_s + 12.0,
        frozenset((Mode.TRAJECTORY,)),
        body=body,
        packaged=packaged,
    )


_LANDED = (Mode.LAND, Mode.DISARMED)
SITUATIONS: Final[dict[str, Situation]] = {
    "hold": _in_the_air(Mode.HOLD),
    "trajectory": _following("walls-calm", body="points"),
    "workspace": _following("workspace-calm", body="points"),
    # Touching a wall with 5 N, a second after it has met it; then it goes to the next place.
    "press": _following("probe", fault_s=5.0),
    "offboard": _in_the_air(
        Mode.OFFBOARD,
        (0.5, SwitchMode(Mode.OFFBOARD)),
        motion=MotionSetpoint(False, (0.0, 0.5, -_HEIGHT)),
    ),
    "mission": _in_the_air(
        Mode.MISSION,
        (0.5, StartMission()),
        then=(Mode.HOLD,),
        upload=MissionUpdate(steps=(_go(0.0, 0.8), _go(0.0, -0.8), _go(0.0, 0.8)), current=0),
    ),
    "orbit": _in_the_air(Mode.ORBIT, (0.5, FlyOrbit(Place((-0.6, 0.0), _HEIGHT), 0.6, speed=0.4))),
    "takeoff": Situation(
        Mode.TAKEOFF,
        _GROUND,
        (_ARM, (0.4, TakeOff(Place(height=1.6)))),
        2.5,
        14.5,
        frozenset((Mode.TAKEOFF, Mode.HOLD)),
    ),
    "land": Situation(
        Mode.LAND,
        _AIR,
        (_ARM_IN_THE_AIR, (1.0, SwitchMode(Mode.LAND))),
        2.5,
        14.5,
        frozenset(_LANDED),
    ),
    "return": _in_the_air(
        Mode.RETURN,
        (0.5, SetHome(Place((0.0, 1.0), 0.32))),
        (1.0, SwitchMode(Mode.RETURN)),
        then=_LANDED,
    ),
}
"""By the name of the mode; both safe sets of the paper and a push are flown in Trajectory."""


@dataclass(frozen=True, slots=True)
class Said:
    """A text for the operator."""

    after_s: float  # since the fault
    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class FaultFlight:
    """What became of one flight."""

    texts: tuple[Said, ...] = ()  # from the fault on
    actions: tuple[str, ...] = ()  # of failsafes, in their order; empty: it went on
    contact: str = ""  # "", "ground" or "wall"
    ended: str = ""  # why before its time; empty if it was flown to its end
    least_m: float | None = None  # margin to the safe set, of any part, in the whole flight
    away_m: float | None = None  # from the start at the end
    force_share: float = 0.0  # the largest force on the tool over what its surface allows
    problem: str = ""  # the flight was none: refused, or not in the mode when the fault began
    error: bool = False  # it could not be flown at all
    took_s: float = field(default=0.0, compare=False)  # by the wall's clock

    @property
    def warning(self) -> Said | None:
        """The first text that an operator must act on; None: silence."""
        return next(iter(self.warnings), None)

    @property
    def warnings(self) -> tuple[Said, ...]:
        """All such texts, in their order."""
        return tuple(said for said in self.texts if said.severity <= Severity.WARNING)

    @classmethod
    def from_line(cls, line: Mapping[str, Any]) -> FaultFlight:
        """The flight of a line of a journal, after JSON.

        Raises:
            TypeError: Another version has described it, or it is damaged.
        """
        # A field that is not there is no default: without a margin nothing would be judged.
        if line.keys() != {one.name for one in fields(cls)}:
            raise TypeError(f"{', '.join(line)} are not the fields of a flight")
        texts = tuple(kept_row(Said, said) for said in _listed(line, "texts"))
        actions = tuple(_listed(line, "actions"))
        flight = kept_row(cls, {**line, "texts": texts, "actions": actions})
        if flight.contact not in _CONTACTS:
            raise TypeError(f"contact = {flight.contact!r} is none of {', '.join(_CONTACTS)}")
        return flight


def _listed(line: Mapping[str, Any], name: str) -> list[Any]:
    found = line[name]
    if not isinstance(found, list):
        raise TypeError(f"{name} = {found!r} is no array")
    return found


def is_believed(fault: Fault, suite: str) -> bool:
    """Whether a vehicle with this suite takes for the truth what a sensor with the fault says.

    Exact states are believed where they are numbers: of them only silence is a fault.
    """
    return suite == PERFECT and fault.unit in SENSORS and fault.kind not in _SILENCE


def contact_of(kind: EndKind | None, sentence: str) -> str:
    """What a flight that ended so has touched: "", "ground" or "wall"."""
    if kind not in (EndKind.COLLISION, EndKind.CRASH, EndKind.DIVERGED):
        return ""
    return "ground" if "hit the ground" in sentence else "wall"


class _Planner(InlinePlanner):
    """A planner that is silent while its process is stopped or dead."""

    def __init__(self, config: FlightConfig, simulation: Simulation) -> None:
        super().__init__(Planner(config.planner, config.airframe, processor_time_us))
        self._simulation = simulation

    def _fails(self) -> bool:
        return any(fault.unit == "planner" for fault in self._simulation.faults.active)

    def submit(self, request: PlanRequest) -> None:
        """See ``PlanService``."""
        if not self._fails():
            super().submit(request)

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """See ``PlanService``."""
        return None if self._fails() else super().take(t_us)


class Observer:
    """What is seen of the vehicle from the fault on."""

    def __init__(self, situation: Situation) -> None:
        self._situation = situation
        self._mode: Mode | None = None  # of the tick before
        self._marked = False
        self._begun = False
        self.actions: list[str] = []
        self.texts: list[Said] = []
        self.problem = ""

    def see(self, time_s: float, outputs: TickOutputs) -> None:
        """Take in a tick."""
        after_s = time_s - self._situation.fault_s
        snapshot, (thrust, torque) = outputs.snapshot, outputs.actuators
        if not math.isfinite(sum(thrust) + sum(torque)):
            self.problem = f"a command that is no number, {after_s:.3f} s after the fault"
        mode, marked = snapshot.mode, snapshot.failsafe_from is not None
        if after_s < 0.0:
            for ack in outputs.acks:
                if ack.result != 0:
                    why = "; ".join(text.text for text in outputs.texts)
                    self.problem = f"command {ack.command} was refused: {why}"
        else:
            before = self._mode
            if not self._begun and before is not None and before is not self._situation.mode:
                self.problem = self.problem or f"in {before.value} when the fault began"
            self._begun = True
            self.texts += [
                Said(round(after_s, 3), int(text.severity), text.text) for text in outputs.texts
            ]
            entered = mode is not self._mode or (marked and not self._marked)
            # A failsafe that lands out of a return is an action; the landing of a return is none.
            by_itself = (self._mode, mode) == _LANDS and marked == self._marked
            completed = mode is Mode.DISARMED or by_itself
            if mode is Mode.FAULT and self._mode is not Mode.FAULT:
                self.actions.append("terminate")
            elif entered and not completed and (marked or mode not in self._situation.nominal):
                self.actions.append(mode.value)
        self._mode, self._marked = mode, marked


@collector_off()
def fly(
    mode: str, faults: tuple[Fault, ...] = (), suite: str = "perfect", seed: int = 0
) -> FaultFlight:
    """Fly one situation; faults begin when something fails there, or so long after it."""
    situation = SITUATIONS[mode]
    scenario = situation.scenario(suite)
    scenario = replace(scenario, faults=situation.placed(faults))
    simulation = Simulation(scenario, seed)
    config = flight_config(body=situation.body, vehicle=vehicle_of(scenario))
    limits = replace(config.limits, station_timeout_us=_STATION_TIMEOUT_US)
    config = replace(config, limits=limits)
    planner: PlanService = _Planner(config, simulation)
    autopilot = Autopilot(config)
    loop = ClosedLoop(simulation, autopilot.tick, planner, config.airframe)
    seen = Observer(situation)
    steps = round(1e6 * situation.ends_s / STEP_US)
    started_m = simulation.truth().p_WB
    while simulation.ended is None and simulation.step < steps and not seen.problem:
        time_s = simulation.time_s
        outputs = loop.step(_inputs(situation, loop))
        seen.see(time_s, outputs)
        if outputs.mode is not Mode.TRAJECTORY and time_s > _FOLLOWS_S:
            simulation.leave_trajectory(simulation.t_us, outputs.mode.value)
    if simulation.ended is not None and simulation.time_s < situation.fault_s:
        seen.problem = seen.problem or f"{simulation.ended.sentence}, before anything failed"
    away_m = math.dist(started_m, simulation.truth().p_WB)
    return _judged(simulation, seen, away_m)


def _inputs(situation: Situation, loop: ClosedLoop) -> TickInputs:
    """What sensors, planner, scenario and ground station bring to one tick."""
    simulation = loop.simulation
    step = simulation.step
    sensors, samples = loop.observe()
    inputs = TickInputs(
        sensors=sensors,
        plan=loop.planner.take(sensors.t_us),
        samples=samples,
        battery=loop.battery(),
    )
    if simulation.faults.pilot_silent(simulation.t_us):
        return inputs
    streams = simulation.scenario.pilot.plan == "trajectory"
    return replace(
        inputs,
        commands=tuple(
            _command(k, action)
            for k, (at_s, action) in enumerate(situation.commands)
            if step == round(1e6 * at_s / STEP_US)
        ),
        targets=loop.targets() if streams else (),
        announced=loop.announced(),
        motion=situation.motion if step % _SETPOINT_STEPS == 0 else None,
        ground_station_heard=step % _HEARTBEAT_STEPS == 0,
        mission=situation.upload if step == 0 else None,
    )


def _command(number: int, action: CommandAction) -> Command:
    """A command of the ground station; a number of its own tells it from the one before."""
    return Command(action, CommandRequest(10_000 + number, (0.0,) * 7, *_STATION))


def _judged(simulation: Simulation, seen: Observer, away_m: float) -> FaultFlight:
    end = simulation.ended
    return FaultFlight(
        texts=tuple(seen.texts),
        actions=tuple(seen.actions),
        contact="" if end is None else contact_of(end.kind, end.sentence),
        ended="" if end is None else end.sentence,
        least_m=simulation.result().min_margin_m,
        away_m=round(away_m, 3) if math.isfinite(away_m) else None,
        force_share=round(simulation.touch.force_share(), 3),
        problem=seen.problem,
    )
