"""The projection: there and back, known distances, and signs."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.geometry.geodesy import EARTH_RADIUS, to_global, to_local
from fsw.autopilot.signals import Origin

ZURICH = Origin(47.397742, 8.545594, 488.0)
ELSEWHERE = [ZURICH, Origin(-33.9, 151.2, 10.0), Origin(0.0, 0.0, 0.0), Origin(64.1, 179.9999, 0.0)]


@pytest.mark.parametrize("origin", ELSEWHERE)
@pytest.mark.parametrize("p", [(0.0, 0.0, 0.0), (3.0, -4.0, -2.0), (-800.0, 950.0, 30.0)])
def test_there_and_back(origin: Origin, p: tuple[float, float, float]) -> None:
    assert to_local(origin, *to_global(origin, p)) == pytest.approx(p, abs=1e-6)


def test_north_and_east_are_where_degrees_grow_and_down_is_where_altitude_falls() -> None:
    latitude, longitude, altitude = to_global(ZURICH, (10.0, 20.0, 3.0))
    assert latitude > ZURICH.latitude
    assert longitude > ZURICH.longitude
    assert altitude == pytest.approx(485.0)


def test_a_minute_of_arc_is_a_nautical_mile_on_the_meridian_and_shrinks_with_latitude() -> None:
    mile = EARTH_RADIUS * math.radians(1.0 / 60.0)
    north = to_local(ZURICH, ZURICH.latitude + 1.0 / 60.0, ZURICH.longitude, 488.0)
    assert north == pytest.approx((mile, 0.0, 0.0), abs=1e-6)
    east = to_local(ZURICH, ZURICH.latitude, ZURICH.longitude + 1.0 / 60.0, 488.0)
    assert east[1] == pytest.approx(mile * math.cos(math.radians(ZURICH.latitude)), rel=1e-6)


def test_distances_from_the_origin_are_those_on_the_sphere() -> None:
    """Haversine, as ground stations compute it."""
    latitude, longitude, _ = to_global(ZURICH, (300.0, 400.0, 0.0))
    lat0, lat = math.radians(ZURICH.latitude), math.radians(latitude)
    half = math.sin((lat - lat0) / 2.0) ** 2
    half += math.cos(lat0) * math.cos(lat) * math.sin(math.radians(longitude - 8.545594) / 2) ** 2
    assert 2.0 * EARTH_RADIUS * math.asin(math.sqrt(half)) == pytest.approx(500.0, abs=1e-6)
