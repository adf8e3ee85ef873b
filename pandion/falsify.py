"""``pandion falsify``: look for a disturbance that breaks the printed bound; keep the worst."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.bounded_file import read_bounded
from command_line.bounded_json import JsonError, json_object
from command_line.options import read
from command_line.output import console_beside, json_text, print_error, write_text
from command_line.parser import COULD_NOT_START
from command_line.run_directory import new_run_directory
from command_line.version import version
from pandion.display import Display
from pandion.falsify_options import FalsifyOptions
from sitl.scenario import vehicle_of

if TYPE_CHECKING:
    from fsw.autopilot.parameters.flight_config import FlightConfig
    from sitl.scenario import Scenario
    from studies.search.falsify import Found, Outcome, Replayed, WholeFound, WholeOutcome
    from studies.search.surfaces import Met

HOLDS, BROKEN = 0, 1  # exit codes
_FORMAT: Final = "pandion-disturbance-1"
_MM: Final = 1e3
_MAX_BYTES: Final = 64 * 1024 * 1024  # of a file that is read
_STEPS_A_SECOND: Final = 500


class UnusableError(ValueError):
    """A scenario or a file that cannot be searched or flown again."""


def main(argv: list[str]) -> int:
    """Search, or fly again; returns the exit code."""
    what = "Search for the disturbance that pushes the base furthest off its plan."
    options = read(FalsifyOptions, "pandion falsify", what, argv)

    if options.over is not None:
        from pandion.falsify_over import main as search_over

        return search_over(options, options.over)
    from sitl.scenario_file import ScenarioError, load_scenario
    from studies.flight.closed_loop import RefusedError
    from studies.flight.own_parts import OwnPartError
    from studies.search.falsify import TooShortError

    try:
        scenario = load_scenario(options.scenario)
        _check(scenario)
        if options.replay is not None:
            return _replay(options, scenario, options.replay)
        return _search(options, scenario)
    except (
        ScenarioError,
        RefusedError,
        TooShortError,
        UnusableError,
        OwnPartError,
        OSError,
    ) as error:
        print_error("pandion falsify", error)
        return COULD_NOT_START


def _check(scenario: Scenario) -> None:
    if scenario.start.kind != "airborne" or scenario.pilot.plan != "trajectory":
        raise UnusableError(
            f"{scenario.name} does not start in the air on a trajectory; the search needs "
            "start.kind = 'airborne' and pilot.plan = 'trajectory'"
        )


def _config(options: FalsifyOptions, scenario: Scenario) -> FlightConfig:
    from fsw.autopilot.parameters.flight_config import flight_config

    config = flight_config(body=scenario.body, vehicle=vehicle_of(scenario))  # as pandion fly
    if options.own.controller:
        raise UnusableError(
            "--controller flies no plan that it could be pushed off: search with --over"
        )
    if options.own.planner:
        from studies.flight.own_parts import with_parts

        config = with_parts(config, options.own.planner, "")
    if options.params is None:
        return config
    from fsw.autopilot.parameters.contradictions import contradictions
    from fsw.autopilot.parameters.registry import tuning_of
    from fsw.autopilot.tuning import tuned
    from fsw.storage.parameter_file import load

    loaded = load(options.params)
    config = tuned(config, tuning_of(loaded.values))
    for sentence in (*loaded.complaints, *contradictions(config)):
        raise UnusableError(f"{options.params}: {sentence}")
    return config


def _search(options: FalsifyOptions, scenario: Scenario) -> int:
    from sitl.scenario_text import write_scenario
    from studies.search.falsify import as_scenario, search_and_fly

    console = console_beside(options.json)
    display = Display(console)
    folder = options.out or new_run_directory(Path("runs"), f"falsify-{scenario.name}")
    folder.mkdir(parents=True, exist_ok=True)
    display.say(
        f"Pandion {version()}: {scenario.name}, {options.evaluations} evaluations, "
        f"±{options.amplitude:g} m/s² on each axis"
    )
    with display.progress():
        outcome, whole_stack = search_and_fly(
            scenario,
            _config(options, scenario),
            options.amplitude,
            options.evaluations,
            options.seed,
            lambda what, done, total: display.report(
                what, done, total, f"{done:.0f} of {total:.0f}"
            ),
        )
    kept = folder / "worst.json"
    kept.write_text(json_text(_as_file(scenario, outcome.worst)), encoding="utf-8")
    flown = folder / "worst.toml"
    comment = f"found by pandion falsify {options.scenario}: {_found(outcome.worst)}"
    write_scenario(as_scenario(scenario, outcome.worst), flown, comment)
    hardest = outcome.worst_force
    if hardest is not None:
        pressed = folder / "hardest.json"
        pressed.write_text(json_text(_as_file(scenario, hardest)), encoding="utf-8")
    for sentence in _sentences(outcome, options.amplitude) + _of_whole_stack(whole_stack):
        display.say(sentence)
    display.say(f"worst disturbance {kept}; pandion falsify {options.scenario} --replay {kept}")
    display.say(f"as a scenario {flown}; pandion fly {flown}")
    write_text(options.json, json_text(_as_json(options, outcome, whole_stack), 2) + "\n")
    return HOLDS if outcome.holds and whole_stack.holds else BROKEN


def _sentences(outcome: Outcome, amplitude: float) -> list[str]:
    """Each claim: what was found, the bound, and whether it was tested and held."""
    bounds, least = outcome.bounds, outcome.min_margin
    one, many = outcome.worst_of_one_axis, outcome.worst_of_all_axes
    told = []
    if one is not None:
        told.append(
            f"one axis   {_found(one)}, bound {bounds.one_axis * _MM:.0f} mm, vertically "
            f"{bounds.one_up * _MM:.0f} mm: "
            + _verdict(bounds.claims_one_axis, outcome.breaks_one_axis, one.share)
        )
    if many is not None:
        verdict = _verdict(bounds.claims_all_axes, outcome.breaks_all_axes, many.share)
        told.append(
            f"all axes   {_found(many)}, bound {bounds.across * _MM:.0f} mm, vertically "
            f"{bounds.up * _MM:.0f} mm: {verdict}"
        )
    if not bounds.claims_all_axes:
        told.append(
            f"           up to {bounds.all_axes_up_to:.2f} m/s² on all axes the rotors suffice; "
            f"at {amplitude:g} they can saturate"
        )
    if outcome.worst_force is not None:
        found = outcome.worst_force
        verdict = _verdict(bounds.claims_force, outcome.breaks_force, found.force_share)
        told.append(
            f"force      {found.force_share:.0%} of the largest, {_against(found)}: {verdict}"
        )
    margin = "" if math.isinf(least.margin_m) else f", least margin {least.margin_m * _MM:+.1f} mm"
    told.append(f"along the recorded plan {outcome.evaluations} evaluations{margin}")
    return told


def _verdict(claimed: bool, broken: bool, share: float) -> str:
    if not claimed:
        return f"no claim at this amplitude, {share:.0%} of it"
    return f"claim BROKEN, {share:.0%} of it" if broken else f"claim holds, {share:.0%} of it"


def _of_whole_stack(outcome: WholeOutcome) -> list[str]:
    closest, margin = outcome.closest.flown, outcome.closest.flown.margin_m
    near = "" if math.isinf(margin) else f", least margin {margin * _MM:+.1f} mm"
    verdict = f"claim BROKEN: {closest.contact}" if outcome.contacts else "claim holds"
    told = []
    if outcome.step is not None:
        step = outcome.step
        least = step.flown.margin_m
        told.append(
            f"step       begun {step.start.step * 0.002:.1f} s, near the calm flight's least margin"
            + ("" if math.isinf(least) else f": least margin {least * _MM:+.1f} mm")
        )
    hardest = outcome.hardest
    if hardest is not None:
        says = "claim BROKEN" if outcome.presses_too_hard else "claim holds"
        share = hardest.flown.force_share
        told.append(f"force      {share:.0%} of the largest, whole stack ({hardest.kind}): {says}")
    if outcome.beyond:
        told.append(_of_what_is_not_claimed(outcome))
    return [
        *told,
        f"no contact {outcome.evaluations} stretches of the whole stack: {outcome.contacts} with "
        f"contact, {outcome.breaches} beyond the safe set, {outcome.departures} out of the "
        f"tube{near}: {verdict}",
    ]


def _of_what_is_not_claimed(outcome: WholeOutcome) -> str:
    """How often a surface was pressed on too hard beyond what is claimed, and what was said."""
    hard, silent = outcome.too_hard, outcome.silent
    names = ", ".join(sorted({one.met.name for one in hard if one.met is not None}))
    which = f" ({names})" if names else ""
    verdict = "claim holds" if not silent else f"claim BROKEN, {len(silent)} in silence"
    return (
        f"unclaimed  {len(outcome.beyond)} stretches of surfaces and sensors that the analysis "
        f"makes no claim about: {len(hard)} pressed on too hard{which}, none of them to be in "
        f"silence: {verdict}"
    )


def _against(found: Found) -> str:
    met = found.disturbance.met
    surface = "surface as it is" if met is None else f"surface {met.name}"
    return f"{surface} ({found.kind}, from {found.start.step * 0.002:.1f} s)"


def _found(found: Found) -> str:
    x, y, z = (value * _MM for value in found.off_m)
    at = found.start.step * 0.002
    return f"{x:.0f}, {y:.0f}, {z:.0f} mm off the plan ({found.kind}, from {at:.1f} s)"


def _as_json(
    options: FalsifyOptions, outcome: Outcome, whole_stack: WholeOutcome
) -> dict[str, Any]:
    bounds = outcome.bounds
    return {
        "scenario": options.scenario,
        "seed": options.seed,
        "amplitude_m_s2": options.amplitude,
        "evaluations": outcome.evaluations,
        "holds": outcome.holds and whole_stack.holds,
        "claims": _claims(outcome, whole_stack),
        "bound_one_axis_m": bounds.one_axis,
        "bound_one_axis_vertical_m": bounds.one_up,
        "bound_all_axes_up_to_m_s2": bounds.all_axes_up_to,
        "bound_all_axes_m": [bounds.across, bounds.across, bounds.up],
        "worst": _summary(outcome.worst),
        "worst_of_one_axis": _summary(outcome.worst_of_one_axis),
        "worst_of_all_axes": _summary(outcome.worst_of_all_axes),
        "least_margin": _summary(outcome.min_margin),
        "worst_force": _summary(outcome.worst_force),
        "whole_stack": {
            "evaluations": whole_stack.evaluations,
            "contacts": whole_stack.contacts,
            "beyond_the_safe_set": whole_stack.breaches,
            "out_of_the_tube": whole_stack.departures,
            "furthest": _whole(whole_stack.furthest),
            "closest": _whole(whole_stack.closest),
            "step": None if whole_stack.step is None else _whole(whole_stack.step),
            "hardest": None if whole_stack.hardest is None else _whole(whole_stack.hardest),
            "unclaimed": [_whole(one) for one in whole_stack.beyond],
        },
    }


def _claims(outcome: Outcome, whole_stack: WholeOutcome) -> dict[str, bool | None]:
    """Whether each claim held; None: nothing is claimed at this amplitude, or it was not tried."""
    bounds = outcome.bounds
    one = bounds.claims_one_axis and outcome.worst_of_one_axis is not None
    many = bounds.claims_all_axes and outcome.worst_of_all_axes is not None
    return {
        "one_axis": not outcome.breaks_one_axis if one else None,
        "all_axes": not outcome.breaks_all_axes if many else None,
        "no_contact": whole_stack.contacts == 0,
        **_force_claims(outcome, whole_stack),
    }


def _force_claims(outcome: Outcome, whole_stack: WholeOutcome) -> dict[str, bool | None]:
    """Of the force on surfaces; nothing where the tool is to touch none."""
    if outcome.worst_force is None:
        return {}
    kept = not (outcome.breaks_force or whole_stack.presses_too_hard)
    return {
        "force": kept if outcome.bounds.claims_force else None,
        "not_in_silence": not whole_stack.silent,
    }


def _whole(found: WholeFound) -> dict[str, Any]:
    flown = found.flown
    return {
        "off_plan_m": list(flown.off_m),
        "margin_m": flown.margin_m if math.isfinite(flown.margin_m) else None,
        "contact": flown.contact,
        "kind": found.kind,
        "first_step": found.start.step,
        "force_share": flown.force_share,
        "surface": None if found.met is None else found.met.as_json(),
        "told": list(flown.told),
        "left_the_trajectory": flown.left,
    }


def _summary(found: Found | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "share_of_bound": found.share if math.isfinite(found.share) else None,
        "off_plan_m": list(found.off_m),
        "margin_m": found.margin_m if math.isfinite(found.margin_m) else None,
        "axes": found.axes,
        "kind": found.kind,
        "filtered_ticks": found.filtered_ticks,
        "first_step": found.start.step,
        "force_share": found.force_share,
        "surface": None if found.disturbance.met is None else found.disturbance.met.as_json(),
    }


def _as_file(scenario: Scenario, found: Found) -> dict[str, Any]:
    return {
        "format": _FORMAT,
        "scenario": scenario.name,
        "first_step": found.start.step,
        "off_plan_m": list(found.off_m),
        "surface": None if found.disturbance.met is None else found.disturbance.met.name,
        "acceleration_m_s2": [list(push) for push in found.pushes],
    }


def _replay(options: FalsifyOptions, scenario: Scenario, path: Path) -> int:
    from studies.search.falsify import bounds, replay

    first_step, pushes, met = _read(path, scenario)
    config = _config(options, scenario)
    amplitude = max(abs(value) for push in pushes for value in push)
    console = console_beside(options.json)
    display = Display(console)
    with display.progress():
        flown = replay(
            scenario,
            config,
            first_step,
            pushes,
            lambda what, done, total: display.report(
                what, done, total, f"{done:.0f} of {total:.0f} s"
            ),
            met,
        )
    bound = bounds(config, amplitude)
    one = sum(any(push[axis] != 0.0 for push in pushes) for axis in range(3)) == 1
    across, up = (bound.one_axis, bound.one_up) if one else (bound.across, bound.up)
    claimed = bound.claims_one_axis if one else bound.claims_all_axes
    x, y, z = (value * _MM for value in flown.off_m)
    share = max(flown.off_m[0] / across, flown.off_m[1] / across, flown.off_m[2] / up)
    broken = claimed and not share <= 1.0
    display.say(
        f"{x:.1f}, {y:.1f}, {z:.1f} mm off the plan; bound {across * _MM:.0f} mm on a "
        f"horizontal axis, {up * _MM:.0f} mm vertically: {_verdict(claimed, broken, share)}"
    )
    if math.isfinite(flown.margin_m):
        display.say(f"least margin {flown.margin_m * _MM:+.1f} mm")
    too_hard = bound.claims_force and flown.force_share > 1.0
    if flown.force_share > 0.0:
        verdict = _verdict(bound.claims_force, too_hard, flown.force_share)
        display.say(f"force of {flown.force_share:.1%} of the largest: {verdict}")
    if flown.ended is not None:
        display.say(flown.ended)
    write_text(options.json, json_text(_replayed(flown), 2) + "\n")
    return BROKEN if broken or too_hard or flown.ended is not None else HOLDS


def _replayed(flown: Replayed) -> dict[str, Any]:
    return {
        "off_plan_m": list(flown.off_m),
        "margin_m": flown.margin_m if math.isfinite(flown.margin_m) else None,
        "ended": flown.ended,
        "force_share": flown.force_share,
    }


def _read(
    path: Path, scenario: Scenario
) -> tuple[int, tuple[tuple[float, float, float], ...], Met | None]:
    """The first step and the values of a kept disturbance, and what the tool met."""
    from studies.search.surfaces import WITHIN

    surfaces: dict[str | None, Met | None] = {None: None, **{met.name: met for met in WITHIN}}
    try:
        kept = json_object(read_bounded(path, _MAX_BYTES))
        if kept["format"] != _FORMAT:
            raise KeyError("format")
        first = kept["first_step"]
        if isinstance(first, bool) or not isinstance(first, int):
            raise TypeError("first_step")
        met = surfaces[kept.get("surface")]
        pushes = tuple((float(x), float(y), float(z)) for x, y, z in kept["acceleration_m_s2"])
    except JsonError as problem:
        raise UnusableError(f"{path} {problem}; it is no disturbance") from None
    except (KeyError, TypeError, ValueError):
        raise UnusableError(f"{path} is no disturbance that pandion falsify has kept") from None
    values = [value for push in pushes for value in push]
    if not (pushes and first >= 0 and all(abs(value) <= 50.0 for value in values)):
        raise UnusableError(f"{path}: every value must be within ±50 m/s^2, and there must be some")
    if kept.get("scenario") != scenario.name:
        raise UnusableError(f"{path} was found in {kept.get('scenario')}, not in {scenario.name}")
    if first >= scenario.duration_s * _STEPS_A_SECOND:
        raise UnusableError(f"{path}: first_step is after the end, {scenario.duration_s:g} s")
    return first, pushes, met
