"""An arm and its base out of a URDF, which knows links, joints and masses, but no rotors.

Links that are fixed to each other are one body here. URDF counts z upwards and y to the left (FLU),
a vehicle's file downwards and to the right (FRD): everything is turned by half a turn about x.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, pairwise, takewhile
from typing import Final

import numpy as np
from numpy.typing import NDArray

from command_line.toml_tables import nearest, shown
from command_line.values import plain_float
from vehicles.description import (
    V3,
    V6,
    Base,
    CriticalPoint,
    EndEffector,
    Feet,
    Joint,
    Link,
    Rotor,
    Vehicle,
)
from vehicles.vehicle_file import VehicleError, checked, inertia_matrix

Array = NDArray[np.float64]

MAX_BYTES: Final = 4 * 1024 * 1024
_MOST_LINKS: Final = 500
_MOST: Final = 1e6  # of any number, whatever its unit
_HALF_TURN: Final = np.diag([1.0, -1.0, -1.0])  # about x, from FLU to FRD and back
_MOVE: Final = ("revolute", "continuous")
_RATE, _TORQUE = 5.0, 2.0  # rad/s, N m; of a joint that does not say
_NONE: Final = 1e-9  # m^2, inertia over mass
_GYRATION: Final = 0.02  # m, of a link that has a mass and no inertia
_NAME_LETTERS: Final = 32
_CLEAR: Final = 0.02  # m, of the feet below the arm


@dataclass(frozen=True, slots=True)
class _Body:
    """What has been put together to one rigid body, in one frame."""

    mass: float = 0.0  # kg
    moment: Array = field(default_factory=lambda: np.zeros(3))  # kg m
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))  # kg m^2, about the origin

    def with_part(self, part: _Body, R: Array, p: Array) -> _Body:
        """This one with a part whose frame is turned by R and moved by p [m]."""
        moment = R @ part.moment
        inertia = R @ part.inertia @ R.T
        # About the other origin: of the part's own moment of mass, and of its mass.
        cross = np.outer(p, moment) + np.outer(moment, p)
        inertia = inertia + (2.0 * p @ moment + part.mass * p @ p) * np.eye(3)
        inertia = inertia - cross - part.mass * np.outer(p, p)
        return _Body(
            self.mass + part.mass,
            self.moment + moment + part.mass * p,
            self.inertia + inertia,
        )

    def numbers(self, what: str) -> tuple[float, V3, V6]:
        """Mass, centre of mass and inertia about it."""
        if not self.mass > 0.0:
            raise VehicleError(f"{what} has no mass: must have an inertial with a mass above 0")
        c = self.moment / self.mass
        m = self.inertia - self.mass * (c @ c * np.eye(3) - np.outer(c, c))
        entries = (m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2])
        xx, yy, zz, xy, xz, yz = (float(entry) for entry in entries)
        return self.mass, _v3(c), (xx, yy, zz, xy, xz, yz)


@dataclass(frozen=True, slots=True)
class _Edge:
    """A joint of the URDF."""

    name: str
    kind: str
    parent: str
    child: str
    R: Array
    p: Array  # m
    axis: Array
    element: ET.Element


def vehicle_from_urdf(
    text: str, name: str, rotors: Sequence[Rotor], tip: str = "", *, frd: bool = False
) -> tuple[Vehicle, list[str]]:
    """The vehicle of a URDF's text with these rotors, and what was assumed, a sentence each.

    The arm leads to the link ``tip``, or where there is none to the link behind most joints; joints
    beside it, such as those of propellers, stay at zero. A URDF that counts down and right itself
    is ``frd``.

    Raises:
        VehicleError: It is no URDF, or not one of a vehicle with an arm: the reason.
    """
    links, edges = _elements(text)
    chain, tip = _chain(links, edges, tip)
    notes: list[str] = []
    bodies, places = _put_together(links, edges, [edge.name for edge in chain])
    turn = np.eye(3) if frd else _HALF_TURN
    root = _root(links, edges)
    joints = []
    for edge, called in zip(chain, _own_names(chain, notes), strict=True):
        body, (R, p) = _with_inertia(bodies[edge.child], edge.child, notes), places[edge.name]
        joint = _joint(edge, body, turn @ R @ turn, turn @ p, turn, notes)
        joints.append(replace(joint, name=called))
    notes += _still(edges, chain, tip)
    base = _with_inertia(bodies[root], root, notes)
    mass, com, inertia = _turned(base, turn).numbers(f'link "{root}"')
    p_tip = _place_in(edges, chain[-1].child, tip)
    if not p_tip.any():
        notes.append(
            "the end-effector lies on the last joint: name a link by --tip, or set [end_effector]"
        )
    vehicle = Vehicle(
        name=name,
        base=Base(mass=mass, com=com, inertia=inertia),
        rotors=tuple(rotors),
        joints=tuple(joints),
        end_effector=EndEffector(position=_v3(turn @ p_tip)),
        feet=_feet(rotors, joints, turn @ p_tip),
        rest_posture=_rest(joints, notes),
        critical_points=(
            CriticalPoint(name="base", on="base"),
            *(
                CriticalPoint(name=joint.name, on=before.name, position=joint.xyz)
                for before, joint in pairwise(joints)
            ),
            CriticalPoint(name="end_effector", on=joints[-1].name, position=_v3(turn @ p_tip)),
        ),
    )
    notes.append("feet are put below the rotors and clear of the arm: measure and change them")
    notes.append("there are no parts with a size: add [[parts]] for the body to be kept clear")
    return checked(vehicle), notes


def _elements(text: str) -> tuple[dict[str, _Body], dict[str, _Edge]]:
    """Links and joints by name."""
    if "<xacro:" in text:
        raise VehicleError(
            "this is xacro, not URDF: expand it first, with: xacro robot.urdf.xacro > robot.urdf"
        )
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise VehicleError("the URDF defines entities, which a robot does not need: remove them")
    try:
        robot = ET.fromstring(text)
    except (ET.ParseError, ValueError) as error:
        raise VehicleError(f"no URDF: it is not XML: {error}") from None
    if robot.tag != "robot":
        raise VehicleError(f"no URDF: its root must be <robot>, is <{shown(robot.tag)}>")
    _check_names(robot)
    links = {_name(one): _body(one) for one in robot.findall("link")}
    if not 0 < len(links) <= _MOST_LINKS:
        raise VehicleError(f"links: must be 1 to {_MOST_LINKS} of them, are {len(links)}")
    edges = {}
    for one in robot.findall("joint"):
        edge = _edge(one)
        for end in (edge.parent, edge.child):
            if end not in links:
                raise VehicleError(f'joint "{edge.name}": there is no link {shown(end)}')
        edges[edge.name] = edge
    parents = [edge.child for edge in edges.values()]
    if len(set(parents)) < len(parents) or len(parents) != len(links) - 1:
        raise VehicleError("links must hang together as one tree, each from one joint at most")
    return links, edges


def _check_names(robot: ET.Element) -> None:
    for kind in ("link", "joint"):
        for name, count in Counter(map(_name, robot.findall(kind))).items():
            if count > 1:
                raise VehicleError(f"there are {count} {kind}s {shown(name)}: rename all but one")


def _name(element: ET.Element) -> str:
    name = element.get("name", "")
    if not name:
        raise VehicleError(f"a <{element.tag}> has no name: each must have one")
    return name


def _numbers(element: ET.Element | None, key: str, default: V3) -> Array:
    text = element.get(key) if element is not None else None
    if text is None:
        return np.array(default)
    found = np.array([plain_float(word) for word in text.split()])
    if found.shape != (3,) or not (np.abs(found) <= _MOST).all():
        raise VehicleError(f"{key} = {shown(text)}: must be 3 numbers of at most {_MOST:g}")
    return found


def _number(element: ET.Element | None, key: str, default: float) -> float:
    text = element.get(key) if element is not None else None
    if text is None:
        return default
    value = plain_float(text)
    if not abs(value) <= _MOST:
        raise VehicleError(f"{key} = {shown(text)}: must be a number of at most {_MOST:g}")
    return value


def _pose(element: ET.Element) -> tuple[Array, Array]:
    origin = element.find("origin")
    roll, pitch, yaw = _numbers(origin, "rpy", (0.0, 0.0, 0.0))
    (cr, cp, cy), (sr, sp, sy) = np.cos((roll, pitch, yaw)), np.sin((roll, pitch, yaw))
    R = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return R, _numbers(origin, "xyz", (0.0, 0.0, 0.0))


def _body(link: ET.Element) -> _Body:
    inertial = link.find("inertial")
    if inertial is None:
        return _Body()
    R, p = _pose(inertial)
    mass = _number(inertial.find("mass"), "value", 0.0)
    if mass < 0.0:
        raise VehicleError(f'link "{_name(link)}": mass = {mass:g}: must be 0 or more')
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    entries = [_number(inertial.find("inertia"), key, 0.0) for key in keys]
    xx, yy, zz, xy, xz, yz = entries
    own = _Body(mass, np.zeros(3), inertia_matrix((xx, yy, zz, xy, xz, yz)))
    return _Body().with_part(own, R, p)


def _edge(joint: ET.Element) -> _Edge:
    R, p = _pose(joint)
    ends = [one.get("link", "") if one is not None else "" for one in map(joint.find, _ENDS)]
    axis = _numbers(joint.find("axis"), "xyz", (1.0, 0.0, 0.0))
    return _Edge(_name(joint), joint.get("type", ""), ends[0], ends[1], R, p, axis, joint)


_ENDS: Final = ("parent", "child")


def _root(links: dict[str, _Body], edges: dict[str, _Edge]) -> str:
    (root,) = links.keys() - {edge.child for edge in edges.values()}
    return root


def _path(edges: dict[str, _Edge], link: str) -> list[_Edge]:
    """The joints from the root to a link."""
    above = {edge.child: edge for edge in edges.values()}
    found: list[_Edge] = []
    while link in above:
        if len(found) > len(above):
            raise VehicleError("links must hang together as one tree, each from one joint at most")
        found.append(above[link])
        link = above[link].parent
    return found[::-1]


def _chain(links: dict[str, _Body], edges: dict[str, _Edge], tip: str) -> tuple[list[_Edge], str]:
    """The joints of the arm that move, and its last link."""
    if tip and tip not in links:
        raise VehicleError(f"there is no link {shown(tip)}{nearest(tip, links)}")
    moving = {link: [edge for edge in _path(edges, link) if edge.kind != "fixed"] for link in links}
    if not tip:
        most = max(map(len, moving.values()))
        last = dict.fromkeys(_arm_s_end(edges, one) for one in links if len(moving[one]) == most)
        ends = list(dict.fromkeys(end for one in last for end in _fixed_ends(edges, one)))
        if len(ends) > 1:
            raise VehicleError(
                f"{len(ends)} links are behind {most} joints each: name the one that the arm ends "
                f"with: --tip {ends[0]}, or {_listed(ends[1:])}"
            )
        (tip,) = ends
    if not moving[tip]:
        raise VehicleError(f'no joint moves the link "{tip}": an arm must have at least one')
    for edge in moving[tip]:
        if edge.kind == "floating":
            raise VehicleError(
                f'joint "{edge.name}" is floating: the base flies as it is: remove this joint and '
                f'the link "{edge.parent}" it is on'
            )
        if edge.kind not in _MOVE:
            raise VehicleError(
                f'joint "{edge.name}" is {shown(edge.kind)}: joints of an arm must be revolute, '
                "continuous or fixed; name a link before it by --tip"
            )
        if not _of_arm(edge):
            raise VehicleError(
                f'joint "{edge.name}" follows another one (mimic): each joint of an arm must have '
                "a drive of its own; name a link before it by --tip"
            )
    return moving[tip], tip


def _arm_s_end(edges: dict[str, _Edge], link: str) -> str:
    """The last link before a joint that is none of an arm, as of fingers; without arm the link."""
    path = _path(edges, link)
    arm = list(takewhile(lambda edge: edge.kind == "fixed" or _of_arm(edge), path))
    return arm[-1].child if any(map(_of_arm, arm)) else link


def _fixed_ends(edges: dict[str, _Edge], link: str) -> list[str]:
    """The outermost links that are fixed to a link, or itself."""
    on_it = [edge.child for edge in edges.values() if edge.parent == link and edge.kind == "fixed"]
    return [end for one in on_it for end in _fixed_ends(edges, one)] or [link]


def _still(edges: dict[str, _Edge], chain: list[_Edge], tip: str) -> list[str]:
    """Which joints stay at zero and why, a sentence each."""
    still = [edge for edge in edges.values() if edge.kind != "fixed" and edge not in chain]
    ways = {
        edge.name: [one.name for one in _path(edges, edge.child) if one.kind != "fixed"]
        for edge in still
    }
    arm, notes = [edge.name for edge in chain], []
    ends = [edge for edge in still if ways[edge.name][:-1] == arm and not _of_arm(edge)]
    behind = [name for name, way in ways.items() if any(end.name in way for end in ends)]
    if ends:
        why = _listed(f"{end.name} ({end.kind if end.kind not in _MOVE else 'mimic'})"
                      for end in ends)  # fmt: skip
        notes.append(
            f"the arm ends before joint {why}, so these stay at zero: {_listed(behind)}; the "
            f"end-effector is the link {tip}"
        )
    if beside := [name for name in ways if name not in behind]:
        notes.append(f"{len(beside)} joints beside the arm stay at zero: {_listed(beside)}")
    return notes


def _of_arm(edge: _Edge) -> bool:
    """Whether it turns, by a drive of its own."""
    return edge.kind in _MOVE and edge.element.find("mimic") is None


def _listed(names: Iterable[str]) -> str:
    """Up to three names."""
    first = list(islice(names, 4))
    return ", ".join(first if len(first) < 4 else [*first[:3], "..."])


def _with_inertia(body: _Body, link: str, notes: list[str]) -> _Body:
    """The body; one without any size about some axis, as placeholders have none, with a ball's."""
    if not body.mass > 0.0:
        return body
    c = body.moment / body.mass
    about_centre = body.inertia - body.mass * (c @ c * np.eye(3) - np.outer(c, c))
    if abs(np.linalg.eigvalsh(about_centre)[0]) > _NONE * body.mass:
        return body
    notes.append(f"link {link}: no inertia: {1e3 * _GYRATION:.0f} mm of gyration are assumed")
    ball = body.mass * _GYRATION**2 * np.eye(3)
    return _Body(body.mass, body.moment, body.inertia + ball)


def _put_together(
    links: dict[str, _Body], edges: dict[str, _Edge], moving: Sequence[str]
) -> tuple[dict[str, _Body], dict[str, tuple[Array, Array]]]:
    """Bodies by the link they are carried by, and poses of the joints that move on those."""
    root = _root(links, edges)
    below: dict[str, list[_Edge]] = {}
    for edge in edges.values():
        below.setdefault(edge.parent, []).append(edge)
    bodies: dict[str, _Body] = {}
    places: dict[str, tuple[Array, Array]] = {}
    ahead = [(root, root, np.eye(3), np.zeros(3))]
    while ahead:
        link, carrier, R, p = ahead.pop()
        bodies[carrier] = bodies.get(carrier, _Body()).with_part(links[link], R, p)
        for edge in below.get(link, ()):
            to = R @ edge.R, p + R @ edge.p
            if edge.name in moving:
                places[edge.name] = to
                ahead.append((edge.child, edge.child, np.eye(3), np.zeros(3)))
            else:
                ahead.append((edge.child, carrier, *to))
    return bodies, places


def _place_in(edges: dict[str, _Edge], carrier: str, link: str) -> Array:
    """Where a link is that is fixed to its carrier, in the carrier's frame [m]."""
    R, p = np.eye(3), np.zeros(3)
    for edge in _path(edges, link)[len(_path(edges, carrier)) :]:
        R, p = R @ edge.R, p + R @ edge.p
    return p


def _turned(body: _Body, turn: Array) -> _Body:
    return _Body().with_part(body, turn, np.zeros(3))


def _own_names(chain: list[_Edge], notes: list[str]) -> list[str]:
    """A name of letters, digits and "_" for each joint, which nothing else of a vehicle has."""
    found, taken = [], {"base", "end_effector"}
    for k, edge in enumerate(chain, start=1):
        name = "".join(c if c.isascii() and c.isalnum() else "_" for c in edge.name)[:_NAME_LETTERS]
        if not name.strip("_"):
            name = f"joint_{k}"
        elif name[0].isdigit():
            name = f"joint_{name}"[:_NAME_LETTERS]
        others = (f"{name[: _NAME_LETTERS - 4]}_{i}" for i in range(k, k + len(taken)))
        name = next(one for one in (name, *others) if one not in taken)
        found.append(name)
        taken.add(name)
    if changed := [
        f"{shown(edge.name)} is {name}" for edge, name in zip(chain, found, strict=True)
        if name != edge.name
    ]:  # fmt: skip
        notes.append(f"joints are renamed: {', '.join(changed)}")
    return found


def _rest(joints: Sequence[Joint], notes: list[str]) -> tuple[float, ...]:
    """The angles [rad] that are nearest to zero within the limits; none if all are zero."""
    rest = tuple(min(max(0.0, one.position_min), one.position_max) for one in joints)
    if not any(rest):
        return ()
    notes.append(
        f"a joint cannot be at zero: rest_posture is {shown([*rest])} rad, the nearest allowed"
    )
    return rest


def _joint(edge: _Edge, body: _Body, R: Array, p: Array, turn: Array, notes: list[str]) -> Joint:
    limit, dynamics = edge.element.find("limit"), edge.element.find("dynamics")
    rate = _stated(limit, edge.name, "velocity", (100.0, _RATE, "rad/s"), notes)
    torque = _stated(limit, edge.name, "effort", (1000.0, _TORQUE, "N m"), notes)
    low, high = -math.inf, math.inf
    if edge.kind == "revolute":
        low, high = _number(limit, "lower", 0.0), _number(limit, "upper", 0.0)
        if low == high:  # as exporters write what they do not know
            notes.append(f"joint {edge.name}: {low:g} to {high:g} is no limit: it turns freely")
            low, high = -math.inf, math.inf
    size = float(np.linalg.norm(edge.axis))
    mass, com, inertia = _turned(body, turn).numbers(f'link "{edge.child}"')
    return Joint(
        name=edge.name,
        axis=_v3(turn @ edge.axis / size if size > 0.0 else edge.axis),
        xyz=_v3(p),
        rpy=_angles(R),
        position_min=low,
        position_max=high,
        rate_max=rate,
        torque_max=torque,
        viscous=_number(dynamics, "damping", 0.0),
        coulomb=_number(dynamics, "friction", 0.0),
        link=Link(mass=mass, com=com, inertia=inertia),
    )


def _stated(
    limit: ET.Element | None,
    joint: str,
    key: str,
    allowed: tuple[float, float, str],
    notes: list[str],
) -> float:
    """A limit; where it is none that a drive has, as of robots in games, one that is assumed."""
    most, assumed, unit = allowed
    value = _number(limit, key, 0.0)
    if 0.0 < value <= most:
        return value
    notes.append(f"joint {joint}: {key} = {value:g} is no limit: {assumed:g} {unit} is assumed")
    return assumed


def _angles(R: Array) -> V3:
    """Roll, pitch and yaw about fixed axes [rad]."""
    pitch = math.atan2(-R[2, 0], math.hypot(R[2, 1], R[2, 2]))
    if math.hypot(R[2, 1], R[2, 2]) < 1e-9:  # looking up or down: roll and yaw are one
        return 0.0, pitch, math.atan2(-R[0, 1], R[1, 1])
    return math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])


def _feet(rotors: Sequence[Rotor], joints: Sequence[Joint], tip: Array) -> Feet:
    """Four feet below the rotors, further down than the arm reaches from its first joint."""
    spread = 0.7 * max(max(abs(rotor.position[0]), abs(rotor.position[1])) for rotor in rotors)
    reach = sum(math.hypot(*joint.xyz) for joint in joints[1:]) + float(np.linalg.norm(tip))
    down = max(joints[0].xyz[2], 0.0) + reach + _CLEAR
    spread, down = max(spread, 0.05), min(down, 10.0)
    return Feet(positions=tuple((x, y, down) for x in (spread, -spread) for y in (spread, -spread)))


def _v3(values: Array) -> V3:
    x, y, z = (float(value) for value in values)
    return x, y, z
