"""Draw docs/images/flight.svg or branches.svg from a flight that ``pandion fly`` has flown.

::

    pandion fly walls --out runs/figure
    python docs/figures/flight.py runs/figure [FILE]

Seen from above: the end-effector, its reference, the base, walls and points; beside it the smallest
margin over time, as the flight software itself saw it.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from drawing import BLUE, FAINT, GREEN, INK, ORANGE, RED, XY, Drawing

from messages.frames import Frame, split
from sitl.scenario_file import load_scenario

ARM_JOINT_STATE, END_EFFECTOR_TARGET, BARRIER_MARGIN, LOCAL_POSITION = 60200, 60202, 60203, 32
START_US = 1_000_000  # the simulator's first stamp
ZONE = "#ffebe9"

WIDTH, HEIGHT = 1000, 480
SCALE, MIDDLE = 205.0, (285.0, 292.0)  # px a metre, and where x = 0, y = 0 is
CHART, CHART_SIZE = (600.0, 100.0), (370.0, 270.0)
TOP_MM = 500.0  # of the chart; margins above it are cut


@dataclass(slots=True)
class Flight:
    """What the figure shows; (north, east) in m, (s, mm)."""

    end_effector: list[XY] = field(default_factory=list)
    reference: list[XY] = field(default_factory=list)
    base: list[XY] = field(default_factory=list)
    margin: list[XY] = field(default_factory=list)


def frames(tlog: Path) -> Iterator[Frame]:
    """Frames of a .tlog: 8 bytes of time, then one frame."""
    data, at = tlog.read_bytes(), 0
    while at < len(data):
        size = 12 + data[at + 9] + 13 * (data[at + 10] & 1)
        yield from split(data[at + 8 : at + 8 + size])
        at += 8 + size


def read(tlog: Path) -> Flight:
    """The paths at 10 Hz and the smallest margin."""
    flight = Flight()
    for frame in frames(tlog):
        values = frame.payload_values
        if frame.message_id == ARM_JOINT_STATE:
            flight.end_effector.append((values[13], values[14]))
        elif frame.message_id == LOCAL_POSITION:
            flight.base.append((values[1], values[2]))
        elif frame.message_id == END_EFFECTOR_TARGET:
            flight.reference.append((values[1], values[2]))
        elif frame.message_id == BARRIER_MARGIN:
            smallest = min(values[1 : 1 + values[37]])
            flight.margin.append((1e-6 * (values[0] - START_US), 1e3 * smallest))
    flight.end_effector = flight.end_effector[::3]
    flight.base = flight.base[::3]
    return flight


def main(directory: Path, target: Path) -> None:
    """Draw one flight."""
    result = json.loads((directory / "result.json").read_text(encoding="utf-8"))
    flight = read(directory / "flight.tlog")
    d = Drawing(WIDTH, HEIGHT)
    d.text((24.0, 34.0), f"pandion fly {result['scenario']} --seed {result['seed']}", bold=True)
    rms, least = 1e3 * result["tracking_error_rms_m"], 1e3 * result["min_margin_m"]
    verdict = "completed" if result["completed"] else result["end_reason"]
    d.text(
        (24.0, 56.0),
        f"{verdict}, {result['duration_s']:.0f} s; tracking error {rms:.0f} mm RMS, "
        f"least margin {least:.1f} mm between samples",
        FAINT,
        13,
    )
    from_above(d, flight, result["scenario"])
    kept = "point" if load_scenario(result["scenario"]).obstacles else "wall"
    over_time(d, flight, result["duration_s"], kept)
    d.save(target)


def from_above(d: Drawing, flight: Flight, scenario: str) -> None:
    """North is up, east to the right."""
    flown = load_scenario(scenario)
    walls, obstacles = flown.walls, flown.obstacles
    for one in obstacles:
        d.circle(seen(one.position_m[:2]), SCALE * one.clearance_m, ZONE, ZONE)
    for wall in walls:
        zone(d, wall.normal, wall.offset_m, wall.clearance_m)
    for wall in walls:
        d.line(*map(seen, across(wall.normal, wall.offset_m)), RED, 4.0)
    d.polyline(map(seen, flight.base), BLUE, 0.8)
    d.polyline(map(seen, flight.reference), GREEN, 2.2)
    d.polyline(map(seen, flight.end_effector), ORANGE, 1.0)
    for one in obstacles:
        x, y = seen(one.position_m[:2])
        d.circle((x, y), 3.5, RED, RED)
        d.text((x + 7.0, y - 7.0), f"{one.name}, {-one.position_m[2]:.2f} m high", RED, 12)
    legend = (("base", BLUE), ("reference", GREEN), ("end-effector", ORANGE))
    for k, (words, colour) in enumerate(legend):
        x = 60.0 + 130.0 * k
        d.line((x, 440.0), (x + 24.0, 440.0), colour, 2.5)
        d.text((x + 30.0, 445.0), words, INK, 13)
    what = "a point, at its height" if obstacles else "a wall"
    d.text((60.0, 466.0), f"red: closer than the clearance of 0.1 m to {what}", RED, 13)


def across(normal: tuple[float, float, float], distance: float) -> tuple[XY, XY]:
    """Ends of the line where a plane across north or east is seen from above."""
    if abs(normal[0]) > abs(normal[1]):
        return (normal[0] * distance, -1.0), (normal[0] * distance, 1.0)
    return (-0.25, normal[1] * distance), (1.0, normal[1] * distance)


def zone(d: Drawing, normal: tuple[float, float, float], offset: float, clearance: float) -> None:
    """The strip along a wall to stay out of."""
    (x1, y1), _ = map(seen, across(normal, offset))
    _, (x2, y2) = map(seen, across(normal, offset + clearance))
    d.box((min(x1, x2), min(y1, y2)), (abs(x1 - x2), abs(y1 - y2)), ZONE, ZONE, 0.0)


def over_time(d: Drawing, flight: Flight, duration_s: float, kept: str) -> None:
    """The smallest margin."""
    (x0, y0), (width, height) = CHART, CHART_SIZE
    d.text((x0, y0 - 14.0), "smallest margin [mm]", INK, 13)

    def place(point: XY) -> XY:
        return (
            x0 + width * point[0] / duration_s,
            y0 + height * (1.0 - min(point[1], TOP_MM) / TOP_MM),
        )

    for value in (0, 100, 200, 300, 400, 500):
        left = place((0.0, float(value)))
        d.line(left, (x0 + width, left[1]), RED if value == 0 else "#d0d7de", 1.0)
        d.text((x0 - 8.0, left[1] + 4.0), str(value), FAINT, 12, "end")
    for part in range(5):
        t = duration_s * part / 4.0
        d.text((place((t, 0.0))[0], y0 + height + 20.0), f"{t:.0f} s", FAINT, 12, "middle")
    d.polyline(map(place, flight.margin), BLUE, 1.2)
    d.text((x0, y0 + height + 44.0), "distance beyond the 0.1 m clearance, the nearest", FAINT, 13)
    nearest = f"of base, joint 2, end-effector to the nearest {kept}"
    d.text((x0, y0 + height + 62.0), nearest, FAINT, 13)


def seen(point: XY) -> XY:
    """(north, east) in the picture."""
    return (MIDDLE[0] + SCALE * point[1], MIDDLE[1] - SCALE * point[0] + 20.0)


if __name__ == "__main__":
    name = sys.argv[2] if len(sys.argv) > 2 else "docs/images/flight.svg"
    main(Path(sys.argv[1]), Path(name))
