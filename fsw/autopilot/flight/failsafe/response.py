"""What follows from the active rows of the failsafe table: an action, and what is told of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

from fsw.autopilot.flight.failsafe.conditions import Action, Condition, FailsafeMemory
from fsw.autopilot.flight.failsafe.evidence import lost_sensors
from fsw.autopilot.flight.failsafe.table import Failsafe
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.signals import FailsafeEvent, Mode, Severity, StatusText

_SHORT: Final = 1.0  # s


@dataclass(frozen=True, slots=True)
class Response:
    """What follows from the active conditions now."""

    memory: FailsafeMemory
    reports: tuple[StatusText, ...] = ()
    action: Action = Action.NONE  # to be begun now: one that switches to a mode, or none


def respond(context: Situation, rows: tuple[Failsafe, ...]) -> Response:
    """The strongest action of the active ``rows``, and what the operator is told.

    It is taken where it is stronger than the one in force. So what a condition asks for
    is taken up as soon as a mode that was exempt from it is left, and a vehicle that returns or
    lands is not sent back by a milder condition. Where a row is delayed the vehicle holds first,
    or does what the rows ask for that are not. Conditions that a command of the pilot put aside do
    not act until they have ended.
    """
    state, now_us = context.state, context.estimate.t_us
    vehicle, memory = state.vehicle, state.vehicle.failsafe
    before = vehicle.conditions
    now = tuple([row.condition for row in rows])
    known = dict(zip(before, memory.since_us, strict=False))
    joint, contradiction = state.damage.joint, context.contradiction
    sensors = tuple([one.sensor for one in lost_sensors(context)])
    # A second joint or sensor that fails is the same condition, and news: it acts as the first did.
    changed = {
        Condition.JOINT_FAILED: joint != memory.joint,
        Condition.SENSOR_LOST: any(one not in memory.sensors for one in sensors),
        Condition.PARAMETERS_CONTRADICT: contradiction != memory.contradiction,
    }
    overridden = tuple([c for c in memory.overridden if c in now and not changed.get(c)])
    actions = {
        row.condition: allowed(row.action(context), vehicle.mode, vehicle.flies) for row in rows
    }
    free = [row for row in rows if row.condition not in overridden]
    chosen = _strongest(context, free, actions)
    at_once = _strongest(
        context, [row for row in free if not _is_delayed(row, actions[row.condition])], actions
    )
    begun, acting, memory = _begun(context, memory, chosen, at_once)
    waits = memory.pending is not Action.NONE
    reports = []
    for row in rows:
        acts = row in acting
        if row.condition in before and not (acts or changed.get(row.condition)):
            continue
        later = waits and row is chosen.row
        told = actions[row.condition]
        if told.mode is not None and not (acts or later):
            told = Action.WARN
        if told is not Action.NONE:
            delay_us = memory.due_us - now_us if later else 0
            severity, text = report(row, context, told, delay_us)
            event = FailsafeEvent(row.condition.value, told.value, severity)
            if later:
                event = event._replace(
                    action=Action.HOLD.value, later=told.value, delay_us=delay_us
                )
            reports.append(StatusText(severity, text, event, prompt=told.mode is not None))
    if vehicle.armed:
        reports += _ended(before, known, now, now_us)
    since = tuple([known.get(condition, now_us) for condition in now])
    after = memory._replace(
        since_us=since,
        overridden=overridden,
        joint=joint,
        sensors=sensors,
        contradiction=contradiction,
    )
    return Response(after, tuple(reports), begun)


def allowed(action: Action, mode: Mode, flies: bool) -> Action:
    """The action in a mode: what lands already is not sent elsewhere, what stands stays."""
    if action.mode is None:
        return action
    if not flies:
        return Action.WARN
    if mode is Mode.RETURN:
        return Action.WARN if action is Action.RETURN else action
    comes_down = mode in (Mode.LAND, Mode.DESCEND)
    return Action.WARN if comes_down and action.strength <= _OF_MODES[mode].strength else action


_OF_MODES: Final = {
    one.mode: one for one in (Action.HOLD, Action.RETURN, Action.LAND, Action.DESCEND)
}


def _in_force(memory: FailsafeMemory, mode: Mode, *, begins: bool) -> Action:
    """The action that another one must be stronger than.

    A condition that lasts has been acted upon, even if that is done: a vehicle that has returned
    and holds does not return again. One that ``begins`` is held against what is flown now.
    """
    if not begins or memory.action is Action.NONE:
        return memory.action
    flown = _OF_MODES.get(mode, Action.NONE)
    return flown if flown.strength < memory.action.strength else memory.action


class _Choice(NamedTuple):
    """The strongest action that is stronger than the one in force, and its row."""

    action: Action
    row: Failsafe | None


_NOTHING: Final = _Choice(Action.NONE, None)


def _is_delayed(row: Failsafe, action: Action) -> bool:
    return row.delayed and action in (Action.RETURN, Action.LAND)


def _strongest(
    context: Situation, rows: list[Failsafe], actions: dict[Condition, Action]
) -> _Choice:
    """Of the ``actions`` of these rows; none, where what is in force is as strong."""
    vehicle, found = context.state.vehicle, _NOTHING
    for row in rows:
        action = actions[row.condition]
        begins = row.condition not in vehicle.conditions
        in_force = _in_force(vehicle.failsafe, vehicle.mode, begins=begins)
        if action.mode and action.strength > max(in_force.strength, found.action.strength):
            found = _Choice(action, row)
    return found


def _begun(
    context: Situation, memory: FailsafeMemory, chosen: _Choice, at_once: _Choice
) -> tuple[Action, tuple[Failsafe | None, ...], FailsafeMemory]:
    """The action to begin now, the rows that act by it, and the memory with it.

    ``at_once`` is chosen of the rows that are not delayed.
    """
    now_us, wanted, row = context.estimate.t_us, chosen.action, chosen.row
    if row is None:
        # What was waited for, if anything, has ended: the vehicle stays in hold.
        return Action.NONE, (), memory._replace(pending=Action.NONE, due_us=0)
    if _is_delayed(row, wanted):
        waits = memory.pending is not Action.NONE
        if waits and now_us < memory.due_us:
            return _meanwhile(memory._replace(pending=wanted), at_once, ())
        delay_us = context.limits.failsafe_delay_us
        held = memory.action is Action.NONE or context.state.vehicle.mode is Mode.HOLD
        if not waits and delay_us and held:
            waiting = memory._replace(pending=wanted, due_us=now_us + delay_us)
            hold = _Choice(Action.HOLD, row)
            # A vehicle that draws back from a wall goes on with that.
            first = _NOTHING if memory.action in (Action.HOLD, Action.RETREAT) else hold
            return _meanwhile(waiting, first if at_once.row is None else at_once, (row,))
    acting = memory._replace(action=wanted, cause=row.condition, pending=Action.NONE, due_us=0)
    return wanted, (row,), acting


def _meanwhile(
    memory: FailsafeMemory, first: _Choice, rows: tuple[Failsafe | None, ...]
) -> tuple[Action, tuple[Failsafe | None, ...], FailsafeMemory]:
    """What is begun while a delayed action waits; ``rows`` tell of it as well."""
    if first.row is None:
        return Action.NONE, rows, memory
    acting = memory._replace(action=first.action, cause=first.row.condition)
    return first.action, (*rows, first.row), acting


def _ended(
    before: tuple[Condition, ...],
    since: dict[Condition, int],
    now: tuple[Condition, ...],
    now_us: int,
) -> list[StatusText]:
    """What is over, where it lasted for a second: once."""
    reports = []
    for condition in before:
        seconds = 1e-6 * (now_us - since.get(condition, now_us))
        if condition not in now and seconds >= _SHORT:
            event = FailsafeEvent(condition.value, Action.NONE.value, Severity.INFO, over=True)
            text = f"over: {condition.value}, after {seconds:.1f} s"
            reports.append(StatusText(Severity.INFO, text, event))
    return reports


def overridden(memory: FailsafeMemory, conditions: tuple[Condition, ...]) -> FailsafeMemory:
    """The memory after the pilot has commanded a mode: active conditions do not act any more."""
    return memory._replace(
        action=Action.NONE, cause=None, pending=Action.NONE, due_us=0, overridden=conditions
    )


def report(
    row: Failsafe, context: Situation, action: Action, delay_us: int = 0
) -> tuple[Severity, str]:
    """What the operator reads when a condition becomes active; it acts after ``delay_us`` [us]."""
    text = f"{row.condition.value}{row.detail(context)}"
    if action is Action.TERMINATE:
        return Severity.EMERGENCY, f"{text}: {action.value}"
    if action.mode is not None:
        later = f" in {1e-6 * delay_us:.0f} s" if delay_us else ""
        return Severity.CRITICAL, f"failsafe: {text}, {action.value}{later}"
    return row.severity, f"{text}: {action.value}" if row.of_vehicle else text
