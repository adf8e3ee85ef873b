"""The vehicle in the picture: a ball at each joint, in the colour of what is kept clear there."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.model.airframe import airframe_of
from fsw.autopilot.model.parts import ON_BASE
from vehicles.vehicle_file import load_vehicle
from view import colours
from view.page import open_server
from view.scene import Held, Margin, Posture, Scene, Tool
from view.stage import Stage, VehicleFigure
from view.vehicle import chain


@pytest.mark.parametrize("name", ["paper", "hexa-3r", "octo-4r"])
@pytest.mark.filterwarnings("error")
def test_each_joint_is_shown_where_it_is_with_the_margin_of_what_is_there(name: str) -> None:
    airframe = airframe_of(load_vehicle(name))
    joints = airframe.bodies.joints
    posture = Posture((1.0, 2.0, -1.0), (1.0, 0.0, 0.0, 0.0), (0.3,) * joints)
    server = open_server("127.0.0.1", 0, "a flight")
    try:
        figure = VehicleFigure(server.scene, "it", airframe)
        figure.show(posture)
        points = airframe.points
        figure.colour(tuple(Margin(f"wall/{one.name}", 0.01 * one.on, 1.0) for one in points))
        places = [handle.position for handle in (*figure._joints, figure._tool)]
        shown = {handle.name: handle.color for handle in (*figure._joints, figure._tool)}
    finally:
        server.stop()
    np.testing.assert_allclose(places, chain(posture, airframe)[1:], atol=1e-6)
    seen = {one.on for one in airframe.points}
    for on, colour in enumerate(shown.values(), start=ON_BASE + 1):
        assert colour == colours.of_margin(0.01 * on if on in seen else float("nan"))


def test_the_force_on_the_tool_is_an_arrow_that_ends_there_and_what_it_holds_is_a_box() -> None:
    airframe = airframe_of(load_vehicle("probe-2r"))
    posture = Posture((1.0, 2.0, -1.0), (1.0, 0.0, 0.0, 0.0), (0.3, 0.4))
    tip, force = np.array(chain(posture, airframe)[-1]), np.array((-6.0, 0.0, 2.5))
    server = open_server("127.0.0.1", 0, "a flight")
    try:
        stage = Stage(server, airframe)
        parts = stage._force, stage._newtons, stage._payload, stage._grams
        stage.show(Scene(t=0.0, estimate=posture))
        assert not any(part.visible for part in parts)
        touching = Tool((-6.0, 0.0, 2.5), 6.0, 5.0, 10.0, True)
        stage.show(Scene(t=1.0, estimate=posture, tool=touching, held=Held(True, 0.3)))
        assert all(part.visible for part in parts)
        begin, turn = np.array(stage._force.position), np.array(stage._force.wxyz)
        ahead, length = _turned(turn, (0.0, 0.0, 1.0)), 0.32 * stage._force.scale[2]
        np.testing.assert_allclose(begin + length * ahead, tip, atol=1e-6)
        np.testing.assert_allclose(ahead, force / 6.5, atol=1e-6)
        assert (stage._newtons.text, stage._grams.text) == ("6.5 N", "300 g")
        stage.show(Scene(t=2.0, estimate=posture, held=Held(False, 0.0)))
        assert not any(part.visible for part in parts)
    finally:
        server.stop()


def _turned(q: np.ndarray, v: tuple[float, float, float]) -> np.ndarray:
    w, u = q[0], q[1:]
    return np.array(v) + 2.0 * np.cross(u, np.cross(u, v) + w * np.array(v))
