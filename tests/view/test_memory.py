"""Tests that a page that is open for hours does not grow."""

import numpy as np

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.signals import SafeSet, Zone
from view.flight import Trail
from view.page import open_server
from view.scene import Posture, Scene
from view.stage import Stage


def test_what_a_browser_must_be_given_stays_as_much() -> None:
    server = open_server("127.0.0.1", 0, "a flight")
    try:
        stage = Stage(server, AIRFRAME)
        kept = server._websock_server._broadcast_buffer.message_from_id
        counts = []
        points = np.arange(33.0).reshape(11, 3)
        for k in range(30):
            stage.extend_trail(k, Trail(points, np.full(11, 0.1)), most=5)
            zone = Zone(ball((0.1 * k, 0.0, -1.0), 0.1), 0.1)
            posture = Posture((0.0, 0.0, -0.1 * k), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0))
            stage.show(Scene(t=float(k), estimate=posture, safe_set=SafeSet((zone,))))
            counts.append(len(kept))
    finally:
        server.stop()
    assert counts[-1] <= counts[9] + 5
