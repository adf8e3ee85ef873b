"""Random numbers of flights as coordinates: the same distributions, and every one of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from sitl.faults.actuators import MotorFault
from sitl.faults.keys import KINDS
from sitl.faults.signal import SignalFault
from sitl.scenario import Sequence, Uniform
from sitl.sensors.keys import MeasuredSensors
from studies.campaign.flight_space import FlightSpace, spaces
from studies.campaign.keys import CampaignError
from studies.campaign.plan import parse_plan


class Gyro(NamedTuple):
    """The part of a reading that a faulty gyro changes."""

    gyro_B: tuple[float, float, float]


FILE = """\
flights = 4
duration_s = 1.0
seed = 3
scenarios = ["walls"]
{more}
[vary]
vehicle_scale.mass = {{ uniform = [0.9, 1.1] }}
latency_ms = {{ choice = [0.0, 2.0, 4.0] }}
"""


def space(more: str = "") -> FlightSpace:
    """Of the first case."""
    return spaces(parse_plan(FILE.format(more=more), "small", Path()))[0]


def test_values_go_where_the_campaign_puts_them_and_tables_into_the_disturbance() -> None:
    one = space()
    assert (one.values, one.entries, one.seeded) == (2, 30, False)
    table = np.linspace(-1.0, 1.0, 30)
    job = one.job(np.array([0.25, 0.5]), table)
    assert job.scenario.vehicle_scale.mass == pytest.approx(0.95)
    assert one.named(np.array([0.25, 0.5])) == {
        "vehicle_scale.mass": pytest.approx(0.95),
        "latency_ms": 2.0,
    }
    (pushes,) = job.scenario.disturbances
    assert isinstance(pushes, Sequence)
    assert pushes.period_s == pytest.approx(0.1)
    assert np.array(pushes.acceleration_m_s2) == pytest.approx(0.8 * table.reshape(10, 3))
    assert not job.random


def test_an_odd_length_has_a_row_for_its_last_part() -> None:
    one = spaces(parse_plan(FILE.format(more="").replace("1.0\n", "1.05\n", 1), "x", Path()))[0]
    assert one.entries == 33


def test_noise_stays_with_the_seed() -> None:
    one = space('suites = ["mocap"]')
    assert one.seeded
    job = one.job(np.zeros(2), np.zeros(30), seed=12)
    assert job.seed == 12
    assert isinstance(job.scenario.sensors, MeasuredSensors)
    assert one.job(np.zeros(2), np.zeros(30)).seed == one.seed


@pytest.mark.parametrize(
    ("fault", "random"),
    [
        ('unit = "gyro"\nkind = "garbage"', True),
        ('unit = "gyro"\nkind = "intermittent"', True),
        ('unit = "motor"\nkind = "intermittent"\ninstance = 1', True),
        ('unit = "motor"\nkind = "weak"\ninstance = 1', False),
        ('unit = "gyro"\nkind = "stuck"', False),
    ],
)
def test_what_a_fault_draws_stays_with_the_seed(fault: str, random: bool) -> None:
    one = space(f"without_fault = false\n[[faults]]\n{fault}\nstart_s = 0.5")
    point = np.full(2, 0.5), np.zeros(30)
    assert one.seeded == random
    # Two flights of other seeds are two flights, in a journal too.
    assert (one.job(*point, seed=1).key() != one.job(*point, seed=2).key()) == random


def test_a_space_needs_no_flight_that_can_start() -> None:
    text = FILE.format(more="").replace("[vary]", "[vary]\nstart.position_m.0 = { choice = [9.0] }")
    plan = parse_plan(text, "small", Path())
    with pytest.raises(ValueError, match="position_m"):
        plan.flight(0)
    assert spaces(plan)[0].seed == plan.draw(0).seed


def test_every_case_has_a_space() -> None:
    plan = parse_plan(FILE.format(more="").replace('["walls"]', '["walls", "gate"]'), "x", Path())
    assert [one.case.scenario for one in spaces(plan)] == ["walls", "gate"]


def test_a_uniform_disturbance_cannot_be_varied_and_searched() -> None:
    more = "disturbances.0.amplitude_m_s2 = { uniform = [0.1, 0.5] }"
    with pytest.raises(CampaignError, match=r"vary\.disturbances\.0"):
        spaces(parse_plan(FILE.format(more="") + more, "x", Path()))


def test_what_flies_is_the_scenarios_own_disturbance_in_other_words() -> None:
    (own,) = space().flown.scenario.disturbances
    assert isinstance(own, Uniform)
    (played,) = space().job(np.zeros(2), np.ones(30)).scenario.disturbances
    assert isinstance(played, Sequence)
    assert played.name == own.name
    assert np.abs(played.acceleration_m_s2).max() == own.amplitude_m_s2


FAULTY = """\
without_fault = false
[[faults]]
unit = "{unit}"
kind = "{kind}"
start_s = 0.1
"""


@pytest.mark.parametrize("unit", ["gyro", "motor"])
@pytest.mark.parametrize("kind", KINDS["motor"])
def test_the_seed_counts_where_a_fault_draws_and_only_there(unit: str, kind: str) -> None:
    if kind not in KINDS[unit]:
        return
    one = space(FAULTY.format(unit=unit, kind=kind))
    shares, table = np.full(one.values, 0.5), np.zeros(one.entries)
    (fault,) = one.job(shares, table).scenario.faults
    random = np.random.default_rng(1)
    before = random.bit_generator.state
    if unit == "motor":
        MotorFault(fault, random, (10.0,) * 4, 2000).through((1.0, 1.0, 1.0, 1.0), 0)
    else:
        SignalFault[Any](fault, random).read(0, Gyro((0.0, 0.0, 0.0)))
    draws = random.bit_generator.state != before
    assert one.seeded == draws
    keys = {one.job(shares, table, seed).key() for seed in (1, 2)}
    assert len(keys) == 1 + draws
