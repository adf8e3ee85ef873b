"""``pandion.fly``: one flight from Python, with own parts where there are any."""

from __future__ import annotations

import math
import subprocess
import sys
import time
from collections.abc import Collection, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Literal, TypeVar, get_args

import numpy as np

from command_line.bounded_json import read_json
from command_line.revision import revision
from fsw.autopilot.parameters.contradictions import agreed
from fsw.autopilot.parameters.flight_config import CONTROLLERS, FlightConfig, flight_config
from fsw.autopilot.parameters.registry import BY_NAME, tuning_of
from fsw.autopilot.signals import TickInputs, TickOutputs
from fsw.autopilot.tuning import flat
from fsw.log.flight_log import FlightLog, LogSubject, vehicle_facts
from fsw.storage.parameter_file import load, save
from pandion.flown import Result, Verdict, write_json
from pandion.join_truth import join_truth
from pandion.references import AnyReference, trajectory
from pandion.result import FlightReports, as_json
from pandion.scenarios import AnyScenario, load_scenario, save_scenario
from sitl.gripped import PayloadUse
from sitl.limits import LimitUse
from sitl.result import TruthResult
from sitl.scenario import Body, Points, vehicle_of
from sitl.scenario_file import ScenarioError, scenario_digest, suite_of
from sitl.simulation import STEP_US, Simulation
from sitl.touch import TouchUse
from sitl.truth_log import TruthLog
from studies.flight.closed_loop import simulate
from studies.flight.fly_again import changed_parameters, fly_words
from studies.flight.job import INNER, Job, score
from studies.flight.kernels import compile_first
from studies.flight.own_parts import OwnLaw, OwnParts, PushLaw
from studies.flight.result import FlightResult

Tracking = Literal["lqr", "pid"]
Word = TypeVar("Word", bound=str)
_MAX_BYTES: Final = 16 * 1024 * 1024  # of a result that is read


def fly(
    scenario: AnyScenario = "walls",
    seed: int = 0,
    *,
    sensors: str | None = None,
    duration_s: float | None = None,
    params: Mapping[str, float] | Path | str | None = None,
    planner: Any = None,
    controller: str | OwnLaw | type[Any] = "blf",
    reference: AnyReference | None = None,
    disturbance: PushLaw | None = None,
    tracking: Tracking = "lqr",
    body: Body | None = None,
    safety_filter: bool = True,
    allow_inconsistent: bool = False,
    allow_slow: bool = False,
    vehicle: str | None = None,
    log: bool = True,
    processes: bool = False,
) -> Result:
    """Fly a scenario to its end, and judge the flight.

    In this process, as a campaign does: equal arguments fly the same flight, to the last bit, and
    ``row`` is the row of a campaign. ``processes`` flies what ``pandion fly`` does, flight software
    and simulator as two processes: what is measured is then rounded by the messages.

    Args:
        scenario: Name, path of a ``.toml`` file, or a ``Scenario``.
        seed: Root of all randomness, 0 or more.
        sensors: ``perfect``, ``mocap``, ``vio``, ``rtk`` or ``gnss``; None: the scenario's.
        duration_s: How long it is flown [s]; None: as the scenario says.
        params: Parameters by name, or the path of a ``.params`` file.
        planner: An object with ``plan(request)``, a class of them, or ``"module:Name"``.
        controller: Predictive controller ``blf``, ``hc``, ``sc`` or ``naive``; or an own law: every
            2 ms an ``Observation`` to thrusts (rotors,) [N] and joint torques (joints,) [N m].
        reference: Of the end-effector: a callable of time [s] or a table; see
            ``pandion.references``.
        disturbance: Acceleration (3,) [m/s², NED] of the base at a time [s], on top of the
            scenario's.
        tracking: Inner loop that tracks the plan, ``lqr`` or ``pid``.
        body: What keeps clear of zones, ``full`` or ``points``; None: the scenario's.
        safety_filter: False: nothing keeps a controller off a zone, and the flight says so.
        allow_inconsistent: Fly a configuration that cannot keep its safe set.
        allow_slow: Fly own parts that a vehicle could not wait for.
        vehicle: One that comes with Pandion, or the path of a ``.toml`` file; None: the
            scenario's.
        log: Keep a log, for ``topics``, ``report`` and ``view``; without it is twice as fast.
        processes: See above; not with own parts, but with a reference.

    Raises:
        ScenarioError: The scenario cannot be flown.
        OwnPartError: An own part cannot be flown with.
        RefusedError: The vehicle refuses to arm or to follow.
        ValueError: An argument is unknown or out of range.
    """
    flown = load_scenario(scenario, sensors=sensors, duration_s=duration_s, vehicle=vehicle)
    if reference is not None:
        curve, start = trajectory(reference, flown.duration_s), flown.start
        if isinstance(curve, Points) and curve.yaw_deg:
            yaw = math.degrees(math.remainder(math.radians(curve.yaw_deg[0]), 2.0 * math.pi))
            start = replace(start, yaw_deg=yaw)
        flown = load_scenario(replace(flown, trajectory=curve, start=start))
    if flown.start.kind != "airborne" or flown.pilot.plan != "trajectory":
        raise ScenarioError(
            f'scenario "{flown.name}" starts on the ground or without a trajectory, which '
            "pandion.fly does not fly; `pandion fly` does"
        )
    if math.isinf(flown.duration_s):
        raise ScenarioError(f'scenario "{flown.name}" has no end of its own: give duration_s')
    if not isinstance(seed, int | np.integer) or seed < 0:
        raise ScenarioError(f"seed = {seed}: must be a whole number, 0 or more")
    own = not (isinstance(controller, str) and controller in CONTROLLERS)
    if isinstance(controller, str) and own and ":" not in controller:
        known = ", ".join(CONTROLLERS)
        raise ValueError(f'unknown controller "{controller}"; known: {known}, or module:Name')
    name = "blf" if own else str(controller)
    config = flight_config(
        name,
        INNER[_known("tracking", tracking, INNER)],
        body=_known("body", body or flown.body, get_args(Body)),
        soft=allow_inconsistent,
        vehicle=vehicle_of(flown),
    )
    config = with_parameters(config, params)
    if not safety_filter:
        config = replace(config, safety_filter=replace(config.safety_filter, enabled=0))
    parts = OwnParts(planner, controller if own else None, disturbance, allow_slow)
    job = Job("full", flown, config, int(seed))
    if not processes:
        compile_first()
        return _in_this_process(job, parts, log=log)
    if parts != OwnParts(allow_slow=allow_slow) or not safety_filter:
        raise ValueError("processes=True flies no own planner, controller or disturbance")
    given = str(scenario) if isinstance(scenario, str) and reference is None else None
    return _in_two_processes(job, given, sensors, duration_s, vehicle)


def _known(what: str, word: Word, known: Collection[Word]) -> Word:
    """The word, if it is a known one."""
    if word not in known:
        raise ValueError(f'unknown {what} "{word}"; known: {", ".join(known)}')
    return word


def with_parameters(
    config: FlightConfig, params: Mapping[str, float] | Path | str | None
) -> FlightConfig:
    """A configuration with parameters by name, or from a file.

    Raises:
        ValueError: An unknown name, a value out of range, or values that contradict each other.
    """
    if params is None:
        return config
    if not isinstance(params, Mapping):
        loaded = load(Path(params))
        if loaded.complaints:
            raise ValueError(f"{params}: {loaded.complaints[0]}")
        params = loaded.values
    values = {}
    for name, value in params.items():
        parameter = BY_NAME.get(name)
        if parameter is None:
            raise ValueError(f'unknown parameter "{name}"; `pandion param` lists all')
        refusal = parameter.refusal(float(value))
        if refusal is not None:
            raise ValueError(refusal)
        values[name] = parameter.kept(float(value))
    return agreed(config, tuning_of(values))


class _Recording:
    """The logs of a flight in this process, with the names that ``pandion fly`` gives them."""

    def __init__(self, job: Job, folder: Path) -> None:
        scenario, config = job.scenario, job.config
        written = save_scenario(scenario, folder / "scenario.toml")
        facts: dict[str, str | int] = {
            "ver_sw": revision(),
            "scenario": scenario.name,
            "scenario_digest": scenario_digest(str(written)),
            "controller": config.controller,
            "inner": config.inner,
            "robustness": "consistent",
            "solver": config.planner.solver,
            "body": config.planner.body,
            "soft": int(config.soft),
            "seed": job.seed,
            **vehicle_facts(vehicle_of(scenario)),
        }
        values = {name: one.read(config) for name, one in BY_NAME.items()}
        subject = LogSubject(
            facts,
            flat(config),
            values,
            config.airframe,
            config.log_profile,
        )
        self._flight = FlightLog(folder / "flight.ulg", subject)
        self._truth = TruthLog(folder / "truth.ulg", scenario, job.seed, lambda _: None)
        self._folder, self._begun = folder, False
        self.outputs: TickOutputs | None = None  # of the last tick
        self.lost: tuple[str, ...] = ()  # what could not be written, and why

    def add(self, simulation: Simulation, inputs: TickInputs, outputs: TickOutputs) -> None:
        """Log a tick and the true state at its beginning."""
        if not self._begun:
            self._flight.begin(inputs.sensors.t_us, lockstep=True)
            self._begun = True
        self._flight.add(inputs, outputs)
        self._truth.add(simulation)
        self.outputs = outputs

    def close(self) -> None:
        """Write what is left, and join both."""
        self._flight.close()
        self._truth.close()
        file = self._flight.file
        self.lost = (*file.lost, *self._truth.file.lost)
        join_truth(self._folder, {"files": {file.path.name: {"failure": file.failure}}})


def _in_this_process(job: Job, parts: OwnParts, *, log: bool) -> Result:
    if not log:
        began_s = time.perf_counter()
        result = simulate(job.scenario, job.seed, job.config, parts=parts)
        reports = _reports(job, result, None, time.perf_counter() - began_s)
        return Result(_verdict(job, result, as_json(reports)), None)
    folder = TemporaryDirectory(prefix="pandion-")
    recording, began_s = _Recording(job, Path(folder.name)), time.perf_counter()
    try:
        result = simulate(job.scenario, job.seed, job.config, parts=parts, seen=recording.add)
    finally:
        recording.close()
    reports = _reports(job, result, recording.outputs, time.perf_counter() - began_s)
    metrics = as_json(replace(reports, unwritten=recording.lost))
    beside = {"sitl": reports.sitl or {}, "fsw": reports.fsw or {}}
    write_json(Path(folder.name), result=metrics, **beside)
    return Result(_verdict(job, result, metrics), folder)


def _verdict(job: Job, result: FlightResult, metrics: Mapping[str, Any]) -> Verdict:
    return Verdict(
        job.scenario,
        job.seed,
        result.truth,
        metrics,
        score(job, result),
        tuple(result.planner.texts),
        result.planner.overridden_s,
    )


def _reports(
    job: Job, result: FlightResult, last: TickOutputs | None, took_s: float
) -> FlightReports:
    """What both processes would report; times are of the processor, and none of the tick's."""
    truth, planner, config = result.truth, result.planner, job.config
    steps = sorted(planner.step_us) or [0.0]
    sitl = {
        "scenario": job.scenario.name,
        "seed": job.seed,
        "vehicle": vehicle_of(job.scenario).name,
        "sensors": suite_of(job.scenario),
        **asdict(truth),
        "real_time_factor": truth.duration_s / max(took_s, 1e-9),
        "steps": round(1e6 * truth.duration_s / STEP_US),
        "wall_s": took_s,
    }
    mpc = {
        "horizon": config.planner.horizon,
        "rate_hz": 1e6 / config.mpc_period_us,
        "sqp_iterations": config.planner.sqp_iterations,
        "p50_us": steps[len(steps) // 2],
        "p99_us": steps[min(len(steps) * 99 // 100, len(steps) - 1)],
        "max_us": steps[-1],
        "missed_deadlines": 0,
        "fallbacks": planner.failures,
        "status": {"solved": planner.plans, "failed": planner.failures},
    }
    safety = {} if last is None else asdict(last.snapshot.safety)
    fsw = {"controller": config.controller, **planner.metrics.as_json(), "mpc": mpc}
    fsw |= {"safety": safety, "inner": {}}
    return FlightReports(job.scenario.name, job.seed, config.controller, sitl, fsw, None, {})


def _in_two_processes(
    job: Job,
    given: str | None,
    sensors: str | None,
    duration_s: float | None,
    vehicle: str | None,
) -> Result:
    folder = TemporaryDirectory(prefix="pandion-")
    out = Path(folder.name) / "flight"
    words = ["--api=none", f"--out={out}"]
    if given is None:
        given = str(save_scenario(job.scenario, Path(folder.name) / f"{job.scenario.name}.toml"))
    else:
        words += [f"--sensors={sensors}"] if sensors is not None else []
        words += [f"--duration={duration_s!r}"] if duration_s is not None else []
        words += [f"--vehicle={vehicle}"] if vehicle is not None else []
    changed, params = changed_parameters(job.config), None
    if changed:
        params = Path(folder.name) / "own.params"
        save(params, changed)
    command = fly_words(job, job.config.controller, given, params)
    ran = subprocess.run(
        [sys.executable, "-m", "pandion", *command, *words],
        capture_output=True,
        text=True,
        check=False,
    )
    if not (out / "sitl.json").exists():
        raise RuntimeError(ran.stderr.strip() or "the flight could not be started")
    metrics = read_json(out / "result.json", _MAX_BYTES)
    found = read_json(out / "sitl.json", _MAX_BYTES)
    known = TruthResult.__dataclass_fields__
    found["limits"] = {key: LimitUse(**use) for key, use in found["limits"].items()}
    found["touches"] = {name: TouchUse(**use) for name, use in found["touches"].items()}
    held = found["payload"]
    found["payload"] = None if held is None else PayloadUse(**held)
    truth = TruthResult(**{key: value for key, value in found.items() if key in known})
    truth = replace(truth, completed=metrics["completed"], end_reason=metrics["end_reason"])
    result = Result(Verdict(job.scenario, job.seed, truth, metrics), folder)
    result._path = out
    return result
