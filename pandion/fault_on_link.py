"""A cell of the matrix with both processes in real time: processes and datagrams fail."""

from __future__ import annotations

import io
import time
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from command_line.options import as_words
from fsw.arguments import FswOptions
from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.autopilot.signals import Mode, Severity
from fsw.link.link_choice import NO_LINK, LinkChoice
from pandion import child, fault_station, supervisor
from pandion.display import Display
from pandion.fault_station import Noted, Station
from pandion.supervisor import Flown, ProcessFailed, Supervisor
from sitl.arguments import SitlOptions
from sitl.faults.keys import Fault
from sitl.result import EndKind
from sitl.scenario_file import PACKAGED
from studies.fault_matrix.flights import (
    SITUATIONS,
    FaultFlight,
    Said,
    Situation,
    beside_the_wall_text,
    contact_of,
)
from studies.fault_matrix.matrix import Cell
from studies.flight.job import sources

_WAIT_S: Final = 600.0


class _Watch(Display):
    """Prints nothing and notes when the simulator said that the fault began."""

    def __init__(self) -> None:
        super().__init__(io.StringIO())
        self.begun_s: float | None = None

    def say(self, sentence: str) -> None:
        """See :class:`Display`."""
        if sentence.startswith("sitl: fault") and self.begun_s is None:
            self.begun_s = time.monotonic()


class LinkCell(Cell):
    """A cell whose two halves are processes."""

    __slots__ = ()

    def key(self) -> str:
        """See :class:`studies.campaign.ports.Flight`."""
        return "link " + super().key() + sources(fault_station, supervisor, child)[:16]

    def _flown(self) -> FaultFlight:
        with TemporaryDirectory() as folder:
            return _fly(self, Path(folder))


def _fly(cell: Cell, folder: Path) -> FaultFlight:
    situation, (fault,) = SITUATIONS[cell.mode], cell.expected.faults
    scenario = folder / "cell.toml"
    scenario.write_text(_scenario(cell.mode, situation, fault), encoding="utf-8")
    station, watch = Station(cell.mode), _Watch()
    station.start()
    try:
        flown = Supervisor(watch, folder).run(
            as_words(_sitl(scenario, cell, situation.ends_s, folder)),
            lambda port: as_words(_fsw(port, station.port, situation, cell.expected.suite, folder)),
        )
    except ProcessFailed as error:
        return cell.broken(str(error))
    finally:
        station.close()
    if watch.begun_s is None:
        return cell.broken(f"the fault did not begin: {flown.failure or 'the flight was over'}")
    return _seen(cell.mode, flown, station.noted, watch.begun_s, time.monotonic())


def _scenario(mode: str, situation: Situation, fault: Fault) -> str:
    if situation.packaged:
        text = (PACKAGED / f"{situation.packaged}.toml").read_text(encoding="utf-8")
    else:
        text = beside_the_wall_text(
            "ground" if mode == "takeoff" else "airborne",
            "none" if mode == "takeoff" else "trajectory",
        )
    keys = asdict(fault) | {"start_s": situation.fault_s}
    lines = [f"{k} = {v!r}" if isinstance(v, float) else f'{k} = "{v}"' for k, v in keys.items()]
    return "\n".join([text, "[[faults]]", *lines, ""])


def _sitl(scenario: Path, cell: Cell, ends_s: float, out: Path) -> SitlOptions:
    return SitlOptions(
        scenario=str(scenario),
        seed=cell.seed,
        duration_s=ends_s,
        sensors=cell.expected.suite,
        realtime=True,
        listen="udp:127.0.0.1:0",
        wait_s=_WAIT_S,
        out=out,
    )


def _fsw(port: int, station: int, situation: Situation, suite: str, out: Path) -> FswOptions:
    return FswOptions(
        sim=f"udp:127.0.0.1:{port}",
        links=LinkChoice(gcs=f"udp:127.0.0.1:{station}", api=NO_LINK),
        control=ControlChoice(body=situation.body),
        vehicle=situation.scenario(suite).vehicle,
        out=out,
        wait_s=_WAIT_S,
    )


def _seen(
    mode: str, flown: Flown, noted: list[Noted], begun_s: float, ended_s: float
) -> FaultFlight:
    """What of a flight counts: what the station has heard from the fault on, and the end."""
    situation = SITUATIONS[mode]
    before = [one.mode for one in noted if one.mode is not None and one.at_s < begun_s]
    problem = ""
    if not before or before[-1] is not situation.mode:
        problem = f"in {before[-1].value if before else 'no mode'} when the fault began"
    texts = [
        Said(round(one.at_s - begun_s, 3), one.severity, one.text)
        for one in noted
        if one.text and one.at_s >= begun_s
    ]
    actions = _actions([one for one in noted if not one.text and one.at_s >= begun_s], mode)
    result: dict[str, Any] = flown.sitl or {}
    kind, reason = str(result.get("end_kind")), str(result.get("end_reason", ""))
    # As the result says it: a process that had to be killed was silent before.
    why = [reason] if kind == "stopped" or (flown.failure and reason) else []
    failure = "; ".join([*why, *([flown.failure] if flown.failure else [])])
    if failure:
        actions.append("ended")
        texts.append(Said(round(ended_s - begun_s, 3), int(Severity.CRITICAL), failure))
    for lost in flown.unwritten:
        texts.append(Said(round(ended_s - begun_s, 3), int(Severity.WARNING), lost))
    ends = {one.value: one for one in EndKind}
    contact = contact_of(ends.get(kind), reason)
    return FaultFlight(
        texts=tuple(texts),
        actions=tuple(actions),
        contact=contact,
        ended=reason if contact or failure else "",
        least_m=result.get("min_margin_m"),
        force_share=_force_share(result),
        problem=problem,
    )


def _force_share(result: dict[str, Any]) -> float:
    """The largest force on the tool over what its surface allows."""
    uses = result.get("touches", {}).values()
    return max(
        (float(use["force_max_n"]) / float(use["force_bound_n"]) for use in uses), default=0.0
    )


def _actions(changes: list[Noted], mode: str) -> list[str]:
    """Modes that no completion explains."""
    nominal = SITUATIONS[mode].nominal
    found: list[str] = []
    for one in changes:
        if one.terminated:
            action = "terminate"
        elif one.mode is None or one.mode in nominal or one.mode is Mode.DISARMED:
            continue
        else:
            action = one.mode.value
        if not found or found[-1] != action:
            found.append(action)
    return found
