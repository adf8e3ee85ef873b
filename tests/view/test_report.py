"""The numbers in the report are those of the log and of result.json."""

from __future__ import annotations

import base64
import gzip
import json
import math
import os
import re
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from docs.figures.browser import chromium
from docs.figures.browser import page as browser_page
from fsw.autopilot.model.airframe import AIRFRAME
from messages import ulog
from pandion.report import labels, main, write_report
from tests.cli.command import one_sentence
from tests.view import flights
from tests.view.flights import (
    CYCLES_US,
    ERROR_M,
    OFFSET_M,
    SPIKE_N,
    SPIKE_S,
    TEXT,
    WORST_M,
    WORST_S,
    north,
    write_flight,
)
from view.flight_data import FlightData, Table
from view.log_flight import LogFlight
from view.report.chart import thinned
from view.report.charts import event_marks, force
from view.report.page import difference
from view.report.reported import Reported
from view.scene import Event, EventKind

TIME_AXES = ("margins", "tracking", "inputs", "plan_inputs", "motion", "loop_timing", "estimator",
             "worst_second")  # fmt: skip


def figures(page: str) -> dict[str, Any]:
    """What the page draws, by name."""
    found = re.search(r'<script type="application/json" id="figures">(.*?)</script>', page, re.S)
    assert found is not None
    return {figure["name"]: figure for figure in json.loads(found[1])}


def trace(figure: dict[str, Any], name: str) -> dict[str, Any]:
    (found,) = [one for one in figure["data"] if one["name"] == name]
    return dict(found)


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_flight(tmp_path_factory.mktemp("one") / "flown")


@pytest.fixture(scope="module")
def page(flight: Path) -> str:
    written = write_report([flight])
    assert written == flight / "report.html"
    return written.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def drawn(page: str) -> dict[str, Any]:
    return figures(page)


def test_the_smallest_margin_is_the_results_to_the_last_digit(drawn: dict[str, Any]) -> None:
    mark = trace(drawn["margins"], "minimum")
    assert (mark["x"], mark["y"]) == ([WORST_S], [1e3 * WORST_M])
    assert trace(drawn["worst_second"], "minimum")["x"] == [WORST_S]


def test_margins_over_time_are_distances_to_the_walls(drawn: dict[str, Any]) -> None:
    """Level, with the arm straight down: base, joint and end-effector are equally far away."""
    wall, clearance = 1.0, 0.1
    shown = trace(drawn["margins"], "front")
    expected = [1e3 * (wall - north(t) - clearance) for t in shown["x"]]
    assert len(shown["x"]) == 50 * flights.SECONDS
    np.testing.assert_allclose(shown["y"], expected, atol=2e-3)
    beside = trace(drawn["margins"], "left")
    np.testing.assert_allclose(beside["y"], 900.0, atol=1e-3)
    own = trace(drawn["margins"], "minimum, by the vehicle's estimate")
    np.testing.assert_allclose(own["y"], 200.0, atol=1e-2)


def test_the_path_is_drawn_east_north_up_between_the_zones(drawn: dict[str, Any]) -> None:
    base, tip = trace(drawn["path"], "base"), trace(drawn["path"], "end-effector")
    assert max(base["y"]) == pytest.approx(north(3.0), abs=1e-3)
    assert set(base["z"]) == {-flights.HEIGHT}
    np.testing.assert_allclose(tip["z"], -flights.HEIGHT - 0.3, atol=1e-6)
    worst = trace(drawn["path"], "smallest margin")
    assert worst["z"] == [pytest.approx(-flights.HEIGHT - 0.3)]
    walls = [one for one in drawn["path"]["data"] if one["type"] == "mesh3d"]
    assert [one["name"] for one in walls] == [
        "zone 1", "zone 1 with its clearance", "zone 2", "zone 2 with its clearance",
    ]  # fmt: skip
    np.testing.assert_allclose(walls[0]["y"], 1.0)
    np.testing.assert_allclose(walls[1]["y"], 0.9)


def test_bars_are_the_margins_and_limits_of_the_result(drawn: dict[str, Any]) -> None:
    (bars,) = drawn["parts"]["data"]
    assert dict(zip(bars["y"], bars["x"], strict=True)) == {
        "front/end_effector": 1e3 * WORST_M, "front/base": 50.0,
    }  # fmt: skip
    (used,) = drawn["limits"]["data"]
    assert (used["y"], used["x"]) == (["tilt"], [25.0])


def test_the_tracking_error_is_the_distance_to_the_reference(drawn: dict[str, Any]) -> None:
    np.testing.assert_allclose(trace(drawn["tracking"], "distance")["y"], 5.0, rtol=1e-4)
    np.testing.assert_allclose(trace(drawn["tracking"], "east")["y"], 1e3 * ERROR_M[1], rtol=1e-4)


def test_a_spike_of_one_tick_is_in_the_thinned_line(drawn: dict[str, Any]) -> None:
    rear = trace(drawn["inputs"], "rotor 1 (rear)")
    at = rear["y"].index(SPIKE_N)
    assert rear["x"][at] == SPIKE_S
    assert [shape["y0"] for shape in drawn["inputs"]["layout"]["shapes"] if "x0" in shape][:2] == [
        0.0, 17.1675,
    ]  # fmt: skip


def test_thrusts_are_a_band_of_all_and_a_mean_of_each(drawn: dict[str, Any]) -> None:
    top = trace(drawn["inputs"], "rotors, least to most")
    assert top["fill"] == "tonexty"
    assert max(top["y"]) == SPIKE_N, "no extreme is lost in the band"
    mean = trace(drawn["inputs"], "rotor 1 (rear), mean")
    assert "visible" not in mean
    assert max(mean["y"]) < SPIKE_N
    assert trace(drawn["inputs"], "rotor 1 (rear)")["visible"] == "legendonly"


def test_each_row_has_its_legend_and_the_events_stand_between_it_and_the_axis(
    drawn: dict[str, Any],
) -> None:
    figure = drawn["motion"]
    layout = figure["layout"]
    axes = [key for key in layout if key.startswith("yaxis")]
    assert len(axes) > 2
    for axis in axes:
        legend = layout[axis.replace("yaxis", "legend")]
        assert legend["y"] >= layout[axis]["domain"][1]
        named = {
            one["legend"] for one in figure["data"] if one["yaxis"] == axis.replace("axis", "")
        }
        assert named == {axis.replace("yaxis", "legend")}
    inner_px = layout["height"] - layout["margin"]["t"] - layout["margin"]["b"]
    assert all(one["y"] == 1 for one in layout["annotations"])
    assert (layout["legend"]["y"] - 1.0) * inner_px >= 12.0, "room for the events' numbers"


def test_a_page_of_two_flights_says_their_difference() -> None:
    assert difference("215.9 mm", "200.4 mm") == "-15.5 mm"
    assert difference("58.76 of 60.00 deg", "59.00 of 60.00 deg") == "+0.24 deg"
    assert difference("5.94 %", "6.00 %") == "+0.06 %"
    assert difference("3", "5") == "+2"
    assert difference("40.8 mm, left/joint2", "37.0 mm, amid/base") == "-3.8 mm"
    assert difference("88.6 mm / 152.2 mm", "83.5 mm / 152.3 mm") == "-5.1 mm / +0.1 mm"
    assert difference("0.77 / 7.8 / 15 ms", "0.70 / 6.8 / 14 ms") == "-0.07 / -1.0 / -1 ms"
    for one, other in (("mocap", "rtk"), ("1 mm", "1 m"), ("1 / 2", "1 / 2 / 4"), ("", "1")):
        assert difference(one, other) == ""


def test_thinning_keeps_the_extremes_and_the_number() -> None:
    t = np.arange(10_000) * 0.002
    y = np.sin(t)
    y[1234], y[8765] = 7.0, -7.0
    kept, values = thinned(t, y, 200)
    assert len(kept) <= 200
    assert {7.0, -7.0} <= set(values.tolist())
    assert np.all(np.diff(kept) > 0.0)
    gap = np.where(t < 10.0, np.nan, y)
    assert np.isnan(thinned(t, gap, 200)[1]).any()


def test_the_distribution_counts_every_planning_cycle(drawn: dict[str, Any]) -> None:
    took = drawn["solver"]["data"][0]
    share = dict(zip(took["x"], took["y"], strict=True))
    every = sorted(1e-3 * one for one in CYCLES_US)
    assert share[every[0]] == pytest.approx(0.25)
    assert share[every[-1]] == 1.0


def test_the_estimators_error_is_estimate_minus_truth(drawn: dict[str, Any]) -> None:
    for name, offset in zip(("north", "east", "down"), OFFSET_M, strict=True):
        shown = trace(drawn["estimator"], name)
        np.testing.assert_allclose(shown["y"], 1e3 * offset, atol=1e-3)
    high = [one for one in drawn["estimator"]["data"] if one["name"] == "3 σ"]
    # 2 mm are stated of north and east together.
    assert high[0]["y"][0] == pytest.approx(6.0 / math.sqrt(2.0), rel=1e-4)


def test_the_loop_and_its_stages_are_those_that_were_measured(drawn: dict[str, Any]) -> None:
    assert trace(drawn["loop_timing"], "execution p99")["y"] == [90.0] * flights.SECONDS
    assert trace(drawn["stages"], "maximum")["x"] == [200]


def test_every_axis_of_time_has_every_event(drawn: dict[str, Any]) -> None:
    for name in TIME_AXES:
        shapes = drawn[name]["layout"]["shapes"]
        upright = {shape["x0"] for shape in shapes if shape["x0"] == shape["x1"]}
        assert upright == {0.5, 2.5, 2.75, 3.5}, name


def test_of_many_events_the_axes_show_the_failsafes_first() -> None:
    begin = 1e-6 * flights.BEGIN_US
    found = [Event(begin + k + 1.0, EventKind.WARNING, "windy") for k in range(200)]
    found += [Event(begin + 500.0, EventKind.FAULT, "no plan")]
    data = FlightData(Path(), {}, {}, {"any": Table("any", np.array([begin]), {})}, (), (), 0, "")
    marks = event_marks(
        Reported(label="", data=data, margins=None, events=tuple(found), numbers={})
    )
    assert len(marks) == 60
    assert marks[-1] == (500.0, "201")


def test_the_force_on_the_tool_is_drawn_with_its_bound() -> None:
    t = np.arange(4) / 50.0
    own = {"pressed": t, "asked": 0.0 * t + 5.0, "most": 0.0 * t + 10.0}
    tables = {
        "tool_contact": Table("tool_contact", t, own),
        "sim_contact": Table("sim_contact", t, {"normal": 2.0 * t}),
    }
    data = FlightData(Path(), {}, {}, tables, (), (), 0, "")
    chart = force([Reported(label="", data=data, margins=None, events=(), numbers={})])
    assert chart is not None
    figure = {"data": chart.data}
    np.testing.assert_allclose(trace(figure, "true")["y"], 2.0 * t, rtol=1e-4)
    np.testing.assert_allclose(trace(figure, "observed")["y"], t, rtol=1e-4)
    assert {shape["y0"] for shape in chart.layout["shapes"] if "y0" in shape} >= {10.0}
    bare = FlightData(Path(), {}, {}, {"any": Table("any", t, {})}, (), (), 0, "")
    assert force([Reported(label="", data=bare, margins=None, events=(), numbers={})]) is None


def test_the_events_are_in_a_table_in_order(page: str) -> None:
    rows = re.findall(r"<tr><td>(\d+)</td><td>([\d.]+)</td><td>(\w+)</td>", page)
    assert [int(number) for number, _, _ in rows] == list(range(1, len(rows) + 1))
    times = [float(t) for _, t, _ in rows]
    assert times == sorted(times)
    assert {"mode", "fault", "warning", "command", "arming"} <= {kind for _, _, kind in rows}
    assert "DO_SET_MODE: accepted" in page
    assert "no plan" in page


def test_the_worst_second_is_what_is_about_it(drawn: dict[str, Any]) -> None:
    figure = drawn["worst_second"]
    assert figure["layout"]["xaxis"]["range"] == [WORST_S - 0.5, WORST_S + 0.5]
    rotor = trace(figure, "rotor 1 (rear)")
    assert len(rotor["x"]) == 500
    assert min(rotor["x"]) >= WORST_S - 0.5


def test_text_of_a_flight_cannot_leave_its_place(page: str) -> None:
    assert TEXT not in page
    assert "&lt;/script&gt;&lt;b&gt;wet" in page
    assert page.count("<script") == page.count("</script>") == 3


def test_the_page_needs_nothing_else_and_is_small_enough(page: str) -> None:
    assert len(page.encode()) < 5e6
    before = page.partition('id="plotly"')[0]
    assert not re.findall(r'\b(?:src|href)="(?!#)', before)
    assert "default-src 'none'" in before
    packed = re.search(r'id="plotly">([^<]*)<', page)
    assert packed is not None
    source = files("plotly").joinpath("package_data", "plotly.min.js").read_bytes()
    assert gzip.decompress(base64.b64decode(packed[1])) == source


def test_verdict_and_provenance_are_said(page: str) -> None:
    for words in (
        "PASS", "Flew 4.0 s.",
        "At 3.013 s the end-effector kept 12.3 mm more than the clearance from front (112.3 mm",
        "pandion fly walls --seed=3 --sensors=mocap --duration=4 --realtime --body=points",
        "PLN_TILT_MAX 17",
        "log written", f"Pandion {version('pandion')}",
    ):  # fmt: skip
        assert words in page, words


def test_two_flights_stand_side_by_side(flight: Path, tmp_path: Path) -> None:
    other = write_flight(tmp_path / "other", completed=False, end_reason="left", min_margin_m=-0.01)
    page = write_report([flight, other], tmp_path / "both.html").read_text(encoding="utf-8")
    drawn = figures(page)
    assert {"flown", "other"} <= {one["name"] for one in drawn["margins"]["data"]}
    assert trace(drawn["margins"], "other: minimum")["y"] == [-10.0]
    assert "inputs" not in drawn  # those are compared by their limits
    assert [one["name"] for one in drawn["limits"]["data"]] == ["flown", "other"]
    assert "<th>flown</th><th>other</th>" in page
    assert "<th>difference</th>" in page
    assert page.count("badge pass") == page.count("badge fail") == 1
    assert "kept 10.0 mm less than the clearance" in page


def test_a_flight_that_was_killed_is_drawn_by_its_own_estimate(tmp_path: Path) -> None:
    killed = write_flight(tmp_path / "killed")
    for name in ("result.json", "sitl.json", "fsw.json"):
        (killed / name).unlink()
    data = (killed / "flight.ulg").read_bytes()
    (killed / "flight.ulg").write_bytes(data[: len(data) // 2 + 7])
    page = write_report([killed]).read_text(encoding="utf-8")
    assert "NO RESULT" in page
    assert "The log was cut." in page
    assert "inputs" in figures(page)


def test_a_result_of_an_older_build_is_shown_as_far_as_it_goes(tmp_path: Path) -> None:
    older = write_flight(tmp_path / "older")
    written = json.loads((older / "result.json").read_text())
    for key in ("sensors", "limits", "safety", "beyond_s"):
        del written[key]
    (older / "result.json").write_text(json.dumps(written))
    page = write_report([older]).read_text(encoding="utf-8")
    assert "badge pass" in page
    assert "<td>sensors</td><td>unknown</td>" in page


@pytest.mark.requirement("REQ-LINK-9")
@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("result", "[" * 200_000, "result.json is nested too deeply"),
        ("result", "[1, 2]", "result.json must be a JSON object"),
        ("result", "{", "result.json is not JSON"),
        ("result", '{"min_margin_m": NaN}', "result.json holds NaN: every number must be finite"),
        ("result", '{"min_margin_m": 1e999}', "holds 1e999: every number must be finite"),
        ("result", '{"duration_s": %s}' % ("9" * 400), "must have at most 64 bits"),
        ("result", '{"margins_m": [1, 2]}', "a wrong value: margins_m must be an object"),
        ("result", '{"margins_m": {"a": "b"}}', "a wrong value: margins_m.a must be a number"),
        ("result", '{"completed": "yes"}', "a wrong value: completed must be true or false"),
        ("result", '{"sensors": 1}', "a wrong value: sensors must be a text or null"),
        ("result", '{"end_reason": "\\ud800"}', "result.json has a text that is not Unicode"),
        ("sitl", '{"min_margin_m": 0.1}', "sitl.json has no min_margin_time_s"),
        ("fsw", '{"stages": {"tick": {"p50_us": 1}}}', "fsw.json has no stages.tick.p99_us"),
        ("fsw", '{"mpc": {"p50_us": 1.0}}', "fsw.json has no mpc.p99_us"),
    ],
)  # fmt: skip
def test_a_hostile_result_is_refused_in_one_sentence_that_names_what_is_wrong(
    name: str, text: str, said: str, tmp_path: Path, capsys: Any
) -> None:
    directory = write_flight(tmp_path / "flight")
    (directory / f"{name}.json").write_text(text)
    assert main([str(directory)]) == 2
    sentence = capsys.readouterr().err
    assert one_sentence(sentence)
    assert said in sentence
    flight = LogFlight(directory)  # which is shown without it
    assert len(flight.unusable) == 1
    assert flight.scene(flight.end).estimate is not None


def test_a_result_that_is_a_pipe_is_refused_and_not_waited_for(tmp_path: Path, capsys: Any) -> None:
    directory = write_flight(tmp_path / "flight")
    (directory / "result.json").unlink()
    os.mkfifo(directory / "result.json")
    assert main([str(directory)]) == 2
    assert "result.json cannot be read: it is not a regular file" in capsys.readouterr().err


@pytest.mark.parametrize("numbers", ["[" * 7679, "[]", '{"airframe.tilt_max": [1]}', "", "NaN"])
def test_numbers_in_a_log_that_are_none_are_refused_or_passed_over(
    numbers: str, tmp_path: Path, capsys: Any
) -> None:
    directory = write_flight(tmp_path / "flight")
    data = (directory / "flight.ulg").read_bytes()
    key = re.search(rb"char\[\d+\] numbers", data)
    assert key is not None
    head = key.start() - 4  # length, kind and the key's own length
    end = head + 3 + int.from_bytes(data[head : head + 2], "little")
    (directory / "flight.ulg").write_bytes(
        data[:head] + ulog.information("numbers", numbers) + data[end:]
    )
    assert main([str(directory)]) == 2
    sentence = capsys.readouterr().err
    assert one_sentence(sentence)
    assert "is damaged: its information numbers " in sentence
    assert LogFlight(directory).airframe == AIRFRAME


def test_a_log_that_ends_before_the_smallest_margin_is_shown_without_that_second(
    tmp_path: Path,
) -> None:
    assert "worst_second" in figures(
        write_report([write_flight(tmp_path / "short", seconds=1)]).read_text(encoding="utf-8")
    )


def test_labels_tell_flights_apart(tmp_path: Path) -> None:
    for name in ("a/run", "b/run", "c"):
        (tmp_path / name).mkdir(parents=True)
    found = [tmp_path / "a" / "run", tmp_path / "b" / "run" / "flight.ulg", tmp_path / "c"]
    assert labels(found[::2]) == ["run", "c"]
    assert [label.split("/")[-2:] for label in labels(found[:2])] == [["a", "run"], ["b", "run"]]
    assert len(set(labels([found[2], found[2]]))) == 2


def test_what_is_no_log_is_refused_in_one_sentence(tmp_path: Path, capsys: Any) -> None:
    (tmp_path / "flight.ulg").write_text("no log at all")
    assert main([str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "is not a ULog file" in said
    other = write_flight(tmp_path / "other", limits={"tilt": {}})
    assert main([str(other)]) == 2
    assert "result.json has no limits.tilt.unit: it is of another build" in capsys.readouterr().err
    assert main([str(tmp_path)] * 8) == 2
    assert "at most 7" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.skipif(chromium() is None, reason="no chromium on PATH")
def test_a_browser_draws_every_figure_and_asks_nobody(flight: Path, drawn: dict[str, Any]) -> None:
    with browser_page(1200, 900) as opened:
        opened.open((flight / "report.html").as_uri())
        opened.wait_for("document.body && document.body.dataset.drawn", 60.0)
        assert opened.value("document.body.dataset.drawn") == str(len(drawn))
        assert opened.value("document.querySelectorAll('.chart .main-svg').length") >= len(drawn)
        assert opened.value("document.querySelectorAll('#path canvas').length") > 0
        opened.value("Plotly.relayout('margins', {'xaxis.range': [1, 2]})")
        opened.wait_for("document.getElementById('tracking').layout.xaxis.range[0] === 1")
        assert opened.value("document.getElementById('worst_second').layout.xaxis.range[0] > 2")
        assert opened.complaints == []
        assert {one.partition(":")[0] for one in opened.requests} <= {"file", "blob", "data"}
