"""A campaign file as a frozen plan: flight ``k`` is a pure function of the file and ``k``."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple, TypeAlias, cast

from command_line.bounded_file import read_bounded
from command_line.bounded_toml import TomlError, toml_table
from command_line.ranges import Range
from command_line.toml_tables import nearest
from fsw.autopilot.parameters.contradictions import contradictions
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.parameters.registry import BY_NAME, tuning_of
from fsw.autopilot.tuning import tuned
from sitl.faults.keys import SENSORS, Fault
from sitl.scenario import Scenario, identity, vehicle_of
from sitl.scenario_file import (
    ScenarioError,
    build_table,
    load_scenario,
    named_files,
    suite_of,
)
from sitl.scenario_validation import check
from sitl.sensors.keys import SuiteName
from studies.campaign.keys import (
    AIR,
    DIRECTION,
    FAULT,
    PARAMETERS,
    PUSH,
    CampaignError,
    Flown,
    applied,
    range_of,
    rounded,
)
from studies.campaign.values import (
    MAX_FLIGHTS,
    Choice,
    Design,
    Distribution,
    Normal,
    Turn,
    Uniform,
    design_point,
    drawn,
    grid_point,
    grid_size,
    seed_of,
)
from studies.flight.job import INNER, Job
from studies.flight.own_parts import OwnPartError, with_parts

EXAMPLE: Final = Path(__file__).parent / "example.toml"
Values: TypeAlias = tuple[tuple[str, float], ...]  # of the varied keys, in their order
Controller: TypeAlias = Literal["blf", "hc", "sc", "naive"]
Tracking: TypeAlias = Literal["lqr", "pid"]
# What can fail without processes, links and a battery that is read.
_FAILING: Final = (*SENSORS, "motor", "joint")
_MAX_BYTES: Final = 256 * 1024
_DISTRIBUTIONS: Final = ("uniform", "normal", "choice")
_DIGEST_DIGITS: Final = 32


class OwnNames(NamedTuple):
    """Parts of the user's, ``module:Name``; empty: ours."""

    planner: str = ""
    controller: str = ""


OURS: Final = OwnNames()


@dataclass(frozen=True, slots=True)
class _Keys:
    """The keys of the file, but for the tables ``vary``, ``parameters`` and ``faults``."""

    scenarios: tuple[str, ...]
    flights: Annotated[float, Range(1.0, float(MAX_FLIGHTS), step=1.0)] = 0.0
    duration_s: Annotated[float, Range(0.1, 86400.0)] = math.inf  # as long as the scenario
    seed: Annotated[float, Range(0.0, 2.0**53, step=1.0)] = 0.0
    design: Design = "random"
    suites: tuple[SuiteName, ...] = ()  # none named: the scenario's own
    controllers: tuple[Controller, ...] = ("blf",)
    tracking: Tracking = "lqr"
    allow_inconsistent: bool = False
    without_fault: bool = True  # beside those with the faults
    time_limit_s: Annotated[float, Range(1.0, 86400.0)] = 0.0  # of the machine; 0: by duration
    # module:Name of a planner and a control law in place of ours; empty: ours.
    own_planner: str = ""
    own_controller: str = ""


@dataclass(frozen=True, slots=True)
class Case:
    """One combination of what is named; flights take turns through all of them."""

    scenario: str
    suite: str
    controller: str
    fault: str  # its name; empty: none

    def __str__(self) -> str:
        return ", ".join(part for part in (self.scenario, self.suite, self.controller) if part) + (
            f", {self.fault}" if self.fault else ""
        )


@dataclass(frozen=True, slots=True)
class Varied:
    """A key and how its values are distributed."""

    key: str
    distribution: Distribution

    def __str__(self) -> str:
        return f"{self.key}: {self.distribution}"


@dataclass(frozen=True, slots=True)
class Drawn:
    """What distinguishes flight ``number`` from others."""

    number: int
    case: Case
    values: Values
    seed: int


@dataclass(frozen=True, slots=True)
class PlannedFlight(Drawn):
    """What flight ``number`` consists of."""

    job: Job


@dataclass(frozen=True)
class CampaignPlan:
    """A whole campaign; equal plans have equal flights."""

    name: str
    count: int  # flights that the file asks for
    seed: int
    design: Design
    cases: tuple[Case, ...]
    bases: tuple[Flown, ...]  # of the cases, before anything varies
    varied: tuple[Varied, ...]
    time_limit_s: float  # that a flight may take on its machine
    files: tuple[str, ...] = field(default=(), compare=False)  # scenarios and points beside it
    head: str = field(default="", compare=False)  # lines that were flown as if the file had them

    @cached_property
    def digest(self) -> str:
        """Of everything that a flight depends on but its number and the code."""
        size = self.count if self.design == "latin-hypercube" else 0
        bases = [(identity(base.scenario), base.config) for base in self.bases]
        text = repr((self.seed, self.design, size, self.cases, bases, self.varied))
        return hashlib.sha256(text.encode()).hexdigest()[:_DIGEST_DIGITS]

    def most(self) -> int:
        """How many flights the design has."""
        return self.count if self.design == "latin-hypercube" else MAX_FLIGHTS

    def check(self, count: int) -> None:
        """Refuse more flights than the design has.

        Raises:
            CampaignError: With what to do.
        """
        if count > MAX_FLIGHTS:
            raise CampaignError(f"{count} flights are too many: a campaign has {MAX_FLIGHTS}")
        if count > self.most():
            raise CampaignError(
                f"a {self.design} of {self.most()} flights has no flight {self.most()}; write "
                f"flights = {count} into the file, or choose another design"
            )

    def flight(self, number: int) -> PlannedFlight:
        """Flight ``number``, from 0; the same whatever else is flown.

        Raises:
            ValueError: Its values contradict each other.
        """
        one = self.draw(number)
        flown = applied(self.bases[number % len(self.cases)], one.values)
        check(flown.scenario)
        job = Job("full", flown.scenario, flown.config, one.seed)
        return PlannedFlight(number, one.case, one.values, one.seed, job)

    def draw(self, number: int) -> Drawn:
        """Case, values and seed of flight ``number``."""
        place, case = divmod(number, len(self.cases))
        values = self._values(number, case, place)
        return Drawn(number, self.cases[case], values, seed_of(self.seed, number))

    def _values(self, number: int, case: int, place: int) -> Values:
        kinds = tuple(one.distribution for one in self.varied)
        if not kinds:
            return ()
        if self.design == "grid":
            raw = grid_point(kinds, place)
        else:
            if self.design == "random":
                point = drawn(self.seed, number, len(kinds))
            else:
                size = -(-self.count // len(self.cases))
                point = design_point(self.design, self.seed, case, place, size, len(kinds))
            raw = tuple(one.at(share) for one, share in zip(kinds, point, strict=True))
        base = self.bases[case]
        return tuple(
            (one.key, rounded(one.key, value, range_of(one.key, base)))
            for one, value in zip(self.varied, raw, strict=True)
        )


def load_plan(path: Path, own: OwnNames = OURS) -> CampaignPlan:
    """Read a campaign file; scenarios by path are looked for beside it.

    ``own`` parts are flown as if the file named them.

    Raises:
        CampaignError: It cannot be read, an unknown key, or an impossible value.
    """
    return load_tables(path, (), own)[0]


def load_tables(
    path: Path, more: tuple[str, ...], own: OwnNames = OURS
) -> tuple[CampaignPlan, dict[str, Any]]:
    """Read a campaign file that has ``more`` tables, of its reader's, beside the campaign.

    Raises:
        CampaignError: As of ``load_plan``.
    """
    try:
        content = read_bounded(path, _MAX_BYTES)
    except OSError as error:
        raise CampaignError(f"cannot read {path}: {error.strerror}") from None
    try:
        table = _table(content.decode("utf-8"))
        found = {key: table.pop(key) for key in more if key in table}
        head = ""
        for key, part in (("own_planner", own.planner), ("own_controller", own.controller)):
            if part and table.setdefault(key, part) != part:
                raise CampaignError(f'{key} = "{table[key]}": not flown with "{part}"')
            head += f'{key} = "{part}"\n' if part and key not in content.decode() else ""
        plan = plan_of(table, path.stem, path.parent)
        return replace(plan, head=head), found
    except UnicodeDecodeError:
        raise CampaignError(f"campaign {path} is not TOML: it is not UTF-8") from None
    except CampaignError as error:
        raise CampaignError(f"{path}: {error}") from None


def parse_plan(text: str, name: str, folder: Path) -> CampaignPlan:
    """The plan that a TOML text describes, with scenarios by path from a folder.

    Raises:
        CampaignError: Not TOML, an unknown key, or an impossible value.
    """
    return plan_of(_table(text), name, folder)


def plan_of(table: dict[str, Any], name: str, folder: Path) -> CampaignPlan:
    """The plan that a table describes, as of ``parse_plan``."""
    try:
        vary, parameters, faults = (table.pop(key, {}) for key in ("vary", PARAMETERS, "faults"))
        keys: _Keys = build_table(_Keys, table, "")
        return _plan(keys, name, folder, vary, parameters, faults or [])
    except RecursionError:
        raise CampaignError("nested too deeply") from None
    except ScenarioError as error:
        raise CampaignError(str(error)) from None


def _table(text: str) -> dict[str, Any]:
    try:
        return toml_table(text)
    except TomlError as error:
        raise CampaignError(str(error)) from None


def _plan(
    keys: _Keys, name: str, folder: Path, vary: Any, parameters: Any, faults: Any
) -> CampaignPlan:
    named = _faults(faults)
    fates = ([""] if keys.without_fault or not named else []) + list(named)
    for what, list_ in (("scenarios", keys.scenarios), ("controllers", keys.controllers)):
        if not list_:
            raise CampaignError(f"{what} = []: name at least one")
    fixed = _parameters(parameters)
    cases, bases = [], []
    for scenario, suite, controller, fate in product(
        keys.scenarios, keys.suites or (None,), keys.controllers, fates
    ):
        found = _scenario(scenario, suite, folder, keys.duration_s, named.get(fate))
        config = _config(controller, keys, found, fixed)
        flown_by = keys.own_controller or keys.own_planner or controller
        cases.append(Case(scenario, suite_of(found), flown_by, fate))
        bases.append(Flown(found, config))
    if len(set(cases)) < len(cases):
        raise CampaignError("a scenario, suite, controller or fault is named twice")
    varied = _varied(vary, tuple(bases), keys.design)
    count = int(keys.flights)
    if not count:
        if keys.design != "grid":
            raise CampaignError('missing key "flights" (how many there are to be, such as 200)')
        count = len(cases) * grid_size(tuple(one.distribution for one in varied))
        if count > MAX_FLIGHTS:
            raise CampaignError(
                f"the grid has {count} flights, and a campaign at most {MAX_FLIGHTS}: give fewer "
                'points, or the key "flights" to fly the first of them'
            )
    longest = max(base.scenario.duration_s for base in bases)
    if math.isinf(longest):
        raise CampaignError('missing key "duration_s": the scenario has no end of its own')
    return CampaignPlan(
        name=name,
        count=count,
        seed=int(keys.seed),
        design=keys.design,
        cases=tuple(cases),
        bases=tuple(bases),
        varied=varied,
        time_limit_s=keys.time_limit_s or 900.0 + 10.0 * longest,
        files=_files(keys.scenarios, folder),
    )


def _files(scenarios: tuple[str, ...], folder: Path) -> tuple[str, ...]:
    """Scenarios beside the campaign file, and the points and vehicles that they name."""
    found = [name for name in scenarios if name.endswith(".toml")]
    for one in [one for name in found for one in named_files(folder / name)]:
        if one.is_absolute() != folder.is_absolute() or ".." in one.parts[len(folder.parts) :]:
            raise CampaignError(
                f'scenarios: the file "{one}" that one of them names must be beside the campaign '
                "file or in a folder there, and be named from there, so that the campaign can be "
                "kept as a whole"
            )
        found.append(str(one.relative_to(folder)))
    return tuple(dict.fromkeys(found))


def _scenario(
    name: str, suite: str | None, folder: Path, duration_s: float, fault: Fault | None
) -> Scenario:
    path = Path(name)
    if path.suffix == ".toml":
        if path.is_absolute() or ".." in path.parts:
            raise CampaignError(
                f'scenarios: "{name}" must be beside the campaign file or in a folder there, so '
                "that the campaign can be kept as a whole; copy it there"
            )
        name = str(folder / path)
    found = load_scenario(name, suite)
    if found.start.kind != "airborne" or found.pilot.plan != "trajectory":
        raise CampaignError(
            f'scenarios: "{name}" must start in the air on a trajectory (start.kind = "airborne", '
            'pilot.plan = "trajectory")'
        )
    if not math.isinf(duration_s):
        found = replace(found, duration_s=duration_s)
    if fault is not None:
        found = replace(found, faults=(*found.faults, fault))
    for one in found.faults:
        if one.unit not in _FAILING or one.of_real_time:
            raise CampaignError(
                f"faults: {one} cannot be flown in one process; can be of {', '.join(_FAILING)}"
            )
    check(found)
    return found


def _config(
    controller: str, keys: _Keys, flown: Scenario, fixed: tuple[tuple[str, float], ...]
) -> FlightConfig:
    config = flight_config(
        controller,
        INNER[keys.tracking],
        body=flown.body,
        soft=keys.allow_inconsistent,
        vehicle=vehicle_of(flown),
    )
    config = tuned(config, fixed)
    for sentence in contradictions(config):
        raise CampaignError(f"{PARAMETERS}: {sentence}")
    try:
        return with_parts(config, keys.own_planner, keys.own_controller)
    except OwnPartError as error:
        raise CampaignError(str(error)) from None


def _parameters(table: Any) -> tuple[tuple[str, float], ...]:
    if not isinstance(table, dict):
        raise CampaignError(f"{PARAMETERS}: must be a table, such as [{PARAMETERS}]")
    found = {}
    for name, value in table.items():
        if name not in BY_NAME:
            raise CampaignError(f'unknown parameter "{name}"{nearest(name, BY_NAME)}')
        parameter = BY_NAME[name]
        refusal = parameter.refusal(_number(value, f"{PARAMETERS}.{name}"))
        if refusal is not None:
            raise CampaignError(f"{PARAMETERS}: {refusal}")
        found[name] = parameter.kept(float(value))
    return tuning_of(found)


def _faults(tables: Any) -> dict[str, Fault]:
    if not isinstance(tables, list) or not all(isinstance(one, dict) for one in tables):
        raise CampaignError("faults: must be an array of tables ([[faults]])")
    found: dict[str, Fault] = {}
    for i, table in enumerate(tables):
        fault: Fault = build_table(
            Fault, {k: v for k, v in table.items() if k != "name"}, f"faults[{i}]"
        )
        name = table.get("name", str(fault))
        if not isinstance(name, str) or not name:
            raise CampaignError(f"faults[{i}].name = {name!r}: must be a text")
        if name in found:
            raise CampaignError(f'faults[{i}]: "{name}" is there twice; give one another name')
        found[name] = fault
    return found


def _varied(table: Any, bases: Sequence[Flown], design: Design) -> tuple[Varied, ...]:
    found = []
    for key, entry in _leaves(table, ""):
        allowed = [range_of(key, base) for base in bases]
        ends = Range(
            max(one.low for one in allowed),
            min(one.high for one in allowed),
            next((one.step for one in allowed if one.step is not None), None),
        )
        if key.startswith(f"{FAULT}.") and math.isinf(ends.low):
            raise CampaignError(f"vary.{key}: no fault is flown; add [[faults]]")
        found.append(Varied(key, _distribution(key, entry, ends, design)))
    keys = [one.key for one in found]
    if (PUSH in keys or AIR in keys) and DIRECTION not in keys:
        found.append(Varied(DIRECTION, Uniform(0.0, 360.0, points=8)))
    return tuple(_turned(one) if design == "grid" else one for one in found)


def _turned(varied: Varied) -> Varied:
    """A key of a grid; north is there once, where directions go all the way round."""
    all_ = varied.distribution
    if varied.key == DIRECTION and isinstance(all_, Uniform) and all_.high - all_.low == 360.0:
        return Varied(DIRECTION, Turn(all_.low, all_.high, all_.points))
    return varied


def _leaves(table: Any, prefix: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Dotted keys and their distributions; ``a.b`` and ``"a.b"`` are the same."""
    if not isinstance(table, dict):
        raise CampaignError(
            f"vary{prefix and '.' + prefix} = {table!r}: must be a distribution, such as "
            "{ uniform = [0.9, 1.1] }"
        )
    for key, part in table.items():
        path = f"{prefix}.{key}" if prefix else key
        if isinstance(part, dict) and any(word in part for word in _DISTRIBUTIONS):
            yield path, part
        else:
            yield from _leaves(part, path)


def _distribution(key: str, entry: dict[str, Any], ends: Range, design: Design) -> Distribution:
    path = f"vary.{key}"
    kinds = [word for word in _DISTRIBUTIONS if word in entry]
    if len(kinds) > 1:
        raise CampaignError(f"{path}: must have one of {', '.join(_DISTRIBUTIONS)}, not several")
    kind = kinds[0]
    known = {kind, "points"} | ({"within"} if kind == "normal" else set())
    for word in entry:
        if word not in known:
            raise CampaignError(f'unknown key "{path}.{word}"{nearest(word, known)}')
    numbers = _numbers(entry[kind], f"{path}.{kind}", 0 if kind == "choice" else 2)
    _check_words(key, kind, numbers)
    points = _points(entry, path, design, kind)
    if kind == "normal":
        low, high = _numbers(entry.get("within", [ends.low, ends.high]), f"{path}.within", 2)
        return _normal(path, numbers, (low, high), ends, points)
    for value in numbers:
        if not ends.contains(value):
            raise CampaignError(f"{path} = {value:g}: must be {ends}")
    if kind == "choice":
        return Choice(numbers)
    if not numbers[0] < numbers[1]:
        raise CampaignError(f"{path}.uniform = {list(numbers)}: the first must be below the second")
    return Uniform(numbers[0], numbers[1], points)


def _check_words(key: str, kind: str, numbers: tuple[float, ...]) -> None:
    """A parameter of which only some values mean something takes a choice of them."""
    parameter = BY_NAME.get(key.removeprefix(f"{PARAMETERS}."))
    if parameter is None or not parameter.choices:
        return
    if kind != "choice":
        raise CampaignError(f"vary.{key}: only some values mean something, so give a choice")
    for value in numbers:
        refusal = parameter.refusal(value)
        if refusal is not None:
            raise CampaignError(f"vary.{key}: {refusal}")


def _normal(
    path: str, numbers: tuple[float, ...], within: tuple[float, float], ends: Range, points: int
) -> Normal:
    (mean, deviation), (low, high) = numbers, within
    if not deviation > 0.0:
        raise CampaignError(f"{path}.normal: the deviation must be above 0, not {deviation:g}")
    if not (ends.low <= low < high <= ends.high):
        raise CampaignError(f"{path}.within = [{low:g}, {high:g}]: must be two of {ends}, rising")
    if not low <= mean <= high:
        raise CampaignError(f"{path}.normal: the mean {mean:g} must be within {low:g} to {high:g}")
    return Normal(mean, deviation, low, high, points)


def _points(entry: dict[str, Any], path: str, design: Design, kind: str) -> int:
    points = entry.get("points", 0)
    if "points" in entry and (
        isinstance(points, bool) or not isinstance(points, int) or not 2 <= points <= 10_000
    ):
        raise CampaignError(f"{path}.points = {points!r}: must be a whole number from 2 to 10000")
    if design == "grid" and kind != "choice" and not points:
        raise CampaignError(f"{path}: a grid needs points, such as points = 5, or a choice")
    return cast(int, points)


def _numbers(value: Any, path: str, size: int) -> tuple[float, ...]:
    if not isinstance(value, list) or not value or (size and len(value) != size):
        what = f"{size} numbers" if size else "numbers"
        raise CampaignError(f"{path} = {value!r}: must be an array of {what}")
    return tuple(_number(one, path) for one in value)


def _number(value: Any, path: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise CampaignError(f"{path} = {value!r}: must be a number")
    return float(value)
