"""``pandion px4 identify``: PX4's gains are read and its lag is found from a short manoeuvre."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.control.px4_loops import Px4Tuning, airframe_above_px4
from fsw.autopilot.control.px4_tube import is_stable
from fsw.autopilot.control.tube import base_reach
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import FlightConfig, above_px4, flight_config
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.autopilot.signals import ActuatorCommand, Arm, Mode, SensorFrame, TickOutputs
from fsw.link.inbox import Inbox
from fsw.link.px4.link import PX4_PORT, Px4Link, open_px4
from fsw.runtime import clock
from messages.addresses import LinkAddress
from pandion.param_vehicle import NoAnswer, ParameterClient, ParameterRefused
from pandion.px4_identification import Identified, Manoeuvre, identify
from vehicles.vehicle_file import load_vehicle

# PX4's parameters, and the fields of Px4Tuning that they are.
GAINS: Final = {
    "MPC_XY_P": "position_gain",
    "MPC_XY_VEL_P_ACC": "velocity_gain",
    "MPC_XY_VEL_I_ACC": "velocity_integral",
    "MPC_XY_VEL_D_ACC": "acceleration_gain",
    "MPC_Z_P": "height_gain",
    "MPC_Z_VEL_P_ACC": "climb_gain",
    "MPC_Z_VEL_I_ACC": "climb_integral",
}
WAIT_S: Final = 120.0  # for the pilot to give the vehicle


class NotIdentified(Exception):
    """Nothing was found, and why."""


@dataclass
class Identifier:
    """Flies the manoeuvre while PX4 gives the vehicle."""

    airframe: Airframe
    inbox: Inbox
    tell: Callable[[str], None]
    manoeuvre: Manoeuvre = field(default_factory=Manoeuvre)
    flies: bool = False

    def step(self, frame: SensorFrame, link: Px4Link) -> bool:
        """Answer one frame; whether the manoeuvre is over."""
        for command in self.inbox.take().commands:
            begins = isinstance(command.action, Arm)
            if begins != self.flies:
                self.flies = begins
                self.manoeuvre.stop()
                self.tell("pushes begin" if begins else "taken back: the pushes will begin anew")
        over = self.flies and self.manoeuvre.done(frame.t_us)
        self.flies = self.flies and not over
        wanted = None
        if self.flies:
            home = self.airframe.home_posture[: self.airframe.bodies.joints]
            wanted = self.manoeuvre.step(frame, tuple(home))
        mode = Mode.HOLD if self.flies else Mode.DISARMED
        outputs = TickOutputs(ActuatorCommand((), ()), mode, self.flies, wanted)
        link.send_actuators(frame.t_us, outputs)
        for text in link.notices:
            self.tell(text.text)
        link.notices.clear()
        return over

    def found(self, gains: dict[str, float]) -> Identified:
        """PX4's loops with its own ``gains``, by their names there.

        Raises:
            NotIdentified: The manoeuvre does not show them.
        """
        known = replace(Px4Tuning(), **{GAINS[name]: value for name, value in gains.items()})
        try:
            found = identify(self.manoeuvre.seen, known)
        except ValueError as error:
            raise NotIdentified(str(error)) from None
        if found.refusal:
            raise NotIdentified(found.refusal)
        return found


def fly(
    address: LinkAddress, vehicle: str, tell: Callable[[str], None], wait_s: float = WAIT_S
) -> tuple[Identified, FlightConfig]:
    """Read PX4's gains, wait for Offboard, fly the manoeuvre; what was found, and of which vehicle.

    Raises:
        NotIdentified: PX4 does not answer, does not give the vehicle, or nothing was found.
        LinkError: The link cannot be opened.
    """
    from fsw.runtime.assembly import vehicle_facts

    config = above_px4(flight_config(vehicle=load_vehicle(vehicle)))
    gains = _gains(address)
    tell(", ".join(f"{name} {value:g}" for name, value in gains.items()))
    inbox, where = Inbox(), (address, None)
    identifier = Identifier(config.airframe, inbox, tell)
    with contextlib.closing(open_px4(where, inbox, vehicle_facts(config), clock.now_us)) as link:
        tell(
            f"waiting for Offboard, in the air; then {identifier.manoeuvre.seconds:.0f} s of pushes"
        )
        begun_s = announced_s = time.monotonic()
        while time.monotonic() - begun_s < wait_s + identifier.manoeuvre.seconds:
            if link.pacing is None and time.monotonic() - announced_s > 0.2:
                announced_s = time.monotonic()
                link.announce()
            frame = link.wait_for_step()
            if frame is not None and identifier.step(frame, link):
                return identifier.found(gains), config
    raise NotIdentified(f"PX4 did not give the vehicle for long enough within {wait_s:g} s")


def _gains(address: LinkAddress) -> dict[str, float]:
    try:
        with ParameterClient(address, local_port=PX4_PORT) as px4:
            return {name: px4.read(name) for name in GAINS}
    except (NoAnswer, ParameterRefused) as error:
        raise NotIdentified(str(error)) from None


def report(found: Identified, config: FlightConfig) -> tuple[dict[str, float], list[str]]:
    """Parameters of Pandion that say what was found, and sentences about it."""
    px4 = found.px4
    flown = replace(config, px4=px4, airframe=airframe_above_px4(config.airframe, px4))
    values = {one.name: one.read(flown) for one in PARAMETERS if one.name.startswith("PX4_")}
    loop = loop_tube(flown)
    reach = base_reach(loop, flown.surroundings.disturbance)
    sentences = [
        f"attitude loop {px4.tilt_kp:.0f} 1/s^2, {px4.tilt_kd:.1f} 1/s, delay "
        f"{1e3 * px4.delay:.0f} ms; {found.unexplained:.0%} of the lean is left unexplained",
        f"no disturbance within {flown.surroundings.disturbance:g} m/s^2 on one axis pushes the "
        f"base further than {1e3 * reach:.0f} mm off its plan, which keeps "
        f"{1e3 * stand_off(flown.planner.walls):.0f} mm from walls",
    ]
    if not is_stable(px4):
        sentences.append("these loops do not settle: cancel less of the disturbance, PX4_CANCEL")
    return values, sentences
