"""The worked examples of changes: each applies, is small, and does what it says."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = ("architecture.md", "how-to/add-a-sensor.md")
TEXT = "".join((ROOT / "docs" / page).read_text(encoding="utf-8") for page in PAGES)
DIFFS = re.findall(r"\*\*(.+?)\*\*:.*?```diff\n(.*?)```", TEXT, re.DOTALL)
MAX_FILES = {"Add a sensor": 8}  # else 3: a sensor is in both halves and on the link between them

NEW_MODE = """
from fsw.autopilot.flight.modes import MODES
from fsw.link.wire.identity import AVAILABLE_MODES
from fsw.autopilot.signals import CommandResult, Mode
from tests.fsw.autopilot.flight.asked import ask
from tests.fsw.autopilot.flight.contexts import flying
assert ask(flying(), 176, 1.0, 4.0, 12.0).mode is Mode.STOW
refused = ask(flying(landed=True), 176, 1.0, 4.0, 12.0)
assert refused.result == CommandResult.TEMPORARILY_REJECTED
assert "ground" in refused.reason
assert "Stow" in [one.name for one in AVAILABLE_MODES]
assert MODES[Mode.STOW].__module__ == "fsw.autopilot.flight.modes.stow"
"""
NEW_CONDITION = """
from dataclasses import replace
from fsw.autopilot.flight.commander import Commander
from fsw.autopilot.flight.state import VehicleMemory, first_state
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import Mode
from tests.fsw.random_states import random_estimate
import numpy
level = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
estimate = random_estimate(numpy.random.default_rng(1))._replace(R_WB=level)
vehicle = VehicleMemory(mode=Mode.TRAJECTORY, landed=False)
state = replace(first_state(flight_config().airframe), vehicle=vehicle, t_us=estimate.t_us)
state = replace(state, plan=replace(state.plan, since_us=estimate.t_us))
commander = Commander(flight_config())
for rate, mode in ((5.9, Mode.TRAJECTORY), (-6.1, Mode.HOLD)):
    texts = []
    swinging = estimate._replace(qd_arm=(0.1, rate))
    after = commander.check_failsafes(state, swinging, texts)
    assert after.vehicle.mode is mode, (rate, after.vehicle)
    assert bool(texts) == (mode is Mode.HOLD)
assert "the arm swings" in texts[0].text
from docs.pages.failsafes import reference
assert "| the arm swings | in flight, a joint is faster than 6 rad/s |" in reference()
"""
NEW_SHAPE = """
from dataclasses import replace
from fsw.autopilot.flight.commands.bounds import zone_problem
from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import SafeSet, Shape, Zone
from fsw.link.wire.decode import obstacle_shape
from fsw.link.wire.encode_dialect import safe_set_shapes
from tests.fsw.link.snapshots import CONTEXT, SNAPSHOT
layer = Shape("layer", (-6.0, -2.0))
out, within = Zone(layer, 0.5), Zone(layer, 0.5, keep_in=True)
def distances(z):
    return [at.distance for at in surfaces(SafeSet((out, within)), (0.0, 0.0, z), 0)]
assert distances(0.0) == [1.5, -2.5], distances(0.0)
assert distances(-3.0) == [-1.5, 0.5], distances(-3.0)
assert distances(-7.0) == [0.5, -1.5], distances(-7.0)
assert "its bottom below" in kind_of(layer).check(Shape("layer", (-2.0, -6.0)))
assert zone_problem(out) is None
sent = safe_set_shapes(0, replace(SNAPSHOT, safe_set=SafeSet((within,))), CONTEXT)[0].values
assert obstacle_shape(sent).zone == within
"""
NEW_TILT = """
import math
from fsw.autopilot.control.braking import Brake
from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import PredictionState
limit = flight_config().planner.limits.tilt
assert limit == math.pi / 12.0
level, still = (0.0, 0.0), (0.0, 0.0, 0.0)
fast = PredictionState(still, (5.0, 0.0, 0.0), still, level, level, 0.0, 0.0, level, level)
braking = Brake(AIRFRAME, limit)(fast)
assert math.isclose(-braking.a[0], math.tan(limit) * GRAVITY)
"""
NEW_SENSOR = """
import numpy
from fsw.autopilot.estimation.error_state import ERRORS
from fsw.autopilot.estimation.fusion_memory import at_start
from fsw.autopilot.estimation.sensors import SENSORS
from fsw.autopilot.estimation.sensors.ceiling_finder import CeilingFinder
from fsw.autopilot.estimation.tuning import EstimatorTuning
from fsw.autopilot.measurements import CeilingSample
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.frozen import replace
from fsw.link.inbox import Inbox
from fsw.link.wire.decode_sensors import SampleDecoder
from fsw.log.packed import Samples
from fsw.log.topics import NUMBERS
from messages.frames import split
from sitl.link.encode import StepEncoder
from sitl.scenario_file import load_scenario
from sitl.sensors.suite import MODELS
from studies.flight.samples import sample
from tests.sitl.sensors.readings import HOVER, reading
# A filter that is a decimetre too high learns its height, and nothing of a reading that is far off.
x = at_start(2).numbers.view(numpy.recarray)
x["q"], x["p"], x["covariance"] = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, -1.1), 0.01 * numpy.eye(ERRORS)
memory, finder = replace(at_start(2), numbers=x), CeilingFinder(EstimatorTuning().ceiling_finder)
(ratio,) = finder.fuse(memory, CeilingSample(0.0, 4.0, 1e-4), False)
assert ratio < 1.0
assert abs(x[0]["p"][2] + 1.0) < 0.01, x[0]["p"]
assert finder.fuse(memory, CeilingSample(0.0, 3.0, 1e-4), False)[0] > 1.0
assert CeilingFinder in SENSORS
assert "EST_CEIL_HEIGHT" in BY_NAME
# What it says in the simulator arrives, and the log keeps it.
keys = load_scenario("walls", "mocap").sensors.ceiling_finder
model = MODELS[type(keys)](keys, numpy.random.default_rng(1))
one = model.measure(reading(1_000_000), HOVER, 1_000_000, False)
encoder = StepEncoder(lockstep=True, measured=True)
frame, _ = split(encoder.measured_datagrams(one.t_us, (one,), ())[1])
(arrived,) = SampleDecoder(Inbox().locate, 2).samples([frame])
assert isinstance(arrived, CeilingSample)
assert abs(arrived.distance - one.distance) < 0.006
log = Samples(2)
number = NUMBERS["ceiling_distance"]
assert log.sample_of(number, log.record(0, sample(one))[5:]) == sample(one)
"""
CHECKS = {
    "Add a flight mode": NEW_MODE,
    "Add a shape": NEW_SHAPE,
    "Act on a condition": NEW_CONDITION,
    "Change the tilt limit": NEW_TILT,
    "Add a sensor": NEW_SENSOR,
}


def test_there_is_an_example_of_each() -> None:
    assert [title for title, _ in DIFFS] == list(CHECKS)


@pytest.mark.parametrize(("title", "diff"), DIFFS, ids=[title for title, _ in DIFFS])
def test_an_example_is_small_and_applies_alone(title: str, diff: str) -> None:
    files = set(re.findall(r"^\+\+\+ b/(.+)$", diff, re.MULTILINE))
    assert 1 <= len(files) <= MAX_FILES.get(title, 3)
    apply(diff, ROOT, "--check")


def test_all_examples_applied_together_do_what_they_say(tmp_path: Path) -> None:
    copy_sources(tmp_path)
    for _, diff in DIFFS:
        apply(diff, tmp_path)
    check("\n".join(f"exec({text!r}, {{}})" for text in CHECKS.values()), tmp_path)


@pytest.mark.long
@pytest.mark.parametrize(("title", "diff"), DIFFS, ids=[title for title, _ in DIFFS])
def test_an_example_alone_does_what_it_says(title: str, diff: str, tmp_path: Path) -> None:
    copy_sources(tmp_path)
    apply(diff, tmp_path)
    check(CHECKS[title], tmp_path)


def copy_sources(to: Path) -> None:
    """With what Python has compiled of them, which is valid by the files' dates; no kernels."""
    for folder in ("docs/pages", "fsw", "messages", "sitl", "tests/fsw", "tests/sitl"):
        shutil.copytree(ROOT / folder, to / folder, ignore=shutil.ignore_patterns("numba-*"))


def apply(diff: str, folder: Path, *options: str) -> None:
    applied = subprocess.run(
        ["git", "apply", "--recount", *options, "-"],
        input=diff, text=True, cwd=folder, capture_output=True,
    )  # fmt: skip
    assert applied.returncode == 0, applied.stderr


def check(code: str, folder: Path) -> None:
    """Run a script on a copy of the sources."""
    # Plain Python: a copy of the kernels would be compiled anew, which takes a minute.
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(folder)}
    checked = subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    assert checked.returncode == 0, checked.stderr
