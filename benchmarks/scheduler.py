"""``python -m benchmarks scheduler``: what the engine of campaigns costs beside the flights.

Empty flights are flown, one a task and in batches, on workers of this machine. Client and scheduler
share this process, so its processor time a task is what bounds a cluster of any size. The same
flights of a real scenario are then flown by one worker and by all.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from command_line.options import json_file, option, read
from command_line.output import console_beside, json_text, write_text
from command_line.values import number, whole
from command_line.version import version

_HERE: Final = Path()
_OUT: Final = 2000  # tasks at once, as with 1,000 cores


@dataclass(frozen=True, slots=True, kw_only=True)
class SchedulerOptions:
    """One measurement."""

    json: str | None = json_file("the result")
    tasks: int = option("--tasks N", "empty flights", whole(10, 1_000_000), default=10_000)
    workers: int = option(
        "--workers N", "processes (default one a core)", whole(1, 256), default=os.cpu_count() or 1
    )
    flights: int = option(
        "--flights N",
        "real flights by one and by all workers; 0: none",
        whole(0, 10_000),
        default=8,
    )
    duration_s: float = option(
        "--duration S", "of a real flight, in seconds", number(0.1, 600.0, "s"), default=30.0
    )


@dataclass(frozen=True)
class EmptyRow:
    """What an empty flight leaves."""

    number: int
    error: bool = False


@dataclass(frozen=True)
class EmptyFlight:
    """Nothing is flown."""

    number: int

    def key(self) -> str:
        """See :class:`studies.campaign.ports.Flight`."""
        return str(self.number)

    def row(self) -> EmptyRow:
        """See :class:`studies.campaign.ports.Flight`."""
        return EmptyRow(self.number)

    def broken(self, reason: str) -> EmptyRow:
        """See :class:`studies.campaign.ports.Flight`."""
        return EmptyRow(self.number, error=True)

    def from_line(self, line: Mapping[str, Any]) -> EmptyRow:
        """See :class:`studies.campaign.ports.Flight`."""
        return EmptyRow(**line)


def main(argv: list[str]) -> int:
    """Measure and report; returns the exit code."""
    what = "Time the scheduler of campaigns with empty flights, and flights by one and all workers."
    options = read(SchedulerOptions, "python -m benchmarks scheduler", what, argv)

    found = {"version": version(), "cores": os.cpu_count(), **_empty(options), **_real(options)}
    write_text(options.json, json_text(found, 1) + "\n")
    print("\n".join(_lines(found)), file=console_beside(options.json))
    return 0


def _empty(options: SchedulerOptions) -> dict[str, Any]:
    from studies.campaign.campaign import mute
    from studies.campaign.cluster import Cluster
    from studies.campaign.dispatch import AHEAD, TASKS_A_SECOND, Dispatch

    cluster = Cluster(options.workers, None, mute)
    found: dict[str, Any] = {"tasks": options.tasks, "workers": options.workers}
    try:
        many = _OUT // options.workers
        for name, rate, ahead in (("single", math.inf, many), ("batched", TASKS_A_SECOND, AHEAD)):
            flights = ((str(k), EmptyFlight(k)) for k in range(options.tasks))
            dispatch = Dispatch[EmptyRow](cluster, flights, 3, 60.0, rate, ahead)
            wall_s, own_s = time.monotonic(), time.process_time()
            rows = sum(len(rows) for rows in dispatch.rows())
            assert rows == options.tasks
            wall_s, own_s = time.monotonic() - wall_s, time.process_time() - own_s
            found[f"{name}_flights_a_second"] = rows / wall_s
            found[f"{name}_processor_us"] = 1e6 * own_s / rows
    finally:
        cluster.close()
    return found


def _real(options: SchedulerOptions) -> dict[str, Any]:
    """Rate of real flights by one worker and by all, after each has flown once."""
    if not options.flights:
        return {}
    from studies.campaign.campaign import Campaign
    from studies.campaign.flight import CampaignFlight, CampaignRow
    from studies.campaign.plan import parse_plan

    plan = parse_plan(
        f'flights = 1\nduration_s = {options.duration_s}\nscenarios = ["walls"]\n', "bench", _HERE
    )
    rates, processor_s = {}, {}
    for workers in sorted({1, options.workers}):
        with Campaign[CampaignRow](workers) as campaign:
            campaign.run([CampaignFlight(plan, k) for k in range(4 * workers)])  # kernels loaded
            count = options.flights * workers
            began_s = time.monotonic()
            rows = campaign.run([CampaignFlight(plan, 1000 + k) for k in range(count)])
            rates[workers] = count / (time.monotonic() - began_s)
            processor_s[workers] = sum(row.took_s for row in rows) / count
    most = max(rates)
    return {
        "flight_duration_s": options.duration_s,
        "flights_a_second": rates,
        "processor_s_a_flight": processor_s,
        "scaling": rates[most] / (most * rates[1]),
    }


def _lines(found: dict[str, Any]) -> list[str]:
    single, batched = found["single_processor_us"], found["batched_processor_us"]
    lines = [
        f"{found['tasks']} empty flights, {found['workers']} workers:",
        f"  one a task   {found['single_flights_a_second']:8.0f} /s, client and scheduler "
        f"{single:.0f} us of a core each",
        f"  in batches   {found['batched_flights_a_second']:8.0f} /s, {batched:.0f} us each",
    ]
    if "scaling" not in found:
        return lines
    for workers, rate in found["flights_a_second"].items():
        took_s = found["processor_s_a_flight"][workers]
        lines.append(
            f"{workers} worker{'s' * (workers > 1)}: {rate:.2f} flights/s of "
            f"{found['flight_duration_s']:g} s, {took_s:.2f} s of a core each, "
            f"{found['flight_duration_s'] / took_s:.0f} simulated seconds a second"
        )
    flight_s = found["processor_s_a_flight"][1]
    asked = 1000.0 / flight_s
    lines += [
        f"scaling {found['scaling']:.2f} of the number of workers",
        f"1,000 cores: {asked:.0f} flights/s are asked of the scheduler; one a task it gives "
        f"{1e6 / single:.0f} /s, in batches {1e6 / batched:.0f} /s",
    ]
    return lines
