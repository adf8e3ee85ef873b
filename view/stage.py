"""The three-dimensional part of the page. Everything is in the local frame: NED, metres."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, Final

import numpy as np
import viser
from numpy.typing import NDArray

from fsw.autopilot.geometry.rotation import quaternion_from_matrix
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.model.parts import ON_BASE
from fsw.autopilot.signals import RotorVector, SafeSet, Vec3, Vec4
from view import colours
from view.colours import Rgb
from view.flight import Trail
from view.scene import Margin, Posture, Scene
from view.vehicle import chain, legs, rotor_hubs, sizes_of
from view.zone_meshes import Mesh, moved, zone_mesh

Array = NDArray[Any]

_UP: Final[Vec4] = (0.0, 1.0, 0.0, 0.0)  # z of a part points up: half a turn about x
_ARROW: Final = 0.32  # m, of a rotor's full thrust
_FORCE: Final = 0.03  # m/N, of the arrow on the tool
_PAYLOAD: Final = 0.06  # m, of the box that stands for what is held
_SHOWN: Final = 0.005  # kg
_SIGMAS: Final = 3.0
_EDGE: Final[Rgb] = (232, 150, 156)


class VehicleFigure:
    """Hull, rotors, legs, links and tool."""

    def __init__(
        self, scene: viser.SceneApi, name: str, airframe: Airframe, ghost: Rgb | None = None
    ) -> None:
        """Draw it invisible; a ``ghost`` is pale, of one colour and without thrusts."""
        self._name, self._airframe = name, airframe
        self._scene = scene
        self._tone: dict[str, Any] = {"cast_shadow": ghost is None, "receive_shadow": False}
        if ghost is not None:
            self._tone["opacity"] = 0.3
        self._ghost = ghost
        self._body = scene.add_frame(name, show_axes=False, visible=False)
        self._arrows: list[viser.MeshHandle] = []
        self._sizes = sizes_of(airframe)
        self._add_hull()
        for k, hub in enumerate(rotor_hubs(airframe)):
            self._add_rotor(k, hub)
        self._add_legs()
        size = self._sizes
        self._links = [
            scene.add_cylinder(
                f"{name}-link{k}",
                radius=0.7 * size.link,
                height=length,
                color=ghost or colours.DARK,
                visible=False,
                **self._tone,
            )
            for k, length in enumerate(_lengths(airframe), start=1)
        ]
        self._joints = [
            scene.add_icosphere(
                f"{name}-joint{k}",
                radius=size.link,
                color=ghost or colours.GREY,
                visible=False,
                **self._tone,
            )
            for k in range(2, len(self._links) + 1)
        ]
        self._tool = scene.add_icosphere(
            f"{name}-tool", radius=size.tool, color=ghost or colours.ORANGE, visible=False,
            **self._tone,
        )  # fmt: skip
        self._shown = False
        self._colours: dict[str, Rgb] = {}

    def show(self, posture: Posture | None, thrust: RotorVector | None = None) -> None:
        """Move it to a ``posture``; without one it is not visible. ``thrust`` [N] of each rotor."""
        if (posture is not None) != self._shown:
            self._shown = posture is not None
            for part in (self._body, *self._links, *self._joints, self._tool):
                part.visible = self._shown
        if posture is None:
            return
        self._body.position, self._body.wxyz = posture.p, posture.q
        arm = chain(posture, self._airframe)
        for link, (begin, end) in zip(self._links, pairwise(arm), strict=True):
            link.position, link.wxyz = _between(begin, end)
        for joint, place in zip(self._joints, arm[1:-1], strict=True):
            joint.position = place
        self._tool.position = arm[-1]
        tops = self._airframe.rotor_thrust_max
        for arrow, newtons, top in zip(self._arrows, thrust or (), tops, strict=False):
            arrow.scale = (1.0, 1.0, max(newtons / top, 0.01))

    def colour(self, margins: tuple[Margin, ...]) -> None:
        """Give the parts that are kept clear the colour of their least margin."""
        points = self._airframe.points
        least = dict.fromkeys((one.name for one in points), math.nan)
        for one in margins:
            part = one.name.rpartition("/")[2]
            if part in least:
                least[part] = float(np.fmin(least[part], one.margin))
        # What is on the last link colours the tool, what is on one before it the joint at its end.
        for on, handle in enumerate((self._hull, *self._joints, self._tool), start=ON_BASE):
            seen = [least[one.name] for one in points if one.on == on]
            colour = colours.of_margin(float(np.fmin.reduce(seen)) if seen else math.nan)
            if self._colours.get(handle.name) != colour:
                self._colours[handle.name] = colour
                handle.color = colour

    def _add_hull(self) -> None:
        size = self._sizes
        self._hull = self._scene.add_icosphere(
            f"{self._name}/hull", radius=0.6 * size.hull, color=self._ghost or colours.GREY,
            scale=(1.25, 1.25, 0.62), **self._tone,
        )  # fmt: skip
        if self._ghost is None:  # where the nose is
            self._scene.add_box(
                f"{self._name}/nose", color=colours.BLUE, dimensions=(0.05, 0.025, 0.015),
                position=(0.085, 0.0, 0.0), **self._tone,
            )  # fmt: skip

    def _add_rotor(self, k: int, hub: Vec3) -> None:
        name, size, tone = f"{self._name}/rotor{k}", self._sizes, self._tone
        middle, turn = _between((0.0, 0.0, 0.0), hub)
        self._scene.add_cylinder(
            f"{name}/arm", radius=0.011, height=math.hypot(*hub),
            color=self._ghost or colours.DARK, position=middle, wxyz=turn, **tone,
        )  # fmt: skip
        front = self._ghost or (colours.BLUE if k == 2 else colours.GREY)
        self._scene.add_cylinder(
            f"{name}/disc", radius=size.blade, height=0.008, color=front,
            position=(hub[0], hub[1], -0.035), **{**tone, "opacity": 0.15 if self._ghost else 0.35},
        )  # fmt: skip
        if self._ghost is None:
            self._scene.add_cylinder(
                f"{name}/motor", radius=0.02, height=0.04, color=colours.DARK,
                position=(hub[0], hub[1], -0.015), **tone,
            )  # fmt: skip
            vertices, faces = _arrow()
            self._arrows.append(
                self._scene.add_mesh_simple(
                    f"{name}/thrust", vertices=vertices, faces=faces, color=colours.VIOLET,
                    position=(hub[0], hub[1], -0.04), wxyz=_UP, side="double", cast_shadow=False,
                )
            )  # fmt: skip

    def _add_legs(self) -> None:
        for k, (hip, foot) in enumerate(legs(self._airframe)):
            middle, turn = _between(hip, foot)
            self._scene.add_cylinder(
                f"{self._name}/leg{k}", radius=0.006, height=math.dist(hip, foot),
                color=self._ghost or colours.GREY, position=middle, wxyz=turn, **self._tone,
            )  # fmt: skip


class Stage:
    """Everything that is drawn in space."""

    def __init__(self, server: viser.ViserServer, airframe: Airframe) -> None:
        self._scene = scene = server.scene
        scene.set_up_direction("-z")
        # Its light comes with viser; nothing is fetched.
        scene.configure_environment_map("studio", environment_intensity=0.3)
        self._vehicle = VehicleFigure(scene, "/vehicle", airframe)
        self._truth = VehicleFigure(scene, "/truth", airframe, ghost=colours.ORANGE)
        vertices, faces = _arrow()
        self._force = scene.add_mesh_simple(
            "/force on the tool", vertices=vertices, faces=faces, color=colours.RED,
            side="double", cast_shadow=False, visible=False,
        )  # fmt: skip
        self._newtons = scene.add_label("/force", "", visible=False)
        self._payload = scene.add_box(
            "/payload", color=colours.ORANGE, dimensions=(_PAYLOAD,) * 3, opacity=0.85,
            visible=False,
        )  # fmt: skip
        self._grams = scene.add_label("/payload mass", "", visible=False)
        self._airframe = airframe
        self._target = scene.add_icosphere(
            "/target", radius=0.022, color=colours.GREEN, opacity=0.85, visible=False,
            cast_shadow=False,
        )  # fmt: skip
        self._spread = scene.add_icosphere(
            "/estimate spread", radius=1.0, color=colours.BLUE, opacity=0.18, visible=False,
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        nothing = np.zeros((1, 2, 3), np.float32)
        self._plan_base = scene.add_line_segments(
            "/plan/base", nothing, colours.BLUE, thickness=0.008, visible=False
        )
        self._plan_tip = scene.add_line_segments(
            "/plan/end-effector", nothing, colours.CYAN, thickness=0.014, visible=False
        )
        self._region: tuple[Vec3, Vec3] = ((-2.0, -2.0, -2.5), (2.0, 2.0, 0.0))
        self._safe_set: SafeSet | None = None
        self._zones: list[viser.FrameHandle] = []
        self._rides: tuple[Vec3 | None, bool] = (None, False)
        self._visible: dict[int, bool] = {}
        self.show_truth = True

    def frame(self, server: viser.ViserServer, region: tuple[Vec3, Vec3]) -> None:
        """Choose floor, walls and the first view for a ``region`` [m, NED]."""
        self._region = region
        low, high = np.array(region[0]), np.array(region[1])
        middle, span = 0.5 * (low + high), float(np.max(high - low))
        self._scene.add_grid(
            "/ground", infinite_grid=True, plane="xy", cell_size=0.25, section_size=1.0,
            cell_color=(228, 231, 235), section_color=(200, 206, 213), shadow_opacity=0.25,
            fade_distance=4.0 * span,
            position=(round(float(middle[0])), round(float(middle[1])), 0.0), wxyz=_UP,
        )  # fmt: skip
        away = 0.46 * span * np.array((-1.25, 0.95, -0.8))
        camera = server.initial_camera
        camera.up = (0.0, 0.0, -1.0)
        # Below the middle: the timeline covers the lower part of the window.
        camera.look_at = tuple(middle + np.array((0.0, 0.0, 0.3 * (high - low)[2])))
        camera.position = tuple(middle + away)
        self._safe_set = None

    def show(self, now: Scene) -> None:
        """Draw one instant."""
        self._vehicle.show(now.estimate, now.thrust)
        self._vehicle.colour(now.margins)
        self._truth.show(now.truth if self.show_truth and _apart(now) else None)
        self._place(self._target, now.target)
        self._place(
            self._spread, None if now.estimate is None or now.sigma is None else now.estimate.p
        )
        if now.sigma is not None:
            x, y, z = (max(_SIGMAS * one, 1e-4) for one in now.sigma)
            self._spread.scale = (x, y, z)
        for handle, path in (
            (self._plan_base, now.horizon.base if now.horizon else ()),
            (self._plan_tip, now.horizon.tip if now.horizon else ()),
        ):
            self._see(handle, len(path) > 1)
            if len(path) > 1:
                handle.points = _segments(np.array(path))
        self._show_zones(now)
        self._show_tool(now)

    def _show_tool(self, now: Scene) -> None:
        """The force on the tool, as an arrow to it with its size; and what it holds."""
        tip = None if now.estimate is None else chain(now.estimate, self._airframe)[-1]
        force = None if now.tool is None else now.tool.force
        size = 0.0 if force is None else math.hypot(*force)
        pressed = tip is not None and now.tool is not None and now.tool.contact and size > 0.0
        for handle in (self._force, self._newtons):
            self._see(handle, pressed)
        if pressed and tip is not None and force is not None:
            # From the surface: it ends where the tool is.
            begin = [p - _FORCE * f for p, f in zip(tip, force, strict=True)]
            _, turn = _between((begin[0], begin[1], begin[2]), tip)
            self._force.position, self._force.wxyz = (begin[0], begin[1], begin[2]), turn
            self._force.scale = (1.0, 1.0, _FORCE * size / _ARROW)
            self._newtons.position = self._force.position
            self._newtons.text = f"{size:.1f} N"
        holds = tip is not None and now.held is not None and now.held.mass > _SHOWN
        for part in (self._payload, self._grams):
            self._see(part, holds)
        if holds and tip is not None and now.held is not None:
            x, y, z = tip
            self._payload.position = (x, y, z + 0.5 * _PAYLOAD)
            self._grams.position = (x, y, z + 1.5 * _PAYLOAD)
            self._grams.text = f"{1e3 * now.held.mass:.0f} g"

    def draw_trail(self, trail: Trail) -> None:
        """Draw a path in the colours of its margins."""
        if len(trail.points) > 1:
            self._add_trail("/trail", trail)

    def extend_trail(self, number: int, trail: Trail, most: int) -> None:
        """Add a piece of path; of ``most`` pieces the oldest is replaced.

        Under its name: of every name that was removed viser keeps a note.
        """
        if len(trail.points) > 1:
            self._add_trail(f"/trail/{number % most}", trail)

    def drop_trail(self, most: int) -> None:
        """Draw nothing of any of ``most`` pieces of path any more."""
        nowhere = Trail(np.full((2, 3), math.nan), np.zeros(2))
        for number in range(most):
            self._add_trail(f"/trail/{number}", nowhere)

    def draw_reference(self, points: Array) -> None:
        """Draw where the end-effector should go: ``points`` (n, 3) [m, NED]; NaN: not there."""
        if len(points) > 1:
            segments = _segments(points)
            segments = segments[np.isfinite(segments).all(axis=(1, 2))]
            if len(segments):
                self._scene.add_line_segments(
                    "/reference", segments, (150, 200, 165), thickness=0.006
                )

    def _add_trail(self, name: str, trail: Trail) -> None:
        paint = colours.of_margins(trail.margins)
        pairs = np.stack((paint[:-1], paint[1:]), axis=1)
        segments = _segments(trail.points)
        kept = np.isfinite(segments).all(axis=(1, 2))
        self._scene.add_line_segments(name, segments[kept], pairs[kept], thickness=0.01)

    def _show_zones(self, now: Scene) -> None:
        zones = now.safe_set.zones if now.safe_set else ()
        rides = any(zone.shape.kind == "target sphere" for zone in zones)
        known = (now.target is not None, rides)
        if now.safe_set != self._safe_set or known != (self._rides[0] is not None, self._rides[1]):
            self._safe_set, self._rides = now.safe_set, (now.target, rides)
            self._draw_zones(now)
        for frame, zone in zip(self._zones, zones, strict=True):
            if any(zone.velocity):
                frame.position = moved(zone, now.t)
            elif zone.shape.kind == "target sphere" and now.target is not None:
                frame.position = now.target

    def _draw_zones(self, now: Scene) -> None:
        for old in self._zones:
            old.remove()
        self._zones = []
        for k, zone in enumerate(now.safe_set.zones if now.safe_set else ()):
            name = f"/zones/{k}"
            frame = self._scene.add_frame(name, show_axes=False)
            self._zones.append(frame)
            at = (0.0, 0.0, 0.0) if now.target is not None else None
            mesh = zone_mesh(zone, self._region, at)
            if mesh is None:
                continue
            if zone.keep_in:
                self._add_mesh(f"{name}/inside", mesh.surface, colours.BLUE, 0.1)
            else:
                solid = zone.shape.kind != "half-space"
                self._add_mesh(
                    f"{name}/surface", mesh.surface, colours.RED, 0.75 if solid else 0.11
                )
                if not solid:
                    outline = _segments(mesh.surface.vertices[[0, 1, 2, 3, 0]])
                    self._scene.add_line_segments(f"{name}/edge", outline, _EDGE, thickness=0.004)
            if mesh.shell is not None:
                pale = 0.07 if zone.shape.kind == "half-space" else 0.16
                self._add_mesh(f"{name}/shell", mesh.shell, colours.ORANGE, pale)

    def _add_mesh(self, name: str, mesh: Mesh, colour: Rgb, opacity: float) -> None:
        self._scene.add_mesh_simple(
            name, vertices=mesh.vertices, faces=mesh.faces, color=colour, opacity=opacity,
            side="double", cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def _place(self, handle: Any, p: Vec3 | None) -> None:
        self._see(handle, p is not None)
        if p is not None:
            handle.position = p

    def _see(self, handle: Any, visible: bool) -> None:
        """Say it only where it changes."""
        if self._visible.get(id(handle)) != visible:
            self._visible[id(handle)] = visible
            handle.visible = visible


def _apart(now: Scene) -> bool:
    """Whether truth and estimate can be told apart on a screen."""
    if now.truth is None or now.estimate is None:
        return False
    return math.dist(now.truth.p, now.estimate.p) > 0.01


def _segments(path: Array) -> Array:
    """A path (n, 3) as n - 1 segments (n - 1, 2, 3)."""
    return np.stack((path[:-1], path[1:]), axis=1).astype(np.float32)


def _between(begin: Vec3, end: Vec3) -> tuple[Vec3, Vec4]:
    """Middle [m] and attitude of a cylinder, whose axis is z, from one place to another [m]."""
    a, b = np.array(begin), np.array(end)
    length = float(np.linalg.norm(b - a))
    z = (b - a) / length if length > 1e-9 else np.array((0.0, 0.0, 1.0))
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    rows = (x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2])
    mx, my, mz = (0.5 * (a + b)).tolist()
    m = [float(one) for one in rows]
    return (mx, my, mz), quaternion_from_matrix((*m[:3], *m[3:6], *m[6:]))  # type: ignore[arg-type]


def _arrow() -> tuple[Array, Array]:
    """An arrow along z of length 1 m times what full thrust is drawn as."""
    turns = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
    ring = np.stack((np.cos(turns), np.sin(turns)), axis=1)
    outline = ((0.0, 0.0), (0.009, 0.0), (0.009, 0.78), (0.024, 0.78), (0.0, 1.0))
    rows = [np.column_stack((r * ring, np.full(len(ring), _ARROW * h))) for r, h in outline]
    n = len(ring)
    faces = [
        (n * row + k, n * row + (k + 1) % n, n * (row + 1) + k)
        for row in range(len(outline) - 1)
        for k in range(n)
    ] + [
        (n * row + (k + 1) % n, n * (row + 1) + (k + 1) % n, n * (row + 1) + k)
        for row in range(len(outline) - 1)
        for k in range(n)
    ]
    return np.concatenate(rows), np.array(faces)


def _lengths(airframe: Airframe) -> list[float]:
    """Of the arm's links [m], which no posture changes."""
    still = Posture((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0,) * airframe.bodies.joints)
    return [math.dist(begin, end) for begin, end in pairwise(chain(still, airframe))]
