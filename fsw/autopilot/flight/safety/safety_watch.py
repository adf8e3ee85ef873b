"""Watches what the analysis promised: the tube around the plan, and the margins of the safe set.

Leaving the tube means that the world is not as assumed: the disturbance is larger, the rotors are
slower, something holds the arm. Then the next plan starts from the measurement. A negative margin
is a breach, of the announced safe set or of the uploaded fence. All are episodes with hysteresis,
so that each is told and acted on once.
"""

from __future__ import annotations

import math

from fsw.autopilot.control.tube import Tube, TubeAround, base_reach
from fsw.autopilot.flight.land_detector import is_low
from fsw.autopilot.flight.state import FlightState, SafetyMemory
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import ConstraintReport, PredictionState, StateEstimate
from fsw.frozen import replace

# m, beyond the tube. The observer's velocity noise and the position's own, 1 mm rms each in the
# simulator and in motion capture, move the base by 2 mm rms against its estimate; five times that.
NOISE_ROOM = 0.01
_MIN_TUBE = 0.05  # m: where no disturbance is expected, the loop is not perfect all the same
_BACK = 0.5  # of the tube's radius: closer than this the vehicle is on its plan again
_BACK_US = 500_000  # for as long
_CLEAR = 0.01  # m of margin that end a breach
_CLEAR_US = 500_000
_FILTER_US = 1_000_000  # of silence end an intervention of the filter


class SafetyWatch:
    """The watch of one configuration."""

    def __init__(self, config: FlightConfig, loop: Tube) -> None:
        self._config = config
        follows_state = config.follows_plan
        # Wind that begins or turns pushes beside the disturbance, up to what its memory can take.
        # A plan that begins anew where the vehicle is has given up what pulls it back: in the same
        # push it goes as far once more, and the next time again, until it meets a wall.
        wind = loop.base_wind / loop.wind if loop.wind > 0.0 else 0.0  # m/s^2
        reach = base_reach(loop, config.surroundings.disturbance + wind) + NOISE_ROOM
        # The other loop follows no state: only an upset takes it off its plan.
        self.radius = max(reach, _MIN_TUBE) if follows_state else config.upset_distance
        self._back = _BACK * self.radius
        # More upright than this, neither roll nor pitch is beyond its limit.
        beyond = [a for a in (config.limits.roll_failure, config.limits.pitch_failure) if a > 0.0]
        self.upright = math.cos(min([*beyond, 0.5 * math.pi])) if beyond else -2.0

        self._tube = TubeAround(self.radius, loop.wind if follows_state else 0.0, 0.0)

    def tube(self, state: FlightState) -> TubeAround:
        """The tube around the plan in a tick that starts from a state."""
        unsure = beyond_room(state.accuracy.reach)
        return self._tube._replace(unsure=unsure) if unsure else self._tube

    def attitude(
        self, memory: SafetyMemory, estimate: StateEstimate, *, flies: bool
    ) -> SafetyMemory:
        """Note since when roll or pitch are beyond the limits from which there is no way back."""
        limits, R = self._config.limits, estimate.R_WB
        roll, pitch = math.atan2(R[7], R[8]), math.asin(min(max(-R[6], -1.0), 1.0))
        rolled = flies and limits.roll_failure > 0.0 and not abs(roll) <= limits.roll_failure
        pitched = flies and limits.pitch_failure > 0.0 and not abs(pitch) <= limits.pitch_failure
        return replace(
            memory,
            rolled_us=_since(memory.rolled_us, estimate.t_us, active=rolled),
            pitched_us=_since(memory.pitched_us, estimate.t_us, active=pitched),
        )

    def carried(self, memory: SafetyMemory, now_us: int, *, light: bool) -> SafetyMemory:
        """Note since when rotors carry too little of the weight to fly."""
        return replace(memory, light_us=_since(memory.light_us, now_us, active=light))

    def off_plan(
        self,
        memory: SafetyMemory,
        estimate: StateEstimate,
        nominal: PredictionState | None,
        unsure: float = 0.0,
        wind: float = 0.0,
    ) -> SafetyMemory:
        """Compare the base with where the running plan has it now; None: nothing is flown.

        ``unsure`` [m] is what the estimate's errors add to the tube; some room is left for them.
        ``wind`` [m] is what the memory of wind in force adds.
        """
        if nominal is None:
            return memory if memory.off_plan_us < 0 else replace(memory, off_plan_us=-1)
        (x, y, z), (px, py, pz) = estimate.p_WB, nominal.p
        most = self.radius + wind + beyond_room(unsure)
        down = 0.0 if is_low(self._config, estimate) else abs(z - pz)
        away = abs(x - px), abs(y - py), down
        off, near = not all(one <= most for one in away), max(away) > self._back
        before_us = memory.off_plan_us
        last_us = _lasts(before_us, estimate.t_us, active=off, near=near, ends_us=_BACK_US)
        if not off:
            return memory if last_us == before_us else replace(memory, off_plan_us=last_us)
        if before_us < 0:
            counters = replace(memory.counters, departures=memory.counters.departures + 1)
            memory = replace(memory, off_plan_by=max(away), counters=counters)
        return replace(memory, off_plan_us=last_us, replan=True)

    def breach(
        self,
        memory: SafetyMemory,
        estimate: StateEstimate,
        report: ConstraintReport,
        announced: int,
        *,
        flies: bool,
        seen: float = math.inf,
    ) -> SafetyMemory:
        """Look at all margins of the safe set, of whose zones the first were ``announced`` [1].

        ``seen`` [m] is the least margin that the safety filter saw in this tick. Where no margin of
        the report is negative and that one is, it belongs to the zone that is nearest.
        """
        known = memory.breach_us >= 0 or memory.fence_us >= 0
        if not flies or not report.margins:
            return replace(memory, breach_us=-1, fence_us=-1) if known else memory
        now_us, (of_set, of_fence) = estimate.t_us, _min_margins(report, announced)
        if not seen >= 0.0 and of_set >= 0.0 and of_fence >= 0.0:
            of_set, of_fence = (seen, of_fence) if of_set <= of_fence else (of_set, seen)
        if not known and of_set >= 0.0 and of_fence >= 0.0:
            return memory
        breach_us, breach_by = _outside(memory.breach_us, memory.breach_by, now_us, of_set)
        fence_us, fence_by = _outside(memory.fence_us, memory.fence_by, now_us, of_fence)
        counters = memory.counters
        if not known:
            counters = replace(counters, breaches=counters.breaches + 1)
        return replace(
            memory,
            breach_us=breach_us,
            breach_by=breach_by,
            fence_us=fence_us,
            fence_by=fence_by,
            counters=counters,
        )

    def jumped(self, memory: SafetyMemory, now_us: int, jump_us: int) -> SafetyMemory:
        """Note a jump of time, from one tick to the next or of the sensors' clock alone."""
        return replace(memory, jump_us=jump_us, jumped_us=now_us)

    def filtered(self, memory: SafetyMemory, now_us: int, *, pushed: bool) -> SafetyMemory:
        """Note whether the safety filter changed the acceleration of this tick."""
        if pushed and memory.filter_us < 0:
            counters = replace(memory.counters, interventions=memory.counters.interventions + 1)
            memory = replace(memory, counters=counters)
        last_us = _lasts(memory.filter_us, now_us, active=pushed, near=False, ends_us=_FILTER_US)
        return memory if last_us == memory.filter_us else replace(memory, filter_us=last_us)


def beyond_room(unsure: float) -> float:
    """What errors of the estimate, ``unsure`` [m], add to the radius: it has room for some [m]."""
    return max(unsure - NOISE_ROOM, 0.0)


def _min_margins(report: ConstraintReport, announced: int) -> tuple[float, float]:
    """The least margins [m] of the zones that were ``announced`` [1], and of those behind them."""
    margins = report.margins
    first = len(margins)
    if len(report.per_zone) > announced:
        first = sum(report.per_zone[:announced])
    return least(margins[:first]), least(margins[first:])


def least(margins: tuple[float, ...]) -> float:
    """The least of ``margins`` [m]: inf of none, -inf where one is not a number."""
    # No comparison would find NaN.
    return -math.inf if math.isnan(sum(margins)) else min(margins, default=math.inf)


def _outside(last_us: int, by: float, now_us: int, least: float) -> tuple[int, float]:
    """When a margin was negative or small last, -1: it is over; and by how much [m] at first."""
    negative, small = not least >= 0.0, least < _CLEAR
    if negative and last_us < 0:
        by = -least
    return _lasts(last_us, now_us, active=negative, near=small, ends_us=_CLEAR_US), by


def _lasts(last_us: int, now_us: int, *, active: bool, near: bool, ends_us: int) -> int:
    """When an episode that is ``active`` now, or was at ``last_us``, was so last; -1: it is over.

    It goes on while it is ``near`` to being active, and ends when that was ``ends_us`` [us] ago.
    """
    if active or (near and last_us >= 0):
        return now_us
    return last_us if now_us - last_us < ends_us else -1


def _since(since_us: int, now_us: int, *, active: bool) -> int:
    """When it became ``active``; -1: it is not."""
    if not active:
        return -1
    return since_us if since_us >= 0 else now_us
