"""Draw docs/images/frames.svg: ``python docs/figures/frames.py [FILE]``."""

from __future__ import annotations

import math
import sys
from pathlib import Path

from drawing import BLUE, FAINT, GREEN, INK, ORANGE, RED, XY, Drawing

SCALE = 640.0  # px a metre
LINK = 0.15  # m
ROTOR_ARM, ROTOR_RADIUS = 0.3, 0.165  # m
TH1, TH2 = math.radians(-41.4), math.radians(82.8)  # where flights in the air begin


def main(path: Path) -> None:
    """Draw both views."""
    d = Drawing(1000, 520)
    side(d, (270.0, 200.0))
    top(d, (750.0, 280.0))
    d.save(path)


def side(d: Drawing, o: XY) -> None:
    """Seen from the right: x forward to the right, z down, y towards the reader."""
    d.text((24.0, 34.0), "from the right (y points at you)", bold=True)
    corner = (44.0, 420.0)
    d.arrow(corner, (corner[0] + 64.0, corner[1]), FAINT)
    d.arrow(corner, (corner[0], corner[1] + 64.0), FAINT)
    d.text((corner[0] + 68.0, corner[1] + 5.0), "x north", FAINT, 13)
    d.text((corner[0] + 6.0, corner[1] + 76.0), "z down", FAINT, 13)
    d.text((corner[0] - 8.0, corner[1] - 8.0), "W", FAINT, bold=True)

    reach = ROTOR_ARM * 0.62 * SCALE  # the airframe is drawn narrower than it is
    d.line((o[0] - reach, o[1]), (o[0] + reach, o[1]), INK, 5.0)
    for sign, name in ((-1.0, "1 rear"), (1.0, "3 front")):
        x = o[0] + sign * reach
        d.line((x, o[1]), (x, o[1] - 18.0), INK, 3.0)
        d.line((x - 52.0, o[1] - 18.0), (x + 52.0, o[1] - 18.0), INK, 2.0)
        d.arrow((x, o[1] - 22.0), (x, o[1] - 70.0), GREEN)
        d.text((x, o[1] - 80.0), f"{name}: thrust f{name[0]}", GREEN, 13, "middle")

    elbow = _along(o, TH1)
    tip = _along(elbow, TH1 + TH2)
    d.line(o, (o[0], o[1] + 130.0), FAINT, 1.2, "4 4")
    d.line(elbow, _along(elbow, TH1, 1.25), FAINT, 1.2, "4 4")
    d.line(o, elbow, ORANGE, 6.0)
    d.line(elbow, tip, ORANGE, 6.0)
    _swing(d, o, 78.0, 0.0, TH1)
    d.text((o[0] - 20.0, o[1] + 62.0), "θ₁", RED, 15, "middle")
    _swing(d, elbow, 56.0, TH1, TH1 + TH2)
    d.text((elbow[0] - 4.0, elbow[1] + 82.0), "θ₂", RED, 15, "middle")
    d.text((elbow[0] - 14.0, elbow[1] + 4.0), "joint 2", ORANGE, 13, "end")
    d.text((tip[0] + 16.0, tip[1] + 6.0), "E  end-effector", ORANGE, 13)
    for point in (elbow, tip):
        d.circle(point, 5.0, ORANGE, "#ffffff")

    d.arrow(o, (o[0] + 96.0, o[1]), BLUE, 2.4)
    d.arrow(o, (o[0], o[1] + 96.0), BLUE, 2.4)
    d.circle(o, 7.0, BLUE, "#ffffff")
    d.circle(o, 2.0, BLUE, BLUE)
    d.text((o[0] + 62.0, o[1] - 10.0), "x_B", BLUE, 14)
    d.text((o[0] + 10.0, o[1] + 96.0), "z_B", BLUE, 14)
    d.text((o[0] + 12.0, o[1] + 24.0), "B = joint 1", BLUE, 13)
    d.text((180.0, 430.0), "θ₁ from straight down, θ₂ from link 1; both positive", RED, 13)
    d.text((180.0, 448.0), "about +y: a positive angle swings the link forward.", RED, 13)
    d.text((180.0, 466.0), "Drawn: θ₁ = −41.4°, θ₂ = +82.8°.", FAINT, 13)


def top(d: Drawing, o: XY) -> None:
    """Seen from above: x forward upwards, y to the right, z away from the reader."""
    d.text((o[0] - 220.0, 34.0), "from above (z points away from you)", bold=True)
    arm = ROTOR_ARM * 0.42 * SCALE
    radius = ROTOR_RADIUS * 0.3 * SCALE
    for name, x, y, clockwise in (
        ("3 front", 0.0, -1.0, False),
        ("1 rear", 0.0, 1.0, False),
        ("2 left", -1.0, 0.0, True),
        ("4 right", 1.0, 0.0, True),
    ):
        centre = (o[0] + x * arm * 1.45, o[1] + y * arm * 1.45)
        d.line(o, centre, INK, 5.0)
        d.circle(centre, radius, INK, "#f6f8fa")
        r = radius + 7.0
        sweep = 1 if clockwise else 0
        ends = [(centre[0] + side * r * 0.94, centre[1] - r * 0.34) for side in (-1.0, 1.0)]
        start, end = ends if clockwise else ends[::-1]
        d.path(
            f"M {start[0]:.1f} {start[1]:.1f} A {r:g} {r:g} 0 0 {sweep} {end[0]:.1f} {end[1]:.1f}",
            GREEN,
        )
        d.text((centre[0], centre[1] + 5.0), name, INK, 13, "middle")
    d.arrow(o, (o[0], o[1] - 62.0), BLUE, 2.4)
    d.arrow(o, (o[0] + 62.0, o[1]), BLUE, 2.4)
    d.circle(o, 7.0, BLUE, "#ffffff")
    d.line((o[0] - 4.5, o[1] - 4.5), (o[0] + 4.5, o[1] + 4.5), BLUE, 1.4)
    d.line((o[0] - 4.5, o[1] + 4.5), (o[0] + 4.5, o[1] - 4.5), BLUE, 1.4)
    d.text((o[0] + 10.0, o[1] - 50.0), "x_B", BLUE)
    d.text((o[0] + 44.0, o[1] + 24.0), "y_B", BLUE)
    d.text(
        (o[0] - 220.0, 486.0),
        "green: how the rotors turn; 1 and 3 counter-clockwise, which",
        GREEN,
        13,
    )
    d.text(
        (o[0] - 220.0, 504.0),
        "pushes the nose to the right (positive yaw), 2 and 4 the other way.",
        GREEN,
        13,
    )


def _along(start: XY, angle: float, share: float = 1.0) -> XY:
    length = share * LINK * SCALE
    return (start[0] + length * math.sin(angle), start[1] + length * math.cos(angle))


def _swing(d: Drawing, centre: XY, radius: float, start: float, end: float) -> None:
    """An arc from one angle to another, angles from straight down, forward positive."""
    a = (centre[0] + radius * math.sin(start), centre[1] + radius * math.cos(start))
    b = (centre[0] + radius * math.sin(end), centre[1] + radius * math.cos(end))
    sweep = 0 if end > start else 1
    d.path(
        f"M {a[0]:.1f} {a[1]:.1f} A {radius:g} {radius:g} 0 0 {sweep} {b[0]:.1f} {b[1]:.1f}", RED
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/images/frames.svg"))
