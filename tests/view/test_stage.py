"""The vehicle in the picture: a ball at each joint, in the colour of what is kept clear there."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.model.airframe import airframe_of
from fsw.autopilot.model.parts import ON_BASE
from vehicles.vehicle_file import load_vehicle
from view import colours
from view.page import open_server
from view.scene import Margin, Posture
from view.stage import VehicleFigure
from view.vehicle import chain


@pytest.mark.parametrize("name", ["paper", "hexa-3r", "octo-4r"])
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
