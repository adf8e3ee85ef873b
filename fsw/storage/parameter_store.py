"""The values of all parameters, and changes on their way into use.

A change passes four stages: its range is checked at once; its flight loop is designed in a thread,
because that takes longer than a tick; a tick takes it over or refuses it; and it is written to the
file, again in the thread, before it is confirmed. One change at a time is under way,
the others wait, and every link hears of each.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from typing import Final

from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.registry import BY_NAME, PARAMETERS, tuning_of
from fsw.autopilot.tuning import Tuning

Prepare = Callable[[Tuning], object]
"""Makes ready what a tuning needs; raises ValueError where its numbers contradict each other."""

Save = Callable[[Mapping[str, float]], None]
"""Writes all values down; raises OSError."""

WAITING: Final = 64  # changes; a client sends one at a time and repeats it
# Between two changes: a flood of changes gets a third of a core, not all of it.
REST_TICKS: Final = 10


@dataclass(eq=False, slots=True)
class Listener:
    """What one link has not yet reported to its peers."""

    changed: dict[str, None] = field(default_factory=dict)  # names, in order
    texts: deque[str] = field(default_factory=lambda: deque(maxlen=WAITING))


@dataclass(frozen=True, slots=True)
class _Change:
    """One requested change, of one parameter or of several at once."""

    values: Mapping[str, float]
    asker: Listener

    @property
    def name(self) -> str:
        """What it changes, at the beginning of a sentence."""
        return next(iter(self.values)) if len(self.values) == 1 else "every parameter"


class ParameterStore:
    """Shared by all links; only what the executor is handed runs outside the loop's thread."""

    def __init__(self, config: FlightConfig, prepare: Prepare) -> None:
        """Start with the values of a configuration; prepare is called in the executor's thread."""
        self.airframe: Final = config.airframe
        self.defaults: Final[Mapping[str, float]] = {p.name: p.read(config) for p in PARAMETERS}
        self._values = dict(self.defaults)
        self._prepare = prepare
        self._executor: Executor | None = None
        self._save: Save | None = None
        self._listeners: list[Listener] = []
        self._waiting: deque[_Change] = deque()
        self._change: _Change | None = None  # the one under way
        self._job: Future[object] | None = None  # what is being done about it
        self._offered: Tuning | None = None  # to the tick
        self._saving = False
        self._rest = 0  # ticks until the next change may begin

    @property
    def values(self) -> Mapping[str, float]:
        """Every parameter in use, by name; another mapping after each change."""
        return self._values

    def is_changing(self, name: str) -> bool:
        """Whether a change of a parameter is under way, its value not decided yet."""
        under_way = (*self._waiting, *((self._change,) if self._change is not None else ()))
        return any(name in change.values for change in under_way)

    def restore(self, values: Mapping[str, float]) -> int:
        """Take values within their ranges over before the first tick; how many are not the default.

        Raises:
            ValueError: They contradict each other.
        """
        wanted = self._values | {name: BY_NAME[name].kept(value) for name, value in values.items()}
        tuning = self._tuning(wanted)
        if tuning:
            self._prepare(tuning)
            self._offered = tuning
        self._values = wanted
        return len(tuning)

    def open(self, executor: Executor, save: Save) -> None:
        """Allow changes, each saved in the executor's one thread; the store does not end it."""
        self._executor, self._save = executor, save

    def listen(self) -> Listener:
        """Register a link that reports changes."""
        self._listeners.append(Listener())
        return self._listeners[-1]

    def change(self, name: str, value: float, asker: Listener) -> str | None:
        """Request a ``value`` [unit of the parameter]; the outcome is reported to who asked.

        Returns:
            Why it cannot be, where that is clear at once.
        """
        parameter = BY_NAME[name]
        refusal = parameter.refusal(value)
        if refusal is None and len(self._waiting) >= WAITING:
            refusal = f"too many changes at once, {name} is left as it is"
        if refusal is not None:
            asker.changed[name] = None
            return refusal
        self._waiting.append(_Change({name: parameter.kept(value)}, asker))
        return None

    def reset(self, asker: Listener) -> str | None:
        """Request the values of the start, all at once; why it cannot be, where that is clear."""
        if len(self._waiting) >= WAITING:
            return "too many changes at once, parameters are left as they are"
        self._waiting.append(_Change(self.defaults, asker))
        return None

    def take_tuning(self) -> Tuning | None:
        """What the next tick is to take over, if anything; call it every tick, it costs nothing."""
        if self._job is not None:
            if not self._job.done():
                return None
            self._finish()
        elif self._rest:
            self._rest -= 1
        elif self._change is None and self._waiting and self._executor is not None:
            self._begin(self._executor)
        return self._offered

    def settle(self, taken: bool | None) -> None:
        """Learn whether the tick took its tuning; None where it failed before it came to that."""
        self._offered = None
        change = self._change
        if change is None:
            return  # the values of the start
        if taken and self._executor is not None and self._save is not None:
            self._values = self._values | dict(change.values)
            self._saving = True
            self._job = self._executor.submit(self._save, dict(self._values))
        else:
            self._drop(change)

    def _begin(self, executor: Executor) -> None:
        change = self._waiting.popleft()
        changed = {n: v for n, v in change.values.items() if self._values[n] != v}
        if not changed:
            if len(change.values) == 1:
                self._tell(change.values)
            return
        change = _Change(changed, change.asker)
        self._change, self._saving, self._rest = change, False, REST_TICKS
        self._job = executor.submit(self._prepare, self._tuning(self._wanted(change)))

    def _finish(self) -> None:
        """Go on after the thread has done its part."""
        job, change = self._job, self._change
        assert job is not None
        assert change is not None
        self._job = None
        error = job.exception()
        if not self._saving:
            if error is None:
                self._offered = self._tuning(self._wanted(change))
            else:
                change.asker.texts.append(f"{change.name} is left as it is: {error}")
                self._drop(change)
            return
        if error is not None:
            change.asker.texts.append(f"{change.name} holds until the end only: {error}")
        self._change = None
        self._tell(change.values)

    def _drop(self, change: _Change) -> None:
        """Show the asker the value in use; other listeners are not affected."""
        change.asker.changed.update(dict.fromkeys(change.values))
        self._change = None

    def _tell(self, names: Iterable[str]) -> None:
        for listener in self._listeners:
            listener.changed.update(dict.fromkeys(names))

    def _wanted(self, change: _Change) -> dict[str, float]:
        return {**self._values, **change.values}

    def _tuning(self, values: Mapping[str, float]) -> Tuning:
        """What differs from the configuration of the start."""
        defaults = self.defaults
        return tuning_of({name: values[name] for name in BY_NAME if values[name] != defaults[name]})
