"""The zones that the tool may touch: where they are, and how hard it has pressed on them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from sitl.plant.parameters import Effects, Surface
from sitl.plant.stiffness import steps_of_touch
from sitl.plant.tool import tip_radius
from sitl.plant.vector import Array
from sitl.scenario import V3, Scenario
from sitl.shapes import KINDS
from sitl.zones import Zone, zones_of
from vehicles.description import Vehicle

_HARD: Final = 2.0  # of the bound, up to which the plant's steps follow the force


@dataclass(frozen=True, slots=True)
class TouchUse:
    """How a zone was touched."""

    force_bound_n: float
    force_max_n: float  # largest normal force
    force_max_time_s: float  # when that was; 0 where it was never touched
    force_margin_n: float  # bound less largest
    contacts: int  # how often it was touched anew
    contact_s: float
    slip_m: float  # path of the tip along the surface while they touched


def touched_zones(scenario: Scenario) -> tuple[Zone, ...]:
    """The zones of a scenario that the tool may touch."""
    return tuple(zone for zone in zones_of(scenario) if zone.table.touch is not None)


def surface_effects(scenario: Scenario, vehicle: Vehicle, motor_inertia: float) -> dict[str, Any]:
    """What :class:`Effects` says of surfaces, for a ``vehicle`` with a ``motor_inertia`` [kg·m²].

    Raises:
        TooStiffError: Contact is too stiff for the plant.
    """
    surfaces, bounds = list[Surface](), [0.0]
    for zone in touched_zones(scenario):
        touch = zone.table.touch
        assert touch is not None
        about = touch.stiffness_n_m, touch.dissipation_s_m, touch.friction
        surfaces.append(Surface(KINDS.index(zone.kind), zone.at(0.0).numbers, *about))
        bounds.append(touch.force_max_n)
    given, none = tuple(surfaces), Effects()
    if not given:
        return {"surfaces": none.surfaces, "finer": none.finer}
    finer = steps_of_touch(vehicle, given, _HARD * max(bounds), motor_inertia)
    return {"surfaces": given, "finer": finer}


class TouchRecord:
    """The surfaces in a plant's record of numbers, for as long as a flight lasts."""

    def __init__(self, scenario: Scenario, vehicle: Vehicle, plants: Any) -> None:
        """Of a ``vehicle`` in the scenario, in ``plants`` (1,), records that the kernels write."""
        self._vehicle, self._radius = vehicle, tip_radius(vehicle)
        self._zones = touched_zones(scenario)
        self._held: Any = plants["surfaces"]
        self._squares = self._asked_squares = self._asked_s = 0.0

    def __bool__(self) -> bool:
        """Whether there is anything to touch."""
        return bool(self._zones)

    def place(self, time_s: float) -> None:
        """Put the surfaces where they are at a time, before an exchange that begins with it."""
        held = self._held
        held["clock"][0] = (time_s, 0.0)
        for s, zone in enumerate(self._zones):
            if zone.moves:
                placed = zone.at(time_s)
                held["numbers"][0, s, : len(placed.numbers)] = placed.numbers
                held["velocity"][0, s] = placed.velocity

    def meet(self, scenario: Scenario) -> None:
        """From now on meet what another ``scenario`` says of the same surfaces, and count anew.

        Raises:
            TooStiffError: Contact is too stiff for the plant.
        """
        inertia = scenario.actuators.motor_inertia_kg_m2
        effects = surface_effects(scenario, self._vehicle, inertia)
        self._zones = touched_zones(scenario)
        self._held["finer"][0] = effects["finer"]
        for s, one in enumerate(effects["surfaces"]):
            self._held["stiffness"][0, s] = one.stiffness
            self._held["dissipation"][0, s] = one.dissipation
            self._held["friction"][0, s] = one.friction
        for counted in ("force_max", "when_s", "contacts", "contact_s", "path"):
            self._held[counted][0] = 0.0
        self._squares = self._asked_squares = self._asked_s = 0.0

    def force(self) -> V3:
        """On the tip now [N, NED]."""
        x, y, z = self._held["force"][0].sum(axis=0).tolist()
        return (x, y, z)

    def normal(self) -> float:
        """Along the normals of what it touches [N]."""
        return float(self._held["normal"][0].sum())

    def wrench(self, axes: Array) -> tuple[float, ...]:
        """On the tip about its centre (6,) [N, N·m] now, along the tool's axes (3, 3) [1, NED]."""
        held = self._held
        force, out = held["force"][0], held["outward"][0]
        away = np.where(held["depth"][0] > 0.0, self._radius - held["depth"][0], 0.0)
        torque = np.cross(-away[:, None] * out, force)
        of_tool: list[float] = (
            (np.stack([force.sum(axis=0), torque.sum(axis=0)]) @ axes).reshape(-1).tolist()
        )
        return tuple(of_tool)

    def depth(self) -> float:
        """Largest of the tip below a surface [m]; 0 where it touches none."""
        return float(self._held["depth"][0].max())

    def force_share(self) -> float:
        """Largest normal force so far over what its surface allows [1]; 0 without surfaces."""
        return max(
            (use.force_max_n / use.force_bound_n for use in self.uses().values()), default=0.0
        )

    def add(self, asked: float, step_s: float) -> None:
        """Compare the normal force with what was ``asked`` [N] for the ``step_s`` [s] before."""
        if asked > 0.0:
            self._squares += step_s * (self.normal() - asked) ** 2
            self._asked_squares += step_s * asked * asked
            self._asked_s += step_s

    def error_rms(self) -> float | None:
        """Of the normal force while one was asked for [N]; None if none was."""
        return math.sqrt(self._squares / self._asked_s) if self._asked_s else None

    def asked_rms(self) -> float | None:
        """Of the force that was asked for, over the same time [N]."""
        return math.sqrt(self._asked_squares / self._asked_s) if self._asked_s else None

    def uses(self) -> dict[str, TouchUse]:
        """How each zone was touched so far, by its name."""
        held, found = self._held, {}
        for s, zone in enumerate(self._zones):
            touch = zone.table.touch
            assert touch is not None
            most = float(held["force_max"][0, s])
            found[zone.table.name] = TouchUse(
                force_bound_n=touch.force_max_n,
                force_max_n=most,
                force_max_time_s=float(held["when_s"][0, s]),
                force_margin_n=touch.force_max_n - most,
                contacts=round(float(held["contacts"][0, s])),
                contact_s=float(held["contact_s"][0, s]),
                slip_m=float(held["path"][0, s]),
            )
        return found


def touch_flaws(uses: dict[str, TouchUse]) -> tuple[str, ...]:
    """A sentence about every zone that was pressed on too hard."""
    return tuple(
        f"the tool pressed on the {name} with {use.force_max_n:.2f} N at "
        f"{use.force_max_time_s:.2f} s, {use.force_bound_n:g} N is the most"
        for name, use in uses.items()
        if not use.force_margin_n >= 0.0
    )


def touch_sentence(name: str, use: TouchUse) -> str:
    """How a zone was touched, for a summary."""
    if not np.isfinite(use.force_max_n) or use.contacts == 0:
        return f"the {name} was not touched"
    return (
        f"the {name} was touched for {use.contact_s:.2f} s with up to {use.force_max_n:.2f} N of "
        f"{use.force_bound_n:g} N"
    )
