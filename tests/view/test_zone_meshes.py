"""Tests of the triangles that zones are drawn as."""

import numpy as np
import pytest
from scipy.spatial import QhullError

from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.box import box
from fsw.autopilot.shapes.cylinder import cylinder
from fsw.autopilot.shapes.half_space import half_space
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.vertical_cylinder import column, vertical_cylinder
from fsw.autopilot.shapes.zones import all_planes
from fsw.autopilot.signals import SafeSet, Shape, Zone
from view import zone_meshes
from view.zone_meshes import moved, zone_mesh

REGION = ((-2.0, -2.0, -3.0), (2.0, 2.0, 0.0))
SHAPES = [
    half_space((0.6, 0.0, 0.8), 0.5),
    ball((1.0, 2.0, -1.0), 0.3),
    box((0.5, 0.0, -1.0), (0.2, 0.3, 0.4), (0.8, 0.6, 0.0, 0.0)),
    cylinder((0.0, 0.0, -1.0), (1.0, 1.0, -1.5), 0.2),
    vertical_cylinder((1.0, 0.5), 0.25, -2.0, -0.5),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_surface_and_shell_are_where_the_flight_software_has_them(shape: Shape) -> None:
    zone = Zone(shape, clearance=0.15)
    mesh = zone_mesh(zone, REGION, None)
    assert mesh is not None
    assert mesh.shell is not None
    for part, away in ((mesh.surface, 0.0), (mesh.shell, 0.15)):
        distances = [
            all_planes(SafeSet((Zone(shape, 0.0),)), tuple(vertex), 0)[0][1].distance
            for vertex in part.vertices[::7].tolist()
        ]
        np.testing.assert_allclose(distances, away, atol=0.01)


@pytest.mark.parametrize(
    ("top", "bottom"), [(-0.3, 0.0), (-0.3, 9.0), (-9.0, -4.0), (-9.0, -3.0), (0.0, 1.0)]
)
def test_a_cylinder_outside_the_region_is_drawn_where_it_ends(top: float, bottom: float) -> None:
    low = ((-2.0, -2.0, -3.0), (2.0, 2.0, -1.0))
    mesh = zone_mesh(Zone(vertical_cylinder((0.0, 0.0), 0.25, top, bottom), 0.0), low, None)
    assert mesh is not None
    heights = mesh.surface.vertices[:, 2]
    assert top - 0.03 <= heights.min() < heights.max() <= bottom + 0.03


@pytest.mark.parametrize("shape", SHAPES[1:], ids=lambda shape: shape.kind)
def test_triangles_face_outwards_and_close_the_surface(shape: Shape) -> None:
    mesh = zone_mesh(Zone(shape, 0.0), REGION, None)
    assert mesh is not None
    corners = mesh.surface.vertices[mesh.surface.faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    assert volume > 0.0
    edges = np.sort(mesh.surface.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 2).all()


THIN = [
    ball((1.0, 2.0, -1.0), 1e-30),
    ball((1000.0, 2.0, -1.0), 1e-14),
    box((0.5, 0.0, -1.0), (0.5, 0.5, 1e-15)),
    box((100.0, 0.0, -1.0), (1e-12, 1e-12, 1e-12)),
    cylinder((0.0, 0.0, -1.0), (0.0, 0.0, -2.0), 1e-15),
    cylinder((100.0, 0.0, -1.0), (100.0, 0.0, -1.00001), 0.2),
    vertical_cylinder((1000.0, 0.5), 1e-15, -1.0, -0.9999999),
]


@pytest.mark.parametrize("keep_in", [False, True])
@pytest.mark.parametrize("clearance", [0.0, 0.1])
@pytest.mark.parametrize("shape", THIN, ids=lambda shape: shape.kind)
def test_what_is_too_thin_to_be_seen_is_drawn_thicker(
    shape: Shape, clearance: float, keep_in: bool
) -> None:
    mesh = zone_mesh(Zone(shape, clearance, keep_in=keep_in), REGION, None)
    assert mesh is not None
    sizes = np.ptp(mesh.surface.vertices, axis=0)
    assert (sizes > 0.003).all()


def test_what_has_no_hull_is_not_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(_: object) -> None:
        raise QhullError("QH6154 initial simplex is flat")

    monkeypatch.setattr(zone_meshes, "ConvexHull", fails)
    assert zone_mesh(Zone(SHAPES[1], 0.1), REGION, None) is None


def test_a_column_without_end_is_drawn_where_the_flight_was() -> None:
    mesh = zone_mesh(column((1.0, 0.5), 0.2), REGION, None)
    assert mesh is not None
    assert mesh.shell is not None
    assert mesh.surface.vertices[:, 2].min() == pytest.approx(-3.0)
    assert mesh.surface.vertices[:, 2].max() == pytest.approx(0.0)


def test_the_sphere_rides_on_the_target() -> None:
    zone = target_sphere((0.0, 0.0, -0.2), 0.5)
    assert zone_mesh(zone, REGION, None) is None
    mesh = zone_mesh(zone, REGION, (1.0, 1.0, -1.0))
    assert mesh is not None
    np.testing.assert_allclose(mesh.surface.vertices.mean(axis=0), (1.0, 1.0, -1.2), atol=0.01)


def test_a_moving_zone_is_where_it_has_got_to() -> None:
    zone = Zone(ball((0.0, 0.0, 0.0), 0.1), 0.1, velocity=(1.0, 0.0, -0.5), t_us=2_000_000)
    assert moved(zone, 4.0) == (2.0, 0.0, -1.0)
