"""The search for the disturbance that pushes the base furthest off its plan.

Three kinds of disturbance, all of full amplitude on the axes they push: adversaries that chase the
vehicle, from a list; adversaries whose weights CMA-ES improves; and sequences of signs, held for
0.1 s, that CMA-ES improves. Each is tried from instants all over the flight, on the fast loops
along the recorded plan. Near the instant at which the calm flight is nearest to a boundary, steps
are tried as well: pushes that begin in still air and last. What counts is the deviation as a share
of the bound that the start-up analysis prints: of the bound for one axis where one axis is pushed,
of the bound for all of them otherwise.

Where the tool is to press on a surface, half of the searches are for the largest force on it, as a
share of what the surface allows, with surfaces of any stiffness and friction that the vehicle is
told of.

The worst of every kind and instant then flies again with everything that flies, and CMA-ES goes on
from the worst of these. That decides about contact. Beyond what the vehicle is told, where a
surface comes or a sensor fails, a force may be too large, but not in silence.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from cmaes import CMA

from fsw.autopilot.control.tube import CALM_HEIGHT, all_axes, all_axes_up_to, limits_used
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.model.prediction import Array
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import TickOutputs
from sitl.disturbances.sequence import Played
from sitl.result import EndKind
from sitl.scenario import V3, Scenario, Sequence
from sitl.simulation import STEP_US, Simulation
from studies.search.plan_record import EVERY, PlanRecord, Start, fly, record
from studies.search.surfaces import BEYOND, WITHIN, Met, met_by, touches, unclaimed
from studies.search.tracked_flight import FEATURES, FILTERED, OFF, PUSH, Disturbance, TrackedFlight
from studies.search.whole_flight import Flown, WholeFlight

STRETCH_TICKS = 2500  # 5 s: the loop has forgotten what was before 3 s
SETTLED_TICKS = 750  # the vehicle is taken over in the air a few millimetres off its plan
HELD_TICKS = 50  # as the paper's disturbance
_SWITCHED = (1, 25, HELD_TICKS)  # ticks between two decisions of an adversary
_AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 1, 1))
_LEADS = ((0.0, 1.0, 0.0), (3.0, 1.0, 0.05), (-3.0, 1.0, 0.0), (1.0, 1.0, 0.25), (0.0, 1.0, -0.1))
_STARTS = 24  # instants of the flight
# s before the calm flight's least margin; a step needs 0.6 s to push as far as it does.
_BEFORE_WORST = (0.6, 0.3, 0.0)
_STEPS = [
    np.array([(x, y, 0.0)]) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0) if x or y
]  # the last row of a table goes on
STEP = "step"
WHOLE_SHARE = 0.1  # of the evaluations, that are stretches of the whole stack
# Weights that matter alike: a position counts three times a velocity, an acceleration a tenth.
_SCALE = np.tile((3.0, 1.0, 0.1), (3, 1))
_NO_TABLE = np.zeros((0, 3))
_NO_WEIGHTS = np.zeros((3, FEATURES))

Report = Callable[[str, float, float], None]


class TooShortError(ValueError):
    """A flight that ends before there is a plan, in one sentence with what to do."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """What the start-up analysis prints [m]."""

    one_axis: float
    one_up: float  # vertically, that axis pushed
    across: float  # a horizontal axis, all axes pushed
    up: float  # vertically, all axes pushed
    all_axes_up_to: float  # m/s²; above it the rotors can saturate and across and up are no claim
    claims_one_axis: bool  # for this amplitude: no limit of the loop is reached
    claims_all_axes: bool
    claims_force: bool = False  # the same for the force on a surface


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
    disturbance: Disturbance
    force_share: float = 0.0  # of what the surface allows; 0: nothing was touched


@dataclass(frozen=True, slots=True)
class Aim:
    """What a search looks for, and what the tool meets meanwhile."""

    met: Met | None = None
    start: Start | None = None  # None: anywhere
    of_force: bool = False  # for as large a force as it can find, not a deviation

    def reached(self, found: Found) -> float:
        """What the search makes as large as it can."""
        return found.force_share if self.of_force else found.share


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a search on the recorded plan found."""

    bounds: Bounds
    evaluations: int
    worst: Found
    worst_of_one_axis: Found | None  # None: no such disturbance was tried
    worst_of_all_axes: Found | None  # more than one
    min_margin: Found
    worst_force: Found | None = None  # None: the tool is to touch nothing

    @property
    def breaks_force(self) -> bool:
        """A surface was pressed on harder than it allows, for an amplitude that is claimed."""
        found = self.worst_force
        return self.bounds.claims_force and found is not None and found.force_share > 1.0

    @property
    def breaks_one_axis(self) -> bool:
        """A deviation beyond the bound for one axis, for an amplitude at which there is one."""
        found = self.worst_of_one_axis
        return self.bounds.claims_one_axis and found is not None and found.share > 1.0

    @property
    def breaks_all_axes(self) -> bool:
        """A deviation beyond the bounds for all axes, for an amplitude at which there are some."""
        found = self.worst_of_all_axes
        return self.bounds.claims_all_axes and found is not None and found.share > 1.0

    @property
    def holds(self) -> bool:
        """No deviation beyond a bound that is claimed for this amplitude."""
        return not (self.breaks_one_axis or self.breaks_all_axes or self.breaks_force)


@dataclass(frozen=True, slots=True)
class WholeFound:
    """One stretch of the whole stack."""

    start: Start
    kind: str
    flown: Flown
    met: Met | None = None


@dataclass(frozen=True, slots=True)
class WholeOutcome:
    """What the whole stack made of the worst disturbances."""

    evaluations: int
    contacts: int
    departures: int  # stretches in which the tube was left
    breaches: int  # stretches in which the safe set was left and the stack noticed
    furthest: WholeFound  # off the plan in force
    closest: WholeFound  # least margin; of those with contact, if there are any
    step: WholeFound | None = None  # least margin of the steps; None: too few evaluations
    hardest: WholeFound | None = None  # largest force within what is claimed
    beyond: tuple[WholeFound, ...] = ()  # with what the analysis makes no claim about

    @property
    def too_hard(self) -> tuple[WholeFound, ...]:
        """Beyond what is claimed: where a surface was pressed on harder than it allows."""
        return tuple(one for one in self.beyond if one.flown.force_share > 1.0)

    @property
    def silent(self) -> tuple[WholeFound, ...]:
        """Of these: where the vehicle pressed on without a word."""
        return tuple(one for one in self.too_hard if not one.flown.left)

    @property
    def presses_too_hard(self) -> bool:
        """A surface was pressed on harder than it allows, within what is claimed."""
        return self.hardest is not None and self.hardest.flown.force_share > 1.0

    @property
    def holds(self) -> bool:
        """Nothing was hit, or pressed on too hard but with a word, beyond what is claimed."""
        return not (self.contacts or self.presses_too_hard or self.silent)


def bounds(config: FlightConfig, disturbance: float) -> Bounds:
    """The bounds for a ``disturbance`` [m/s²] an axis."""
    loop, airframe = loop_tube(config), config.airframe
    across, up = all_axes(airframe, loop, disturbance)
    used = limits_used(airframe, config.tuning.tracking, loop, disturbance)
    return Bounds(
        one_axis=disturbance * loop.base + loop.base_wind,
        one_up=disturbance * loop.height + CALM_HEIGHT,
        across=across,
        up=up,
        all_axes_up_to=all_axes_up_to(airframe, loop, config.surroundings.disturbance),
        claims_one_axis=max(used.values()) <= 1.0,
        claims_all_axes=all_axes_up_to(airframe, loop, disturbance) >= disturbance,
        claims_force=disturbance <= config.surroundings.disturbance,
    )


class Search:
    """Evaluates disturbances of one flight and keeps the worst."""

    def __init__(
        self, scenario: Scenario, config: FlightConfig, flown: PlanRecord, amplitude: float
    ) -> None:
        self.bounds = bounds(config, amplitude)
        self.evaluations = 0
        self._flight = TrackedFlight(scenario, config, flown)
        self._amplitude = amplitude
        self.met: tuple[Met | None, ...] = (None, *WITHIN) if touches(scenario) else (None,)
        last = len(flown.states) - STRETCH_TICKS - 1
        usable = [start for start in flown.starts if start.row <= max(last, 0)]
        usable = [start for start in usable if start.row >= SETTLED_TICKS] or usable[-1:]
        chosen = np.linspace(0, len(usable) - 1, min(_STARTS, len(usable))).astype(int)
        self.starts = [usable[k] for k in chosen]
        nearest = min(range(len(usable)), key=lambda k: usable[k].margin_m)
        before = (round(lead * 500 / EVERY) for lead in _BEFORE_WORST)
        self.worst_starts = [usable[k] for k in sorted({max(nearest - n, 0) for n in before})]
        self._kept: dict[str, Found] = {}
        self._telling: dict[tuple[str, int, str, int], Found] = {}

    def adversary(self, start: Start, every: int, weights: Array, met: Met | None = None) -> Found:
        """Fly against an adversary of ``weights`` (3, FEATURES) [SI]; the tool meets ``met``."""
        return self._judge(start, Disturbance(self._amplitude, every, _NO_TABLE, weights, met))

    def sequence(self, start: Start, table: Array, met: Met | None = None) -> Found:
        """Fly under ``table`` (n, 3) [1, NED], -1 to 1, each held for 0.1 s; as ``adversary``."""
        pushed = Disturbance(self._amplitude, HELD_TICKS, table, _NO_WEIGHTS, met)
        return self._judge(start, pushed)

    def steps(self, most: int) -> list[Found]:
        """Up to ``most`` steps with the least margins, of instants and numbers of axes."""
        found = [
            one
            for (name, _, kind, _), one in self._telling.items()
            if name == "margin" and kind.startswith(STEP)
        ]
        return sorted(found, key=lambda one: one.margin_m)[:most]

    def hard(self, most: int, *, free: bool = False) -> list[Found]:
        """Up to ``most`` finds that press hardest, of kinds, instants and numbers of axes.

        With ``free`` only those that begin without contact.
        """
        found = [
            one
            for (name, *_), one in self._telling.items()
            if name == "force" and not (free and one.start.touches)
        ]
        return sorted(found, key=lambda one: -one.force_share)[:most]

    def outcome(self) -> Outcome:
        """The worst so far."""
        return Outcome(
            self.bounds,
            self.evaluations,
            self._kept["share"],
            self._kept.get("one axis"),
            self._kept.get("all axes"),
            self._kept["margin"],
            self._kept["force"] if len(self.met) > 1 else None,
        )

    def telling(self, most: int) -> list[Found]:
        """Up to ``most`` finds: least margins and worst deviations of kinds and instants."""
        found = sorted(
            self._telling.items(),
            key=lambda item: item[1].margin_m if item[0][0] == "margin" else -item[1].share,
        )
        margins = [one for key, one in found if key[0] == "margin"]
        shares = [one for key, one in found if key[0] not in ("margin", "force")]
        mixed = itertools.chain.from_iterable(itertools.zip_longest(margins, shares))
        unique = {id(one): one for one in mixed if one is not None}
        return list(unique.values())[:most]

    def _judge(self, start: Start, disturbance: Disturbance) -> Found:
        if start.touches:
            disturbance = replace(disturbance, met=None)
        kept, margin, force = self._flight.fly(start, STRETCH_TICKS, disturbance)
        self.evaluations += 1
        off = np.abs(kept[:, OFF : OFF + 3]).max(axis=0)
        pushed = int(np.count_nonzero(np.abs(kept[:, PUSH : PUSH + 3]).max(axis=0)))
        one = pushed == 1
        across = self.bounds.one_axis if one else self.bounds.across
        up = self.bounds.one_up if one else self.bounds.up
        share = float(max(off[0] / across, off[1] / across, off[2] / up))
        if not math.isfinite(share):
            share = math.inf
        found = Found(
            share=share,
            off_m=(float(off[0]), float(off[1]), float(off[2])),
            margin_m=margin,
            axes=pushed,
            start=start,
            kind=_kind(disturbance),
            filtered_ticks=int(kept[:, FILTERED].sum()),
            pushes=(),
            disturbance=disturbance,
            force_share=force,
        )
        axes = "one axis" if one else "all axes"
        # A tool in contact takes the base with it: the bounds are of free flight.
        bounded = () if force > 0.0 else (axes,)
        for name in ("share", *bounded, "margin", "force"):
            best = self._kept.get(name)
            if best is None or _rank(name, found) > _rank(name, best):
                pushes = tuple((float(x), float(y), float(z)) for x, y, z in kept[:, PUSH:FILTERED])
                self._kept[name] = replace(found, pushes=pushes)
        for name in (axes, "margin", *(("force",) if force > 0.0 else ())):
            key = (name, start.step, found.kind, pushed)
            rival = self._telling.get(key)
            if rival is None or _rank(name, found) > _rank(name, rival):
                self._telling[key] = found
        return found


def _rank(name: str, found: Found) -> float:
    if name == "force":
        return found.force_share
    return -found.margin_m if name == "margin" else found.share


def _kind(disturbance: Disturbance) -> str:
    rows = len(disturbance.table)
    if rows == 1:
        return STEP
    return f"{'sequence' if rows else 'adversary'}, held {disturbance.every * 2} ms"


def search_and_fly(
    scenario: Scenario,
    config: FlightConfig,
    amplitude: float,
    evaluations: int,
    seed: int,
    report: Report,
) -> tuple[Outcome, WholeOutcome]:
    """As ``search`` within ``amplitude`` [m/s²], but a tenth are stretches of the whole stack."""
    whole = max(round(WHOLE_SHARE * evaluations), 1)
    tracked = max(evaluations - whole, 1)
    hunt = search(scenario, config, amplitude, tracked, seed, report)
    return hunt.outcome(), _fly_whole(scenario, config, hunt, whole, seed, report)


def search(
    scenario: Scenario,
    config: FlightConfig,
    amplitude: float,
    evaluations: int,
    seed: int,
    report: Report,
) -> Search:
    """Look for the worst disturbance within ``amplitude`` [m/s²]; ``report`` shows progress.

    Raises:
        TooShortError: There is no plan to push the vehicle off.
    """
    flown = record(scenario, config, lambda done, total: report("calm flight", done, total))
    if not flown.starts:
        raise TooShortError(
            f"{scenario.name} ends after {scenario.duration_s:g} s, before the vehicle has a plan: "
            "there is nothing to push it off; give it a longer duration_s"
        )
    hunt = Search(scenario, config, flown, amplitude)
    random = np.random.default_rng(seed)

    def told() -> None:
        report("searched", hunt.evaluations, evaluations)

    for start, table in itertools.product(hunt.worst_starts, _STEPS):
        hunt.sequence(start, table)
        told()
    listed = list(_listed(hunt.starts))
    if len(listed) > 0.4 * evaluations:
        chosen = random.permutation(len(listed))[: max(round(0.4 * evaluations), 1)]
        listed = [listed[k] for k in sorted(chosen)]
    for (start, every, weights), met in zip(listed, itertools.cycle(hunt.met)):
        hunt.adversary(start, every, weights, met)
        told()
    while hunt.evaluations < evaluations:
        budget = min(evaluations - hunt.evaluations, 150)
        start = hunt.starts[int(random.integers(len(hunt.starts)))]
        axes = np.array(_AXES[int(random.integers(len(_AXES)))])
        aim = Aim()
        if len(hunt.met) > 1:
            aim = _drawn_aim(hunt, random)
            start = aim.start or start
        if random.random() < 0.5:
            every = int(random.choice(_SWITCHED))
            _improve_adversary(
                hunt, start, axes, every, budget, int(random.integers(2**31)), told, aim
            )
        else:
            _improve_sequence(hunt, start, axes, budget, int(random.integers(2**31)), told, aim)
    return hunt


def _drawn_aim(hunt: Search, random: np.random.Generator) -> Aim:
    """Half of the time the largest force, from an instant before which there was a large one."""
    met = hunt.met[int(random.integers(len(hunt.met)))]
    hard = hunt.hard(8, free=met is not None)
    if not hard or random.random() < 0.5:
        return Aim(met=met)
    return Aim(met, hard[int(random.integers(len(hard)))].start, of_force=True)


def _fly_whole(
    scenario: Scenario,
    config: FlightConfig,
    hunt: Search,
    evaluations: int,
    seed: int,
    report: Report,
) -> WholeOutcome:
    """Fly the worst finds again with the whole stack; improve the worst of each kind there."""
    whole = evaluations
    hard = hunt.hard(math.ceil(0.2 * evaluations))
    free = hunt.hard(math.ceil(0.1 * evaluations), free=True)
    past = each_with(free, unclaimed(scenario), round(0.3 * evaluations))
    evaluations -= len(hard) + len(past)
    steps = hunt.steps(math.ceil(0.25 * evaluations))
    telling = [one for one in hunt.telling(math.ceil(0.5 * evaluations)) if one.kind != STEP]
    improved: dict[str, Found] = {}
    for found in telling:
        kind = found.kind.partition(",")[0]
        if kind not in improved or found.margin_m < improved[kind].margin_m:
            improved[kind] = found
    each = (evaluations - len(telling) - len(steps)) // max(len(improved), 1)
    flight, flown, beyond = WholeFlight(scenario, config), list[WholeFound](), list[WholeFound]()

    def fly_one(start: Start, disturbance: Disturbance) -> WholeFound:
        stretch = flight.stretch(STRETCH_TICKS, disturbance)
        one = WholeFound(start, _kind(disturbance), stretch, disturbance.met)
        (beyond if disturbance.met in BEYOND else flown).append(one)
        report("flown whole", len(flown) + len(beyond), whole)
        return one

    def value(start: Start, disturbance: Disturbance) -> float:
        one = fly_one(start, disturbance)
        margin = one.flown.margin_m if math.isfinite(one.flown.margin_m) else 0.0
        return max(one.flown.off_m) - margin + (0.0 if one.flown.contact is None else 1.0)

    for step, here in itertools.groupby(
        sorted([*telling, *steps, *hard, *past], key=lambda found: found.start.step),
        key=lambda found: found.start.step,
    ):
        flight.go_to(step, lambda done, total: report("calm flight of the stack", done, total))
        for found in here:
            value(found.start, found.disturbance)
            if any(found is one for one in improved.values()):
                _improve_whole(found, each, seed, value)
    stepped = [one for one in flown if one.kind == STEP]
    touching = [one for one in flown if one.flown.contact is not None]
    return WholeOutcome(
        evaluations=len(flown),
        contacts=len(touching),
        departures=sum(one.flown.departures > 0 for one in flown),
        breaches=sum(one.flown.breaches > 0 for one in flown),
        furthest=max(flown, key=lambda one: max(one.flown.off_m)),
        closest=min(touching or flown, key=lambda one: one.flown.margin_m),
        step=min(stepped, key=lambda one: one.flown.margin_m, default=None),
        hardest=max(flown, key=lambda one: one.flown.force_share) if hard else None,
        beyond=tuple(beyond),
    )


def each_with(finds: list[Found], kinds: tuple[Met, ...], count: int) -> list[Found]:
    """``count`` finds to be flown again, each time round each with another of what is met."""
    turns = (divmod(k, len(finds)) for k in range(count if finds else 0))
    pairs = [(finds[one], kinds[(turn + one) % len(kinds)]) for turn, one in turns]
    return [replace(it, disturbance=replace(it.disturbance, met=met)) for it, met in pairs]


def _improve_whole(
    found: Found, budget: int, seed: int, value: Callable[[Start, Disturbance], float]
) -> None:
    """Improve one find by at most ``budget`` stretches of the whole stack."""
    before = found.disturbance
    table = len(before.table) > 0
    mean = 0.5 * before.table if table else before.weights / _SCALE
    size = max(float(np.abs(mean).max()), 1e-9)
    optimiser = CMA(mean=mean.ravel() / size, sigma=0.4, seed=seed % 2**31, population_size=8)
    for _ in range(budget // optimiser.population_size):
        tried = []
        for _ in range(optimiser.population_size):
            z = optimiser.ask()
            shaped = z.reshape(-1, 3)
            if table:
                acting = np.abs(before.table).max(axis=0)
                changed = replace(before, table=np.where(shaped >= 0.0, 1.0, -1.0) * acting)
            else:
                acting = np.abs(before.weights).max(axis=1, keepdims=True) > 0.0
                changed = replace(before, weights=shaped * _SCALE * acting)
            tried.append((z, -value(found.start, changed)))
        optimiser.tell(tried)


def _listed(starts: list[Start]) -> Iterator[tuple[Start, int, Array]]:
    """The adversaries of the list, most telling first."""
    for lead, axes, every in itertools.product(_LEADS, _AXES, _SWITCHED):
        for start in starts[:: max(len(starts) // 8, 1)]:
            yield start, every, np.outer(axes, lead)


def _improve_adversary(
    hunt: Search,
    start: Start,
    axes: Array,
    every: int,
    budget: int,
    seed: int,
    told: Callable[[], None],
    aim: Aim,
) -> None:
    mean = np.tile((0.0, 1.0, 0.0), (3, 1)).ravel()
    optimiser = CMA(mean=mean, sigma=0.7, seed=seed % 2**31)
    _improve(
        optimiser,
        budget,
        lambda z: aim.reached(
            hunt.adversary(start, every, z.reshape(3, -1) * _SCALE * axes[:, None], aim.met)
        ),
        told,
    )


def _improve_sequence(
    hunt: Search,
    start: Start,
    axes: Array,
    budget: int,
    seed: int,
    told: Callable[[], None],
    aim: Aim,
) -> None:
    values = 3 * STRETCH_TICKS // HELD_TICKS
    random = np.random.default_rng(seed)
    swing = np.sign(np.sin(2.0 * np.pi * random.uniform(0.3, 1.2) * np.arange(values // 3) * 0.1))
    mean = (swing[:, None] * random.choice((-1.0, 1.0), 3)).ravel()
    optimiser = CMA(mean=mean, sigma=0.7, seed=seed % 2**31)
    _improve(
        optimiser,
        budget,
        lambda z: aim.reached(
            hunt.sequence(start, axes * np.where(z.reshape(-1, 3) >= 0.0, 1.0, -1.0), aim.met)
        ),
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


def as_scenario(scenario: Scenario, found: Found) -> Scenario:
    """The scenario calm up to the stretch that was found, which ends it."""
    first, every = found.start.step, found.disturbance.every
    step_s = 1e-6 * STEP_US
    pushes = Sequence(found.pushes[::every], every * step_s, first * step_s, name="worst")
    ends_s = min(scenario.duration_s, (first + len(found.pushes)) * step_s)
    met = found.disturbance.met
    changed = scenario if met is None else met_by(scenario, met)
    return replace(changed, disturbances=(pushes,), duration_s=ends_s)


@dataclass(frozen=True, slots=True)
class Replayed:
    """A disturbance that was found, flown again with planner and referee."""

    off_m: V3
    margin_m: float  # smallest of the stretch, infinite without zones
    ended: str | None  # what was touched, or that the flight diverged
    force_share: float = 0.0  # largest normal force over what its surface allows [1]


def replay(
    scenario: Scenario,
    config: FlightConfig,
    first_step: int,
    pushes: tuple[V3, ...],
    report: Report,
    met: Met | None = None,
) -> Replayed:
    """Fly the whole stack, calm up to ``first_step``, then pushed by one value [m/s²] a step.

    From then on the tool meets ``met``.
    """
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

    def meet(simulation: Simulation, _: FlightState) -> None:
        if simulation.touch and simulation.step == first_step:
            simulation.meet(scenario if met is None else met_by(scenario, met))

    calm, pushed = replace(scenario, disturbances=()), (Played(pushes, first_step, 1),)
    simulation = fly(calm, config, pushed, see, sense=meet, last_step=last + 1)
    ended = simulation.ended
    return Replayed(
        (float(worst[0]), float(worst[1]), float(worst[2])),
        least[0],
        None if ended is None or ended.kind is EndKind.DURATION else ended.sentence,
        simulation.touch.force_share(),
    )
