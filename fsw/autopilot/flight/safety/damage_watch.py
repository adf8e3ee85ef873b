"""Failed rotors and joints as the flight software knows them: sentences, and what loops count on.

``fsw/autopilot/control/actuator_watch.py`` finds them; the failsafe table acts on them. What has
failed stays so until the flight software is restarted, but for a weak rotor that gives what it is
commanded again.
"""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.control.actuator_watch import watch, watch_law
from fsw.autopilot.control.rotor_loss import balancing_posture
from fsw.autopilot.estimation.faults.sensor_fault import SensorFault, sentence
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.flight.state import Damage
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.model.actuator_health import HEALTHY, LIMP, SOUND, STUCK, ActuatorHealth
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.rotors import rotor_decay, rotor_names
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import ActuatorReport, JointVector
from fsw.autopilot.tick_record import NO_ROTOR, Tick, Watched
from fsw.compiled import machine_code, packed

_HOWS: Final = {STUCK: "does not move", LIMP: "gives no torque"}
_WEAK_AT_MOST: Final = 0.9  # of what is commanded; a weak rotor that is found gives less
_MIN_GIVEN: Final = 0.1  # N, of a rotor that does not obey


class DamageWatch:
    """The watch over the actuators of one configuration."""

    def __init__(self, config: FlightConfig) -> None:
        airframe, tick = config.airframe, config.tick
        law = watch_law(airframe)
        self._law, self._spares = packed(law), law.spares
        self._tops, self._names = airframe.rotor_thrust_max, rotor_names(airframe)
        self._hover = airframe.mass * GRAVITY / airframe.rotors
        self._tick = tick
        self._decay = rotor_decay(airframe, tick)
        self._reallocates = bool(config.limits.failed_rotor_mode)  # loops reckon with what is found
        self._postures = [
            balancing_posture(airframe, k) if law.spares[k] > 0.0 else None
            for k in range(airframe.rotors)
        ]
        example = Tick().array
        self._watch = machine_code(watch, example, example, self._law, 1.0, 1.0, True)

    def see(
        self,
        damage: Damage,
        before: Tick,
        after: Tick,
        ticks: int,
        *,
        memory: FusionMemory | None = None,
        angles_known: bool = True,
    ) -> Damage:
        """What is known of actuators a tick, or some ``ticks``, later.

        Reads what was commanded in the record ``before``; writes the watch of that ``after``.
        Where by the filter's ``memory`` encoders repeat themselves, a joint that has failed may be
        one that is not seen.
        Where the angles are not known by encoders, joints are not judged.
        """
        dt, decay = self._tick, self._decay
        if ticks != 1:
            dt, decay = ticks * dt, decay**ticks
        failed = self._watch(before.array, after.array, self._law, decay, dt, angles_known)
        if failed or damage.rotor:
            s, now_us = after.watch, after.estimate.t_us
            back = before.watch.failed != NO_ROTOR and s.failed == NO_ROTOR
            damage = self._of_rotors(damage, s, now_us, back=back)
            repeat = memory is not None and memory.encoders_repeat
            damage = _of_joints(damage, s, after.joint_count, now_us, repeat)
        return damage

    def finds(self, before: Tick, after: Tick) -> bool:
        """Watch healthy actuators over a tick, as ``see``; whether any of them has failed."""
        return self._watch(before.array, after.array, self._law, self._decay, self._tick, True)

    def _of_rotors(self, before: Damage, s: Watched, now_us: int, *, back: bool) -> Damage:
        """What is known of rotors; the one that had failed is ``back``, or not seen any more."""
        k, known = s.failed, before.report
        if k == NO_ROTOR:
            if not back:
                return before
            joints = before.health.joints
            health = ActuatorHealth(joints=joints) if any(joints) else HEALTHY
            report = known._replace(rotor=0, effect=1.0)
            return before._replace(rotor="", report=report, health=health)
        lost = bool(s.lost)
        same = known.rotor == k + 1 and (before.spared or not known.lost)
        # Not a second one as well.
        spared = lost and self._reallocates and self._spares[k] > 0.0
        spared = spared and (same or not known.rotor)
        found = known._replace(
            rotor=k + 1,
            effect=0.0 if spared and not s.disobeys else s.effect,
            lost=lost,
            disobeys=bool(s.disobeys),
        )
        after, health = before, before.health
        if found._replace(effect=known.effect) != known:
            since_us = before.rotor_us
            if found.rotor != known.rotor:
                since_us = now_us - round(1e6 * s.suspected)
            after = before._replace(rotor=_sentence(s, found, self._names[k]), rotor_us=since_us)
        if self._reallocates:
            health = self._health(s, k, found, before.health.joints)
        balance = self._postures[k] if spared else None
        return after._replace(report=found, health=health, spared=spared, balance=balance)

    def _health(
        self, s: Watched, k: int, found: ActuatorReport, joints: JointVector
    ) -> ActuatorHealth:
        """What loops reckon with for rotor ``k`` (from 0)."""
        if found.effect == 0.0:  # the others fly without it
            most = (math.inf,) * k + (0.0,)
            return ActuatorHealth((1.0,) * (k + 1), (0.0,) * (k + 1), most, joints)
        if not found.disobeys:
            return ActuatorHealth((1.0,) * k + (found.effect,), joints=joints)
        # It is commanded what it gives in hover, and reckoned with as what it really gives.
        gives = min(max(s.gives, _MIN_GIVEN), self._tops[k])
        return ActuatorHealth(
            (1.0,) * k + (gives / self._hover,),
            (0.0,) * k + (gives,),
            (math.inf,) * k + (gives,),
            joints,
        )


def _of_joints(before: Damage, s: Watched, joints: int, now_us: int, angles_repeat: bool) -> Damage:
    known = before.report.joints or (SOUND,) * joints
    kinds = tuple([float(s.joint[k]) or known[k] for k in range(joints)])
    if kinds == known:
        return before
    failed = [k for k in range(joints) if kinds[k] != SOUND]
    text = " and ".join([f"joint {k + 1} {_HOWS[kinds[k]]}" for k in failed])
    if angles_repeat:
        text += f", or {sentence(Sensor.ENCODERS, SensorFault.STUCK)}"
    since_us = before.joint_us
    if not before.joint:
        since_us = now_us - round(1e6 * float(s.joint_for[failed[0]]))
    report, health = before.report._replace(joints=kinds), before.health._replace(joints=kinds)
    return before._replace(joint=text, joint_us=since_us, report=report, health=health)


def _sentence(s: Watched, found: ActuatorReport, name: str) -> str:
    k = found.rotor - 1
    if found.lost:
        return f"{name} gives nothing"
    if found.disobeys:
        return f"{name} does not obey"
    # As it is at the moment: means of a tenth of a second are behind when a rotor has just failed.
    share = 1.0 + float(s.extra[k]) / max(float(s.thrust[k]), 1.0)
    if share > _WEAK_AT_MOST:
        return f"{name} gives another thrust than is commanded"
    return f"{name} gives {100.0 * max(share, 0.0):.0f} % of what is commanded"
