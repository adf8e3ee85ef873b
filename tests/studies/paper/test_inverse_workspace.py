"""The inverse workspace against forward kinematics, known spheres, and the scenario's preset."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sitl.scenario_file import load_scenario
from studies.paper.inverse_workspace import BOTH_ELBOWS, InverseWorkspace
from tests.fsw.paper_arm import LENGTHS, LIMIT1, LIMIT12

ELBOWS = {"both": BOTH_ELBOWS, "forward": (1,), "backward": (-1,)}


@pytest.fixture(scope="module", params=list(ELBOWS))
def workspace(request: pytest.FixtureRequest) -> InverseWorkspace:
    return InverseWorkspace(elbows=ELBOWS[request.param])


def reached(elbows: tuple[int, ...], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Base positions seen from the end-effector, by forward kinematics within the limits."""
    random = np.random.default_rng(1)
    th1 = random.uniform(-LIMIT1, LIMIT1, count)
    th12 = random.uniform(-LIMIT12, LIMIT12, count)
    allowed = np.isin(np.sign(th12 - th1), elbows)
    th1, th12 = th1[allowed], th12[allowed]
    l1, l2 = LENGTHS
    x = -l1 * np.sin(th1) - l2 * np.sin(th12)
    return x, l1 * np.cos(th1) + l2 * np.cos(th12)


@pytest.mark.parametrize("name", list(ELBOWS))
def test_what_forward_kinematics_reach_is_inside(name: str) -> None:
    workspace = InverseWorkspace(elbows=ELBOWS[name])
    assert workspace.contains(*reached(ELBOWS[name], 20_000)).all()


@pytest.mark.parametrize("name", ["forward", "backward"])
def test_every_reach_of_the_other_elbow_alone_is_outside(name: str) -> None:
    other = {"forward": (-1,), "backward": (1,)}[name]
    x, up = reached(other, 20_000)
    inside = InverseWorkspace(elbows=ELBOWS[name]).contains(x, up)
    both = InverseWorkspace(elbows=other).contains(x, up)
    assert both.all()
    assert not inside.all()


@pytest.mark.drawn(1)
def test_an_inscribed_disc_is_inside_and_a_larger_one_is_not(workspace: InverseWorkspace) -> None:
    angle = np.linspace(0.0, 2.0 * math.pi, 20_001)
    largest = workspace.largest()
    for x, up, radius in (
        (largest.x_m, largest.up_m, largest.radius_m),
        (0.0, 0.225, workspace.inscribed_radius(0.0, 0.225)),
    ):
        for share in (0.3, 0.7, 0.999):
            r = share * radius
            assert workspace.contains(x + r * np.cos(angle), up + r * np.sin(angle)).all()
        r = radius + 0.0002
        assert not workspace.contains(x + r * np.cos(angle), up + r * np.sin(angle)).all()


def test_both_elbows_serve_the_papers_sphere_and_one_does_not() -> None:
    both, one = (InverseWorkspace(elbows=elbows) for elbows in (BOTH_ELBOWS, (1,)))
    assert both.inscribed_radius(0.0, 0.225) == pytest.approx(0.075, abs=2e-5)
    assert one.inscribed_radius(0.0, 0.225) == pytest.approx(0.0484, abs=1e-4)
    best = both.largest(on_axis=True)
    assert (best.up_m, best.radius_m) == pytest.approx((0.225, 0.075), abs=5e-5)


@pytest.mark.long
def test_mirrored_elbows_have_mirrored_spheres() -> None:
    forward, backward = (InverseWorkspace(elbows=elbows).largest() for elbows in ((1,), (-1,)))
    assert (forward.x_m, forward.up_m, forward.radius_m) == pytest.approx(
        (-backward.x_m, backward.up_m, backward.radius_m), abs=5e-5
    )
    assert forward.x_m == pytest.approx(-0.057, abs=0.002)
    assert forward.radius_m == pytest.approx(0.081, abs=0.001)


def test_outside_the_set_the_radius_is_negative() -> None:
    workspace = InverseWorkspace()
    assert workspace.inscribed_radius(0.0, 0.35) == pytest.approx(-0.05, abs=1e-5)
    assert workspace.inscribed_radius(0.0, -0.2) < 0.0


@pytest.mark.parametrize("name", ["workspace", "workspace-calm"])
def test_the_scenarios_sphere_fits_into_the_inverse_workspace(name: str) -> None:
    sphere = load_scenario(name).workspace
    assert sphere is not None
    largest = InverseWorkspace().inscribed_radius(0.0, sphere.d_iw_m)
    assert sphere.radius_m <= largest + 2e-5
