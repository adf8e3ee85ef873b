"""The search for the disturbance that pushes the base furthest off its plan.

Three kinds of disturbance, all of full amplitude on the axes they push: adversaries that chase the
vehicle, from a list; adversaries whose weights CMA-ES improves; and sequences of signs, held for
0.1 s, that CMA-ES improves. Each is tried from instants all over the flight. What counts is the
deviation as a share of the bound that the start-up analysis prints: of the bound for one axis where
one axis is pushed, of the bound for all of them otherwise.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from cmaes import CMA

from fsw.control.tube import all_axes, all_axes_up_to
from fsw.flight.state import FlightState
from fsw.model.prediction import Array
from fsw.parameters.consistency import loop_tube
from fsw.parameters.flight_config import FlightConfig
from fsw.signals import TickOutputs
from sitl.disturbances.sequence import Played
from sitl.scenario import V3, Scenario
from sitl.simulation import STEP_US, Simulation
from studies.plan_record import PlanRecord, Start, fly, record
from studies.tracked_flight import FEATURES, FILTERED, OFF, PUSH, Disturbance, TrackedFlight

STRETCH_TICKS = 2500  # 5 s: the loop has forgotten what was before 3 s
HELD_TICKS = 50  # as the paper's disturbance
_SWITCHED = (1, 25, HELD_TICKS)  # ticks between two decisions of an adversary
_AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 1, 1))
_LEADS = ((0.0, 1.0, 0.0), (3.0, 1.0, 0.05), (-3.0, 1.0, 0.0), (1.0, 1.0, 0.25), (0.0, 1.0, -0.1))
_STARTS = 24  # instants of the flight
_NO_TABLE = np.zeros((0, 3))
_NO_WEIGHTS = np.zeros((3, FEATURES))

Report = Callable[[str, float, float], None]


@dataclass(frozen=True, slots=True)
class Bounds:
    """What the start-up analysis prints [m]."""

    one_axis: float
    across: float  # a horizontal axis, all axes pushed
    up: float  # vertically, all axes pushed
    all_axes_up_to: float  # m/s²; above it the rotors can saturate and the last two do not hold


@dataclass(frozen=True, slots=True)
class Found:
    """One stretch, judged."""

    share: float  # of the bound
    off_m: V3  # largest deviation of each axis
    margin_m: float  # smallest to the safe set, infinite without one
    axes: int  # pushed
    start: Start
    kind: str
    filtered_ticks: int  # in which the safety filter acted
    pushes: tuple[V3, ...]  # m/s², one a tick


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a search found."""

    bounds: Bounds
    evaluations: int
    worst: Found
    worst_of_one_axis: Found
    least_margin: Found

    @property
    def holds(self) -> bool:
        """No deviation beyond its bound."""
        return self.worst.share <= 1.0


def bounds(config: FlightConfig, disturbance: float) -> Bounds:
    """The bounds for a ``disturbance`` [m/s²] an axis."""
    loop = loop_tube(config)
    across, up = all_axes(loop, disturbance)
    covered = all_axes_up_to(config.airframe, loop, config.surroundings.disturbance)
    return Bounds(disturbance * loop.base + loop.base_wind, across, up, covered)


class Search:
    """Evaluates disturbances of one flight and keeps the worst."""

    def __init__(
        self, scenario: Scenario, config: FlightConfig, flown: PlanRecord, amplitude: float
    ) -> None:
        self.bounds = bounds(config, amplitude)
        self.evaluations = 0
        self._flight = TrackedFlight(scenario, config, flown)
        self._amplitude = amplitude
        last = len(flown.rows) - STRETCH_TICKS - 1
        usable = [start for start in flown.starts if start.row <= max(last, 0)]
        chosen = np.linspace(0, len(usable) - 1, min(_STARTS, len(usable))).astype(int)
        self.starts = [usable[k] for k in chosen]
        self._kept: dict[str, Found] = {}

    def adversary(self, start: Start, every: int, weights: Array) -> float:
        """Fly against an adversary of ``weights`` (3, FEATURES) [SI]; its share of the bound."""
        return self._judge(start, Disturbance(self._amplitude, every, _NO_TABLE, weights))

    def sequence(self, start: Start, table: Array) -> float:
        """Fly under ``table`` (n, 3) [1, NED], -1 to 1, each held for 0.1 s; as ``adversary``."""
        return self._judge(start, Disturbance(self._amplitude, HELD_TICKS, table, _NO_WEIGHTS))

    def outcome(self) -> Outcome:
        """The worst so far."""
        return Outcome(
            self.bounds,
            self.evaluations,
            self._kept["share"],
            self._kept.get("one axis", self._kept["share"]),
            self._kept["margin"],
        )

    def _judge(self, start: Start, disturbance: Disturbance) -> float:
        kept, margin = self._flight.fly(start, STRETCH_TICKS, disturbance)
        self.evaluations += 1
        off = np.abs(kept[:, OFF : OFF + 3]).max(axis=0)
        pushed = int(np.count_nonzero(np.abs(kept[:, PUSH : PUSH + 3]).max(axis=0)))
        one = pushed == 1 and off[2] < max(off[:2])
        across = self.bounds.one_axis if one else self.bounds.across
        share = float(max(off[0] / across, off[1] / across, off[2] / self.bounds.up))
        if not math.isfinite(share):
            share = math.inf
        ranks = {"share": share, "margin": -margin} | ({"one axis": share} if one else {})
        for name, rank in ranks.items():
            best = self._kept.get(name)
            if best is None or rank > (-best.margin_m if name == "margin" else best.share):
                kind = "sequence" if len(disturbance.table) else "adversary"
                self._kept[name] = Found(
                    share=share,
                    off_m=(float(off[0]), float(off[1]), float(off[2])),
                    margin_m=margin,
                    axes=pushed,
                    start=start,
                    kind=f"{kind}, held {disturbance.every * 2} ms",
                    filtered_ticks=int(kept[:, FILTERED].sum()),
                    pushes=tuple(
                        (float(x), float(y), float(z)) for x, y, z in kept[:, PUSH:FILTERED]
                    ),
                )
        return share


def search(
    scenario: Scenario,
    config: FlightConfig,
    amplitude: float,
    evaluations: int,
    seed: int,
    report: Report,
) -> Outcome:
    """Look for the worst disturbance within ``amplitude`` [m/s²]; ``report`` shows progress."""
    flown = record(scenario, config, lambda done, total: report("calm flight", done, total))
    hunt = Search(scenario, config, flown, amplitude)
    random = np.random.default_rng(seed)

    def told() -> None:
        report("searched", hunt.evaluations, evaluations)

    listed = list(_listed(hunt.starts))
    if len(listed) > 0.4 * evaluations:
        chosen = random.permutation(len(listed))[: max(round(0.4 * evaluations), 1)]
        listed = [listed[k] for k in sorted(chosen)]
    for start, every, weights in listed:
        hunt.adversary(start, every, weights)
        told()
    while hunt.evaluations < evaluations:
        budget = min(evaluations - hunt.evaluations, 150)
        start = hunt.starts[int(random.integers(len(hunt.starts)))]
        if random.random() < 0.5:
            every = int(random.choice(_SWITCHED))
            _improve_adversary(hunt, start, every, budget, int(random.integers(2**31)), told)
        else:
            _improve_sequence(hunt, start, budget, int(random.integers(2**31)), told)
    return hunt.outcome()


def _listed(starts: list[Start]) -> Iterator[tuple[Start, int, Array]]:
    """The adversaries of the list, most telling first."""
    for lead, axes, every in itertools.product(_LEADS, _AXES, _SWITCHED):
        for start in starts[:: max(len(starts) // 8, 1)]:
            yield start, every, np.outer(axes, lead)


def _improve_adversary(
    hunt: Search, start: Start, every: int, budget: int, seed: int, told: Callable[[], None]
) -> None:
    # Weights that matter alike: a position counts three times a velocity, an acceleration a tenth.
    scale = np.tile((3.0, 1.0, 0.1), (3, 1))
    mean = np.tile((0.0, 1.0, 0.0), (3, 1)).ravel()
    optimiser = CMA(mean=mean, sigma=0.7, seed=seed % 2**31)
    _improve(
        optimiser, budget, lambda z: hunt.adversary(start, every, z.reshape(3, -1) * scale), told
    )


def _improve_sequence(
    hunt: Search, start: Start, budget: int, seed: int, told: Callable[[], None]
) -> None:
    values = 3 * STRETCH_TICKS // HELD_TICKS
    random = np.random.default_rng(seed)
    swing = np.sign(np.sin(2.0 * np.pi * random.uniform(0.3, 1.2) * np.arange(values // 3) * 0.1))
    mean = (swing[:, None] * random.choice((-1.0, 1.0), 3)).ravel()
    optimiser = CMA(mean=mean, sigma=0.7, seed=seed % 2**31)
    _improve(
        optimiser,
        budget,
        lambda z: hunt.sequence(start, np.where(z.reshape(-1, 3) >= 0.0, 1.0, -1.0)),
        told,
    )


def _improve(
    optimiser: CMA, budget: int, value: Callable[[Array], float], told: Callable[[], None]
) -> None:
    done = 0
    while done < budget:
        tried = []
        for _ in range(optimiser.population_size):
            z = optimiser.ask()
            tried.append((z, -min(value(z), 1e6)))
            told()
        done += len(tried)
        optimiser.tell(tried)


@dataclass(frozen=True, slots=True)
class Replayed:
    """A disturbance that was found, flown again with planner and referee."""

    off_m: V3
    margin_m: float  # smallest of the stretch, infinite without zones
    ended: str | None  # why, if before the stretch was over


def replay(
    scenario: Scenario,
    config: FlightConfig,
    first_step: int,
    pushes: tuple[V3, ...],
    report: Report,
) -> Replayed:
    """Fly the whole stack, calm up to ``first_step``, then pushed by one value [m/s²] a step."""
    worst, last = np.zeros(3), first_step + len(pushes) - 1
    arrived: list[Array] = []
    least = [math.inf]

    def see(simulation: Simulation, _: FlightState, outputs: TickOutputs) -> None:
        plan = outputs.snapshot.plan_state
        if plan is not None and arrived:
            np.maximum(worst, np.abs(arrived[0] - np.array(plan.p)), out=worst)
        arrived.clear()
        if simulation.step > first_step:
            truth = simulation.truth()
            arrived.append(np.array(truth.p_WB))
            least[0] = min(least[0], *truth.margins_m, math.inf)
        if simulation.step % 500 == 0:
            report("flown", simulation.time_s, last * 1e-6 * STEP_US)

    calm = replace(scenario, disturbances=())
    simulation = fly(calm, config, (Played(pushes, first_step, 1),), see, last_step=last + 1)
    ended = simulation.ended
    return Replayed(
        (float(worst[0]), float(worst[1]), float(worst[2])),
        least[0],
        None if ended is None else ended.sentence,
    )
