"""Draw docs/images/architecture.svg: ``python docs/figures/architecture.py [FILE]``."""

from __future__ import annotations

import sys
from pathlib import Path

from drawing import BLUE, FAINT, GREEN, INK, ORANGE, XY, Drawing

PALE = "#f6f8fa"
TICK = (
    ("estimate, validity", "estimation/"),
    ("mission, commands, faults", "runtime/, vehicle/"),
    ("plan: take over, ask", "runtime/planning.py"),
    ("cascade", "control/"),
    ("safety gate", "vehicle/safety_gate.py"),
)
CYCLE = (
    ("start, moved on by the delay", "runtime/planning.py"),
    ("linearise the horizon", "model/linearisation.py"),
    ("costs, barriers, limits", "mpc/, barriers/"),
    ("refill the program, solve (2x)", "mpc/qp_data.py"),
    ("Plan or PlanFailure", "signals.py"),
)


def main(path: Path) -> None:
    """Draw the processes and what goes round in them."""
    d = Drawing(1080, 600)
    sitl(d)
    fsw(d)
    between(d)
    d.save(path)


def sitl(d: Drawing) -> None:
    """The simulator's process."""
    d.box((20.0, 60.0), (250.0, 360.0), fill=PALE)
    d.text((145.0, 46.0), "process sitl", anchor="middle", bold=True)
    stage(d, (36.0, 84.0), 218.0, "pilot", "link/pilot.py", ORANGE)
    stage(d, (36.0, 150.0), 218.0, "sensors: noise, latency", "sensors/")
    stage(d, (36.0, 232.0), 218.0, "plant: RK4 at 1 kHz", "plant/")
    stage(d, (36.0, 298.0), 218.0, "disturbances", "disturbances/")
    stage(d, (36.0, 364.0), 218.0, "referee: true margins", "referee.py, world.py")
    d.arrow((145.0, 232.0), (145.0, 196.0))
    d.arrow((145.0, 298.0), (145.0, 278.0))
    d.path("M 38 255 L 27 255 L 27 387 L 38 387", FAINT)


def fsw(d: Drawing) -> None:
    """The flight software's process."""
    d.box((500.0, 60.0), (560.0, 360.0), fill=PALE)
    d.text((780.0, 46.0), "process fsw", anchor="middle", bold=True)
    d.text((520.0, 84.0), "tick, 500 Hz: runtime/flight_loop.py", BLUE, 13)
    d.text((800.0, 84.0), "cycle, 10 Hz: mpc/planner.py", GREEN, 13)
    for k, (words, where) in enumerate(TICK):
        y = 98.0 + 64.0 * k
        stage(d, (520.0, y), 236.0, words, where, BLUE)
        if k:
            d.arrow((638.0, y - 18.0), (638.0, y), BLUE)
    for k, (words, where) in enumerate(CYCLE):
        y = 98.0 + 64.0 * k
        stage(d, (800.0, y), 240.0, words, where, GREEN)
        if k:
            d.arrow((920.0, y - 18.0), (920.0, y), GREEN)
    d.arrow((756.0, 236.0), (800.0, 124.0), GREEN)
    d.arrow((800.0, 376.0), (756.0, 256.0), GREEN)


def between(d: Drawing) -> None:
    """What passes between the processes, and the ground station."""
    d.arrow((270.0, 120.0), (500.0, 120.0), ORANGE)
    d.text((385.0, 92.0), "targets, walls or sphere,", ORANGE, 13, "middle")
    d.text((385.0, 110.0), "arm, set mode", ORANGE, 13, "middle")
    d.arrow((270.0, 174.0), (500.0, 174.0))
    d.text((385.0, 164.0), "ODOMETRY, ARM_JOINT_STATE,", INK, 13, "middle")
    d.text((385.0, 192.0), "HIL_SENSOR last", INK, 13, "middle")
    d.arrow((500.0, 256.0), (270.0, 256.0))
    d.text((385.0, 246.0), "HIL_ACTUATOR_CONTROLS", INK, 13, "middle")
    d.text((385.0, 274.0), "(COMMAND_ACK, STATUSTEXT)", INK, 13, "middle")
    d.text((385.0, 330.0), "UDP, one datagram each way", FAINT, 13, "middle")
    d.text((385.0, 348.0), "per step of 2 ms", FAINT, 13, "middle")
    d.box((500.0, 510.0), (560.0, 56.0), fill=PALE)
    d.text(
        (780.0, 544.0), "ground station, UDP 14550 (QGroundControl, pymavlink)", INK, 14, "middle"
    )
    d.arrow((640.0, 420.0), (640.0, 510.0))
    d.text((652.0, 470.0), "telemetry, .tlog", INK, 13)
    d.arrow((920.0, 510.0), (920.0, 420.0))
    d.text((932.0, 470.0), "commands", INK, 13)
    d.box((20.0, 510.0), (250.0, 56.0), fill=PALE)
    d.text((145.0, 534.0), "pandion fly", INK, 14, "middle", bold=True)
    d.text((145.0, 553.0), "starts both, gives the verdict", INK, 13, "middle")
    d.arrow((145.0, 510.0), (145.0, 420.0), FAINT)
    d.path("M 270 538 L 430 538 L 430 400 L 500 400", FAINT)


def stage(d: Drawing, corner: XY, width: float, words: str, where: str, colour: str = INK) -> None:
    """A box with what it does and where that is."""
    d.box(corner, (width, 46.0), colour)
    middle = corner[0] + width / 2.0
    d.text((middle, corner[1] + 19.0), words, INK, 13, "middle")
    d.text((middle, corner[1] + 37.0), where, FAINT, 12, "middle")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("docs/images/architecture.svg"))
