"""Disturbances: bounded, resampled on time, independent of each other, from one seed."""

from __future__ import annotations

import numpy as np

from sitl.disturbances.items import push
from sitl.scenario import V3, Disturbance, Impulses, Sequence, Torque, Uniform, Wind

STEP_S = 0.002


def _drawn(item: Disturbance, seed: int, steps: int) -> list[V3]:
    running = push(item, seed, STEP_S)
    return [running.sample(step) for step in range(steps)]


def test_uniform_stays_within_its_bound_and_fills_it() -> None:
    values = np.array(_drawn(Uniform(0.8), 1, 100_000))
    assert np.abs(values).max() <= 0.8
    assert values.max(axis=0).min() > 0.79
    assert np.abs(values.mean(axis=0)).max() < 0.06  # 2000 draws: sigma 0.46 / sqrt(2000) = 0.01
    assert np.abs(np.corrcoef(values.T) - np.eye(3)).max() < 0.1


def test_uniform_changes_exactly_every_period() -> None:
    values = _drawn(Uniform(0.8, period_s=0.1), 1, 500)
    changed = [k for k in range(1, 500) if values[k] != values[k - 1]]
    assert changed == list(range(50, 500, 50))


def test_wind_never_changes() -> None:
    assert set(_drawn(Wind((1.0, -2.0, 0.5)), 1, 100)) == {(1.0, -2.0, 0.5)}


def test_impulses_have_their_size_length_and_mean_pause() -> None:
    item = Impulses(mean_interval_s=1.0, magnitude_m_s2=5.0, duration_s=0.05)
    sizes = np.linalg.norm(np.array(_drawn(item, 3, 500_000)), axis=1)
    assert np.all((sizes == 0.0) | (np.abs(sizes - 5.0) < 1e-12))
    edges = np.flatnonzero(np.diff((sizes > 0.0).astype(int)))
    starts, ends = edges[::2], edges[1::2]
    assert set(ends[: len(starts)] - starts[: len(ends)]) == {25}
    pauses = STEP_S * (starts[1:] - ends[: len(starts) - 1])
    assert abs(pauses.mean() - 1.0) < 0.1  # 950 pauses: sigma 0.03


def test_the_same_seed_draws_the_same_and_another_differs() -> None:
    for item in (Uniform(0.8), Torque(0.1), Impulses(1.0, 5.0, 0.05)):
        assert _drawn(item, 4, 2000) == _drawn(item, 4, 2000)
        assert _drawn(item, 4, 2000) != _drawn(item, 5, 2000)


def test_items_of_one_kind_draw_independently_by_name() -> None:
    first = np.array(_drawn(Uniform(1.0, name="one"), 4, 50_000))
    second = np.array(_drawn(Uniform(1.0, name="two"), 4, 50_000))
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.06


def test_a_torque_item_is_marked_as_torque() -> None:
    assert push(Torque(0.1), 0, STEP_S).torque
    assert not push(Uniform(0.1), 0, STEP_S).torque


def test_a_sequence_plays_each_value_for_its_period_and_nothing_outside() -> None:
    item = Sequence(((1.0, 0.0, 0.0), (0.0, -2.0, 0.5)), period_s=0.01, starts_s=0.004)
    still, first, second = (0.0, 0.0, 0.0), *item.acceleration_m_s2
    assert _drawn(item, 7, 14) == [still] * 2 + [first] * 5 + [second] * 5 + [still] * 2


def test_a_uniform_disturbance_written_down_is_the_same_disturbance() -> None:
    drawn = _drawn(Uniform(0.8), 3, 500)
    written = Sequence(tuple(drawn[::50]))
    assert _drawn(written, 99, 500) == drawn
