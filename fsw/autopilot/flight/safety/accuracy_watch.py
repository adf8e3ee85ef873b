"""How sure the estimate is with the sensors that there are: the analysis of it, once it is known.

Which sensors there are shows only when they speak. So the start-up analysis of what their errors
add to the tube follows a few seconds after the first position, on the ground as a rule, and is
made of the covariance that the estimator has found by then.

Source: docs/equations.md T5.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from fsw.autopilot.control.tube import Tube
from fsw.autopilot.estimation.error_state import TH, Array, V
from fsw.autopilot.parameters.consistency import Accuracy, estimate_findings, estimate_reach
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import SafeSet, Severity, StatusText, Vec3

_WINDOW_US: Final = 1_000_000  # of which the worst instant counts
_MIN, _MOST = 6, 30  # windows before it is told, and after which it is told as it is
_EXACT: Final = Accuracy("", 0.0, 0.0, 0.0)
_SETTLED: Final = 0.05  # share by which velocity and tilt may differ from the window before


class AccuracyMemory(NamedTuple):
    """What is known so far; deviations are of position [m], velocity [m/s] and tilt [rad]."""

    window_us: int = -1  # when the window began; -1: the estimator has not started
    windows: int = 0
    most: Vec3 = (0.0, 0.0, 0.0)  # of the window
    before: Vec3 = (math.inf, math.inf, math.inf)  # of the window before
    reach: float = 0.0  # m, what it adds to the tube; 0: not known yet
    told: bool = False


class AccuracyWatch:
    """The watch of one configuration."""

    def __init__(self, config: FlightConfig, loop: Tube) -> None:
        self._config, self._loop = config, loop
        estimate_reach(config, _EXACT)  # takes longer than a tick, and is then known

    def see(
        self,
        memory: AccuracyMemory,
        now_us: int,
        safe_set: SafeSet,
        source: str,
        position: float,
        covariance: Array,
        texts: list[StatusText],
    ) -> AccuracyMemory:
        """Look at the ``covariance`` (17, 17) [SI] once a planning period; appends to ``texts``.

        ``position`` [m] is the deviation of the part of the body that is least certain.
        """
        if memory.told:
            return memory
        if memory.window_us < 0:
            return memory._replace(window_us=now_us)
        known = np.sqrt(np.maximum(np.diagonal(covariance), 0.0)).tolist()
        p, v, tilt = memory.most
        most = max(p, position), max(v, *known[V : V + 3]), max(tilt, *known[TH : TH + 2])
        if now_us - memory.window_us < _WINDOW_US:
            return memory._replace(most=most)
        windows = memory.windows + 1
        # The place may go on to drift.
        settled = all(
            abs(now - then) <= _SETTLED * then
            for now, then in zip(most[1:], memory.before[1:], strict=True)
        )
        if windows < (_MIN if settled else _MOST) or not safe_set.zones:
            return AccuracyMemory(window_us=now_us, windows=windows, before=most)
        accuracy = Accuracy(source, *most)
        texts += [
            StatusText(Severity.INFO if one.holds else Severity.WARNING, one.statement)
            for one in estimate_findings(self._config, safe_set, self._loop, accuracy)
        ]
        reach = estimate_reach(self._config, accuracy)
        return AccuracyMemory(reach=reach if math.isfinite(reach) else 0.0, told=True)
