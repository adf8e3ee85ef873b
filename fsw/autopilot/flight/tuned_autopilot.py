"""The tick of the tuning in use, which is swapped between two ticks.

Every tuning has an ``Autopilot`` of its own, with gains designed and limits set, so no tick can
mix two. Which one flies is part of the state: the same inputs fly the same flight again.
"""

from __future__ import annotations

from fsw.autopilot.flight.autopilot import Autopilot, Controlled
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.parameters.consistency import refusals, weakened
from fsw.autopilot.parameters.contradictions import agreed
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.autopilot.signals import Severity, StatusText, TickInputs, TickOutputs
from fsw.autopilot.tuning import Tuning, part, tuned
from fsw.frozen import replace


class TunedAutopilot:
    """One configuration and what is made of it in flight."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        self._in_use: tuple[Tuning, Autopilot] = ((), Autopilot(config))
        self._prepared: tuple[Tuning, Autopilot] = self._in_use

    def warm_up(self) -> None:
        """Compile every kernel of the tick, before anything flies."""
        self._in_use[1].warm_up()

    def prepare(self, tuning: Tuning) -> None:
        """Design the loop of a tuning ahead, in any thread: up to 5 ms, which no tick has.

        Raises:
            ValueError: The numbers contradict each other.
        """
        self._prepared = (tuning, Autopilot(agreed(self._config, tuning)))

    @property
    def config(self) -> FlightConfig:
        """What flies now."""
        return self._in_use[1].config

    def tick(self, state: FlightState, inputs: TickInputs) -> tuple[FlightState, TickOutputs]:
        """Both parts of a tick."""
        return self.conclude(self.control(state, inputs))

    def control(self, state: FlightState, inputs: TickInputs) -> Controlled:
        """Apply a requested tuning if allowed, then decide the command; see Autopilot.

        Raises:
            ValueError: The numbers of a tuning that was not prepared contradict each other.
        """
        if inputs.tuning is None and inputs.mission is None:
            return self._loop(state.tuning).control(state, inputs)
        taken: bool | None = None
        texts: list[StatusText] = []
        if inputs.tuning is not None:
            state, taken, texts = self._retune(state, inputs.tuning)
        begun = self._loop(state.tuning).control(state, inputs)
        so_far, uploaded = begun.outputs, None
        if inputs.mission is not None:
            uploaded = begun.state.mission.upload_taken
        outputs = replace(
            so_far, texts=(*texts, *so_far.texts), tuning_taken=taken, upload_taken=uploaded
        )
        return begun._replace(outputs=outputs)

    def conclude(self, controlled: Controlled) -> tuple[FlightState, TickOutputs]:
        """The rest of the tick; see Autopilot."""
        state, outputs = self._loop(controlled.state.tuning).conclude(controlled)
        if state.tuning and outputs.plan_request is not None:
            request = replace(outputs.plan_request, tuning=part(state.tuning, "planner"))
            outputs = replace(outputs, plan_request=request)
        return state, outputs

    def _retune(
        self, state: FlightState, wanted: Tuning
    ) -> tuple[FlightState, bool, list[StatusText]]:
        """Take a tuning into use; while armed none that makes a promise of the analysis weaker."""
        mission = state.mission
        findings = self._made(wanted).analyse(mission.safe_set)
        newly = weakened(findings, self._loop(state.tuning).analyse(mission.safe_set))
        against = (*self._for_later(state.tuning, wanted), *[one.statement for one in newly])
        if against and state.vehicle.armed and not self._config.soft:
            texts = [StatusText(Severity.WARNING, f"refused while armed: {why}") for why in against]
            return state, False, texts
        # What keeps the vehicle on the ground is told by a row of the failsafe table.
        told = [f.statement for f in newly if self._config.soft or not f.refuses]
        texts = [StatusText(Severity.WARNING, statement) for statement in told]
        mission = replace(mission, refusals=() if self._config.soft else refusals(findings))
        return replace(state, tuning=wanted, mission=mission), True, texts

    def _for_later(self, tuning: Tuning, wanted: Tuning) -> list[str]:
        """What of a ``wanted`` one has to wait until the vehicle is disarmed."""
        config, changed = self._made(wanted).config, dict(set(tuning) ^ set(wanted))
        return [
            f"{one.name} {one.read(config):g}, set it while disarmed"
            for one in PARAMETERS
            if one.path in changed and one.waits_for_disarming(config)
        ]

    def _loop(self, tuning: Tuning) -> Autopilot:
        """The loop of the tuning in use; it is the same almost every tick."""
        if self._in_use[0] is not tuning:
            self._in_use = (tuning, self._made(tuning))
        return self._in_use[1]

    def _made(self, tuning: Tuning) -> Autopilot:
        for known, loop in (self._in_use, self._prepared):
            if known == tuning:
                return loop
        return Autopilot(tuned(self._config, tuning))
