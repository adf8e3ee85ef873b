"""Turbulence against MIL-F-8785C: scales, variance, spectra."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from sitl.air.dryden import Dryden, GustScale, low_altitude
from sitl.air.wind import WindField
from sitl.scenario import AirKeys

STEP_S = 0.01
AIRSPEED = 5.0
ALONG, ACROSS, VERTICAL = GustScale(1.5, 10.0), GustScale(1.0, 8.0), GustScale(0.5, 4.0)


@pytest.fixture(scope="module")
def gusts() -> npt.NDArray[np.float64]:
    """(samples, 3) [m/s] of forty minutes."""
    field = Dryden((ALONG, ACROSS, VERTICAL), AIRSPEED, STEP_S, np.random.default_rng(2))
    return np.array([field.step() for _ in range(240_000)])


def test_the_scales_at_low_altitude() -> None:
    # At 20 ft: sigma_w = 0.1 W20, sigma_u = sigma_w / (0.177 + 0.01646)^0.4, L_w = 20 ft.
    along, across, vertical = low_altitude(20.0 * 0.3048, 15.4)
    assert vertical.sigma == pytest.approx(1.54)
    assert vertical.length == pytest.approx(20.0 * 0.3048)
    assert along.sigma == pytest.approx(1.54 / 0.19346**0.4)
    assert along.length == pytest.approx(20.0 / 0.19346**1.2 * 0.3048)
    assert across == along
    # At 1000 ft all are equal, as the specification has it.
    high = low_altitude(1000.0 * 0.3048, 15.4)
    assert high[0].sigma == pytest.approx(high[2].sigma, rel=1e-3)
    assert high[0].length == pytest.approx(high[2].length, rel=1e-3)
    assert low_altitude(0.0, 15.4) == low_altitude(10.0 * 0.3048, 15.4)


def test_each_component_has_its_deviation(gusts: npt.NDArray[np.float64]) -> None:
    expected = [ALONG.sigma, ACROSS.sigma, VERTICAL.sigma]
    assert gusts.std(axis=0) == pytest.approx(expected, rel=0.06)
    mixed = np.corrcoef(gusts.T)
    assert np.abs(mixed - np.eye(3)).max() < 0.08


def test_each_component_has_its_spectrum(gusts: npt.NDArray[np.float64]) -> None:
    """One-sided density over Ω = ω / V, in bands of a third of a decade."""
    size = 8192
    pieces = gusts[: len(gusts) // size * size].reshape(-1, size, 3)
    window = np.hanning(size)[:, None]
    power = np.abs(np.fft.rfft(pieces * window, axis=1)) ** 2
    density = 2.0 * STEP_S * power.mean(axis=0) / float((window**2).sum())  # (m/s)² / Hz
    wave = 2.0 * math.pi * np.fft.rfftfreq(size, STEP_S) / AIRSPEED  # rad/m
    for axis, (scale, shape) in enumerate(
        ((ALONG, longitudinal), (ACROSS, transverse), (VERTICAL, transverse))
    ):
        wanted = shape(scale, wave) * 2.0 * math.pi / AIRSPEED
        for low in np.geomspace(0.15, 7.0, 6)[:-1]:
            band = (wave >= low) & (wave < 2.15 * low)
            measured, expected = density[band, axis].mean(), wanted[band].mean()
            assert measured == pytest.approx(expected, rel=0.2), (axis, low)


def longitudinal(scale: GustScale, wave: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """MIL-F-8785C, 3.7.2.2: density of u over the spatial frequency [rad/m]."""
    one: npt.NDArray[np.float64] = (
        scale.sigma**2 * 2.0 * scale.length / math.pi / (1.0 + (scale.length * wave) ** 2)
    )
    return one


def transverse(scale: GustScale, wave: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The same of v and w."""
    square = (scale.length * wave) ** 2
    one: npt.NDArray[np.float64] = (
        scale.sigma**2 * scale.length / math.pi * (1.0 + 3.0 * square) / (1.0 + square) ** 2
    )
    return one


def test_turbulence_blows_along_the_wind_and_is_of_the_seed_alone() -> None:
    keys = AirKeys(wind_m_s=(0.0, 6.0, 0.0), turbulence_m_s=15.4)
    one, same, other = (WindField(keys, seed, 0.002) for seed in (1, 1, 2))
    first = [one.step() for _ in range(50)]
    assert first == [same.step() for _ in range(50)]
    assert first != [other.step() for _ in range(50)]
    still = WindField(AirKeys(wind_m_s=(1.0, 2.0, 0.0)), 0, 0.002)
    assert [still.step() for _ in range(3)] == [(1.0, 2.0, 0.0)] * 3
