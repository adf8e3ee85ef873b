"""What other programs draw: MCAP read by its own library, layouts whose curves exist."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from mcap.reader import make_reader
from pyulog import ULog

from fsw.autopilot.geometry.quaternion import normalised
from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from pandion.export import main
from tests.view import flights
from tests.view.flights import BALL, HEIGHT, OFFSET_M, TEXT, north, write_flight

Messages = dict[str, list[tuple[float, str, dict[str, Any]]]]


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_flight(tmp_path_factory.mktemp("drawn") / "flown")


@pytest.fixture(scope="module")
def drawn(flight: Path) -> Messages:
    """Time since the start [s], schema and value of each message, by topic."""
    file = flight / "flight.mcap"
    assert main([str(flight), f"--mcap={file}"]) == 0
    found: Messages = {}
    with file.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            t = 1e-9 * message.log_time - 1e-6 * flights.BEGIN_US
            found.setdefault(channel.topic, []).append((t, schema.name, json.loads(message.data)))
            if schema.name.startswith("foxglove."):
                check(json.loads(schema.data), found[channel.topic][-1][2], channel.topic)
    return found


def check(schema: dict[str, Any], value: Any, where: str) -> None:
    """The value is what the schema says: JSON schema, as far as it is used here."""
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int,
             "number": int | float}  # fmt: skip
    assert isinstance(value, kinds[schema["type"]]), where
    if schema["type"] == "object" and schema.get("properties"):
        assert set(value) == set(schema["properties"]), where
        for name, part in value.items():
            check(schema["properties"][name], part, f"{where}.{name}")
    for part in value if schema["type"] == "array" else ():
        check(schema["items"], part, f"{where}[]")


@pytest.mark.long
def test_frames_lead_from_the_world_to_the_vehicle(drawn: Messages) -> None:
    (first, *later) = [value for _, _, value in drawn["/tf"]]
    assert (first["parent_frame_id"], first["child_frame_id"]) == ("world", "ned")
    q = normalised(tuple(first["rotation"][key] for key in "wxyz"))
    turn = np.array(matrix_from_quaternion(q)).reshape(3, 3)
    # north becomes y, east x, and down -z
    np.testing.assert_allclose(turn, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-12)
    assert len(later) == 50 * flights.SECONDS
    t, _, middle = drawn["/tf"][101]
    expected = (north(t) + OFFSET_M[0], OFFSET_M[1], HEIGHT + OFFSET_M[2])
    assert [middle["translation"][axis] for axis in "xyz"] == pytest.approx(expected, abs=1e-6)
    assert middle["timestamp"] == {"sec": 2 + int(t - 1.0), "nsec": round((t % 1.0) * 1e9)}


def test_the_pose_and_the_path_are_those_of_the_log(drawn: Messages) -> None:
    assert {schema for _, schema, _ in drawn["/pose"]} == {"foxglove.PoseInFrame"}
    ((_, schema, path),) = drawn["/path"]
    assert schema == "foxglove.PosesInFrame"
    assert len(path["poses"]) == 5 * flights.SECONDS
    assert path["poses"][-1]["position"]["z"] == pytest.approx(HEIGHT + OFFSET_M[2], abs=1e-6)


def test_the_arm_hangs_where_the_kinematics_say(drawn: Messages) -> None:
    _, schema, update = drawn["/arm"][0]
    assert schema == "foxglove.SceneUpdate"
    (entity,) = update["entities"]
    assert entity["frame_id"] == "base"
    places = [tuple(p[axis] for axis in "xyz") for p in entity["lines"][0]["points"]]
    assert places == [(0.0, 0.0, 0.0), (0.0, 0.0, 0.15), (0.0, 0.0, 0.3)]


@pytest.mark.long
def test_zones_are_drawn_with_their_clearance(drawn: Messages) -> None:
    ((_, _, update),) = drawn["/zones"]
    names = [entity["id"] for entity in update["entities"]]
    assert names == ["zone 1", "zone 2"]
    surface, shell = update["entities"][1]["triangles"]
    middle = np.array(BALL.shape.numbers[:3])
    for part, radius in ((surface, 0.05), (shell, 0.15)):
        points = np.array([[p[axis] for axis in "xyz"] for p in part["points"]])
        np.testing.assert_allclose(np.linalg.norm(points - middle, axis=1), radius, atol=1e-9)
        assert max(part["indices"]) < len(points)
    plane = np.array([p["x"] for p in update["entities"][0]["triangles"][1]["points"]])
    np.testing.assert_allclose(plane, 0.9)


def test_texts_are_in_the_log_with_their_level(drawn: Messages) -> None:
    ((t, schema, said),) = drawn["/log"]
    assert (schema, said["message"], said["level"]) == ("foxglove.Log", TEXT, 4)
    assert t == pytest.approx(2.5)


@pytest.fixture(scope="module")
def layouts(flight: Path) -> Path:
    assert main([str(flight), f"--layouts={flight / 'layouts'}"]) == 0
    return flight / "layouts"


def test_every_curve_of_the_plotjuggler_layout_is_in_a_log(layouts: Path, flight: Path) -> None:
    """PlotJuggler names a series topic/field, and topic/field.00 an element of an array."""
    known = set()
    for topic in ULog(str(flight / "flight.ulg")).data_list:
        for field in topic.data:
            name, _, element = field.rstrip("]").partition("[")
            known.add(f"{topic.name}/{name}" + (f".{int(element):02d}" if element else ""))
    root = ET.parse(layouts / "pandion.plotjuggler.xml").getroot()
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    unwritten = {name for name in curves if name not in known}
    assert len(curves) > 30
    assert {name.partition("/")[0] for name in unwritten} <= {"end_effector"}  # not in this log
    assert next(tab.attrib["tab_name"] for tab in root.iter("Tab")) == "margins"


def test_every_topic_and_path_of_the_foxglove_layout_is_in_the_mcap(
    layouts: Path, drawn: Messages
) -> None:
    layout = json.loads((layouts / "pandion.foxglove.json").read_text(encoding="utf-8"))
    panels = layout["configById"]
    for topic in (*panels["3D!flight"]["topics"], panels["RosOut!log"]["topicToRender"]):
        assert topic in drawn
    assert set(named(layout["layout"])) == set(panels)
    for path in (path["value"] for panel in panels.values() for path in panel.get("paths", ())):
        topic, _, field = path.partition(".")
        if topic == "end_effector":
            continue  # not in this log
        value = drawn[topic][0][2][field.partition("[")[0]]
        if "[" in field:
            value = value[int(field.partition("[")[2].rstrip("]"))]
        assert math.isfinite(value)


def named(layout: Any) -> Iterator[str]:
    """The panels that are placed."""
    if isinstance(layout, str):
        yield layout
    else:
        yield from named(layout["first"])
        yield from named(layout["second"])
