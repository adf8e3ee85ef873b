"""Tests of what the page says beside the picture."""

import math
from dataclasses import replace

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.signals import SafeSet
from view import colours, panels
from view.scene import Battery, Event, Held, Margin, Posture, Scene, Solver, Timing, Tool, Worst

LEVEL = Posture((0.0, 0.0, -1.0), (1.0, 0.0, 0.0, 0.0), (0.5, 0.25))
SCENE = Scene(
    t=12.0,
    estimate=LEVEL,
    thrust=(8.0, 8.0, 8.0, 8.0),
    torque=(0.5, -0.1),
    safe_set=SafeSet(),
    margins=(Margin("left/base", 0.3, 0.9), Margin("front/base", -0.0123, -0.1)),
    minimum=-0.0123,
    mode="hold",
    armed=True,
    failures="battery low",
    battery=Battery(15.2, 0.4),
    solver=Solver("infeasible", 0.12, 0.1, 9, 0.0, 3, 2),
    timing=(Timing("inner", 0.002, 5e-4, 1, 2),),
)


def test_one_instant_says_what_a_pilot_asks_for() -> None:
    html = panels.now_html(SCENE, AIRFRAME, begin=2.0)
    for said in ("hold", "armed", "battery low", "-12.3 mm", "10.00 s", "infeasible", "120.00 ms"):
        assert said in html, said
    assert html.index("front/base") < html.index("left/base"), "the least margin comes first"
    assert "of 17.17" in html


def test_the_force_on_the_tool_is_shown_against_what_is_allowed_and_the_payload_by_its_mass() -> (
    None
):
    tool, held = Tool((-6.0, 0.0, 0.0), 6.04, 5.0, 10.0, True), Held(True, 0.312)
    html = panels.now_html(replace(SCENE, tool=tool, held=held), AIRFRAME, begin=2.0)
    for said in ("in contact", "6.0 N", "of 10", "asked for", "5.0 N", "312 g", "closed"):
        assert said in html, said
    assert "gripper" not in panels.now_html(SCENE, AIRFRAME, begin=2.0)


def test_what_is_not_known_is_not_made_up() -> None:
    html = panels.now_html(Scene(t=math.nan), AIRFRAME, begin=0.0)
    assert "no zone is known" in html
    assert "armed" not in html
    assert "Planner" not in html
    assert "nan mm" not in html


def test_what_a_vehicle_says_is_no_markup() -> None:
    hostile = "<img src=x onerror=alert(1)>"
    margin = Margin(hostile, 0.1, 0.1)
    scene = Scene(t=0.0, mode=hostile, failures=hostile, margins=(margin,), minimum=0.1)
    pages = (
        panels.now_html(scene, AIRFRAME, 0.0),
        panels.events_html([Event(0.0, hostile, hostile)], 1.0, 0.0),
        panels.messages_html([(hostile, hostile, 1.0, hostile)]),
        panels.parameters_html([(hostile, hostile)]),
        panels.refusal_html(hostile),
        panels.facts_html([(hostile, hostile)]),
        panels.worst_html(Worst(0.0, 0.1, hostile, hostile), 0.0),
    )
    for html in pages:
        assert "&lt;img" in html
        assert "<img" not in html


def test_the_worst_moment_is_exact() -> None:
    html = panels.worst_html(Worst(54.363, 0.0482204198040653, "front", "truth"), begin=1.0)
    assert 'data-metres="0.0482204198040653"' in html
    assert "48.2 mm" in html
    assert "53.36 s" in html


def test_the_last_event_is_marked_and_later_ones_are_pale() -> None:
    events = [Event(float(t), "text", f"text {t}") for t in range(100)]
    html = panels.events_html(events, 70.5, 0.0, most=10)
    marked = next(row for row in html.split("<tr")[1:] if "background" in row)
    assert "text 70<" in marked
    assert html.count("<tr") == 10
    assert "opacity:.5" in html[html.index("text 71") - 300 :]


def test_colours_warn_of_small_margins() -> None:
    assert colours.of_margin(-0.1) == colours.of_margin(0.0) == colours.RED
    assert colours.of_margin(2.0) == colours.GREEN
    assert colours.of_margin(math.nan) == colours.GREY
