"""A flight as Foxglove draws it: frames, scene, path and log, in its own message types.

Everything lies in the frame ``ned``, which hangs below ``world`` (east, north, up), because
Foxglove draws z upwards. Frames and poses are the vehicle's own estimate.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.signals import Vec3, Zone
from view.flight_data import FlightData, Table, UlogError
from view.scene import Posture, vec3
from view.vehicle import airframe_of, chain, rotor_hubs, sizes_of
from view.zone_meshes import Mesh, zone_mesh

Array = NDArray[Any]

WORLD, NED, BASE = "world", "ned", "base"
_SCENE_EVERY: Final = 5  # estimates, which come 50 times a second: the arm is drawn at 10 Hz
_PATH_EVERY: Final = 10
_AROUND_M: Final = 0.5  # of the path that a wall is drawn
_HALF: Final = math.sqrt(0.5)
_FROM_NED: Final = {"w": 0.0, "x": _HALF, "y": _HALF, "z": 0.0}  # north to y, east to x, down to -z
_SAME: Final = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
_DEBUG, _INFO, _WARNING, _ERROR, _FATAL = 1, 2, 3, 4, 5  # levels of foxglove.Log
_LEVELS: Final = (_FATAL, _FATAL, _FATAL, _ERROR, _WARNING, _INFO, _INFO, _DEBUG)
_BODY: Final = {"r": 0.04, "g": 0.41, "b": 0.85, "a": 1.0}
_ARM: Final = {"r": 0.74, "g": 0.3, "b": 0.0, "a": 1.0}
_REFERENCE: Final = {"r": 0.1, "g": 0.5, "b": 0.22, "a": 1.0}
_ZONE: Final = {"r": 0.81, "g": 0.13, "b": 0.18, "a": 0.5}
_SHELL: Final = {"r": 0.81, "g": 0.13, "b": 0.18, "a": 0.12}
_PRIMITIVES: Final = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts",
                      "models")  # fmt: skip


class Shown(NamedTuple):
    """One message."""

    topic: str
    schema: str  # Foxglove's name of its type
    t: float  # s, sensor time
    value: dict[str, Any]


def foxglove_messages(flight: FlightData) -> Iterator[Shown]:
    """Everything that Foxglove's panels draw of a flight, topic by topic."""
    yield from _texts(flight)
    position = flight.tables.get("vehicle_local_position")
    attitude = flight.tables.get("vehicle_attitude")
    if position is None or attitude is None:
        return
    places = np.stack([position[name] for name in ("x", "y", "z")], axis=1).astype("f8")
    yield from _frames(flight, position, attitude, places)
    yield from _path(position, attitude, places)
    yield _still(flight, places)
    yield from _arm(flight)
    yield from _zones(flight, places)


def schema_text(name: str) -> dict[str, Any]:
    """The JSON schema of a message type, as far as it is used here."""
    return {"title": name, "type": "object", "properties": _SCHEMAS[name]}


def _stamp(t: float) -> dict[str, int]:
    """Sensor time [s] as Foxglove counts it."""
    us = round(1e6 * t)
    return {"sec": us // 1_000_000, "nsec": 1000 * (us % 1_000_000)}


def _xyz(p: Any) -> dict[str, float]:
    return {"x": float(p[0]), "y": float(p[1]), "z": float(p[2])}


def _turn(q: Any) -> dict[str, float]:
    return {"w": float(q[0]), "x": float(q[1]), "y": float(q[2]), "z": float(q[3])}


def _texts(flight: FlightData) -> Iterator[Shown]:
    for said in flight.texts:
        yield Shown("/log", "foxglove.Log", said.t, {
            "timestamp": _stamp(said.t), "level": _LEVELS[said.severity & 7],
            "message": said.text, "name": "vehicle", "file": "", "line": 0,
        })  # fmt: skip


def _frames(flight: FlightData, position: Table, attitude: Table, places: Array) -> Iterator[Shown]:
    t = flight.begin
    yield Shown("/tf", "foxglove.FrameTransform", t, {
        "timestamp": _stamp(t), "parent_frame_id": WORLD, "child_frame_id": NED,
        "translation": _xyz((0.0, 0.0, 0.0)), "rotation": _FROM_NED,
    })  # fmt: skip
    for t, p, q in zip(position.t.tolist(), places, _at(attitude, position.t), strict=True):
        yield Shown("/tf", "foxglove.FrameTransform", t, {
            "timestamp": _stamp(t), "parent_frame_id": NED, "child_frame_id": BASE,
            "translation": _xyz(p), "rotation": _turn(q),
        })  # fmt: skip
        pose = {"position": _xyz(p), "orientation": _turn(q)}
        yield Shown("/pose", "foxglove.PoseInFrame", t,
                    {"timestamp": _stamp(t), "frame_id": NED, "pose": pose})  # fmt: skip


def _at(attitude: Table, t: Array) -> Array:
    """The attitude at each of the times ``t`` (n,) [s]: the newest until then."""
    rows = np.clip(np.searchsorted(attitude.t, t, side="right") - 1, 0, len(attitude) - 1)
    return np.asarray(attitude["q"][rows], "f8")


def _path(position: Table, attitude: Table, places: Array) -> Iterator[Shown]:
    """The whole path at once, from the first moment on."""
    t = position.t[::_PATH_EVERY]
    poses = [
        {"position": _xyz(p), "orientation": _turn(q)}
        for p, q in zip(places[::_PATH_EVERY], _at(attitude, t), strict=True)
    ]
    begin = float(position.t[0])
    yield Shown("/path", "foxglove.PosesInFrame", begin,
                {"timestamp": _stamp(begin), "frame_id": NED, "poses": poses})  # fmt: skip


def _scene(t: float, *entities: dict[str, Any], topic: str = "/scene") -> Shown:
    return Shown(topic, "foxglove.SceneUpdate", t, {"deletions": [], "entities": list(entities)})


def _entity(t: float, name: str, frame: str, **primitives: list[Any]) -> dict[str, Any]:
    return {
        "timestamp": _stamp(t), "frame_id": frame, "id": name, "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True, "metadata": [],
        **{kind: primitives.get(kind, []) for kind in _PRIMITIVES},
    }  # fmt: skip


def _pose(p: Any) -> dict[str, Any]:
    return {"position": _xyz(p), "orientation": _SAME}


def _line(points: Array, colour: dict[str, float], thickness: float) -> dict[str, Any]:
    return {
        "type": 0, "pose": _pose((0.0, 0.0, 0.0)), "thickness": thickness,
        "scale_invariant": False, "points": [_xyz(p) for p in points], "color": colour,
        "colors": [], "indices": [],
    }  # fmt: skip


def _still(flight: FlightData, places: Array) -> Shown:
    """What is drawn once: frame and rotors of the vehicle, the reference's path."""
    airframe = airframe_of(flight.information)
    t, hubs, size = flight.begin, rotor_hubs(airframe), sizes_of(airframe)
    rotors = [
        {
            "pose": _pose(hub), "bottom_scale": 1.0, "top_scale": 1.0, "color": {**_BODY, "a": 0.4},
            "size": _xyz((2.0 * size.blade, 2.0 * size.blade, size.disc)),
        }
        for hub in hubs
    ]  # fmt: skip
    hull = {
        "pose": _pose((0.0, 0.0, 0.0)), "size": _xyz((2.0 * size.hull,) * 3), "color": _BODY,
    }  # fmt: skip
    beams = [_line(np.array(((0.0, 0.0, 0.0), hub)), _BODY, 0.02) for hub in hubs]
    vehicle = _entity(t, "vehicle", BASE, cylinders=rotors, spheres=[hull], lines=beams)
    followed = flight.tables.get("sim_tracking")
    target = followed["target"] if followed is not None else places[:0]
    reference = _entity(t, "reference", NED, lines=[_line(target, _REFERENCE, 0.008)])
    return _scene(t, vehicle, reference)


def _arm(flight: FlightData) -> Iterator[Shown]:
    """The links, in the vehicle's frame."""
    joints = flight.tables.get("arm_joint_state")
    if joints is None:
        return
    airframe, rows = airframe_of(flight.information), slice(None, None, _SCENE_EVERY)
    sizes = sizes_of(airframe)
    for t, q in zip(joints.t[rows].tolist(), joints["q"][rows].tolist(), strict=True):
        arm = chain(Posture((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), tuple(q)), airframe)
        tool = {"pose": _pose(arm[-1]), "size": _xyz((2.0 * sizes.tool,) * 3), "color": _ARM}
        shown = _line(np.array(arm), _ARM, 2.0 * sizes.link)
        yield _scene(t, _entity(t, "arm", BASE, lines=[shown], spheres=[tool]), topic="/arm")


def _zones(flight: FlightData, places: Array) -> Iterator[Shown]:
    """The zones, whenever others than before are announced; none in a log of another build."""
    seen = places[np.isfinite(places).all(axis=1)]
    low, high = seen.min(axis=0) - _AROUND_M, seen.max(axis=0) + _AROUND_M
    region = vec3(low), vec3(high)
    try:
        announced = flight.decoded("announced")
    except UlogError:
        return
    before: tuple[Zone, ...] | None = None
    for t, sets in announced:
        if not sets or sets[-1].safe_set.zones == before:
            continue
        before = sets[-1].safe_set.zones
        deletion = {"timestamp": _stamp(t), "type": 1, "id": ""}
        shown = [_zone(t, k, zone, region) for k, zone in enumerate(before, start=1)]
        value = {"deletions": [deletion], "entities": shown}
        yield Shown("/zones", "foxglove.SceneUpdate", t, value)


def _zone(t: float, k: int, zone: Zone, region: tuple[Vec3, Vec3]) -> dict[str, Any]:
    drawn = zone_mesh(zone, region, None)
    if drawn is None:
        return _entity(t, f"zone {k}", NED)
    parts = [_triangles(drawn.surface, _SHELL if zone.keep_in else _ZONE)]
    if drawn.shell is not None:
        parts.append(_triangles(drawn.shell, _SHELL))
    return _entity(t, f"zone {k}", NED, triangles=parts)


def _triangles(mesh: Mesh, colour: dict[str, float]) -> dict[str, Any]:
    return {
        "pose": _pose((0.0, 0.0, 0.0)), "points": [_xyz(p) for p in mesh.vertices],
        "color": colour, "colors": [], "indices": mesh.faces.reshape(-1).tolist(),
    }  # fmt: skip


def _object(**properties: Any) -> dict[str, Any]:
    return {"type": "object", "properties": properties}


def _list(of: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": of}


_TEXT: Final[dict[str, Any]] = {"type": "string"}
_NUMBER: Final[dict[str, Any]] = {"type": "number"}
_WHOLE: Final[dict[str, Any]] = {"type": "integer"}
_TRUTH: Final[dict[str, Any]] = {"type": "boolean"}
_TIME: Final = {**_object(sec=_WHOLE, nsec=_WHOLE), "title": "time"}
_VECTOR: Final = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION: Final = _object(x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_COLOUR: Final = _object(r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_POSE: Final = _object(position=_VECTOR, orientation=_QUATERNION)
_SPHERES: Final = _list(_object(pose=_POSE, size=_VECTOR, color=_COLOUR))
_CYLINDERS: Final = _list(
    _object(pose=_POSE, size=_VECTOR, bottom_scale=_NUMBER, top_scale=_NUMBER, color=_COLOUR)
)
_LINES: Final = _list(
    _object(
        type=_WHOLE, pose=_POSE, thickness=_NUMBER, scale_invariant=_TRUTH, points=_list(_VECTOR),
        color=_COLOUR, colors=_list(_COLOUR), indices=_list(_WHOLE),
    )
)  # fmt: skip
_TRIANGLES: Final = _list(
    _object(pose=_POSE, points=_list(_VECTOR), color=_COLOUR, colors=_list(_COLOUR),
            indices=_list(_WHOLE))
)  # fmt: skip
_ENTITY: Final = _object(
    timestamp=_TIME, frame_id=_TEXT, id=_TEXT,
    lifetime={**_object(sec=_WHOLE, nsec=_WHOLE), "title": "duration"}, frame_locked=_TRUTH,
    metadata=_list(_object(key=_TEXT, value=_TEXT)),
    **{kind: _list(_object()) for kind in ("arrows", "cubes", "texts", "models")},
    spheres=_SPHERES, cylinders=_CYLINDERS, lines=_LINES, triangles=_TRIANGLES,
)  # fmt: skip
_SCHEMAS: Final[dict[str, dict[str, Any]]] = {
    "foxglove.Log": {
        "timestamp": _TIME, "level": _WHOLE, "message": _TEXT, "name": _TEXT, "file": _TEXT,
        "line": _WHOLE,
    },
    "foxglove.FrameTransform": {
        "timestamp": _TIME, "parent_frame_id": _TEXT, "child_frame_id": _TEXT,
        "translation": _VECTOR, "rotation": _QUATERNION,
    },
    "foxglove.PoseInFrame": {"timestamp": _TIME, "frame_id": _TEXT, "pose": _POSE},
    "foxglove.PosesInFrame": {"timestamp": _TIME, "frame_id": _TEXT, "poses": _list(_POSE)},
    "foxglove.SceneUpdate": {
        "deletions": _list(_object(timestamp=_TIME, type=_WHOLE, id=_TEXT)),
        "entities": _list(_ENTITY),
    },
}  # fmt: skip
