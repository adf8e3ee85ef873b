"""Layouts that open our logs in PlotJuggler and in Foxglove: which curve is in which plot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final
from xml.etree import ElementTree as ET

from command_line.output import json_text
from fsw.log import topics
from messages.ground_truth import TRUTH_TOPICS
from messages.ulog import Field, Topic

_COLOURS: Final = ("#0969da", "#bc4c00", "#1a7f37", "#8250df", "#bf3989", "#9a6700")
_TOPICS: Final = {topic.name: topic for topic in (*topics.TOPICS, *TRUTH_TOPICS)}


@dataclass(frozen=True, slots=True)
class Plot:
    """Curves in one pair of axes: ``topic/field``, with all elements of an array."""

    title: str
    curves: tuple[str, ...]


TABS: Final[dict[str, tuple[Plot, ...]]] = {
    "margins": (
        Plot("minimum margin [m]", ("barrier_margin/minimum",)),
        Plot("breaches, departures, interventions",
             ("barrier_margin/breaches", "barrier_margin/departures",
              "barrier_margin/interventions")),
        Plot("slack [m/s]", ("mpc_status/slack_max",)),
    ),
    "tracking": (
        Plot("end-effector and reference [m]", ("end_effector/p", "end_effector/p_ref")),
        Plot("velocity [m/s]", ("end_effector/v", "end_effector/v_ref")),
        Plot("body [m]", ("vehicle_local_position/x", "vehicle_local_position/y",
                          "vehicle_local_position/z")),
    ),
    "inputs": (
        Plot("rotor thrust [N]", ("actuator_command/rotor_thrust",)),
        Plot("joint torque [N m]", ("actuator_command/joint_torque",)),
        Plot("planned acceleration [m/s^2]", ("plan_input/a",)),
        Plot("joints [rad]", ("arm_joint_state/q", "arm_joint_setpoint/q")),
    ),
    "timing": (
        Plot("planning cycle [us]", ("mpc_status/total_us", "mpc_status/solve_us")),
        Plot("iterations", ("mpc_status/solver_iterations",)),
        Plot("ticks late, skipped", ("loop_timing/late_ticks", "loop_timing/skipped_ticks")),
    ),
    "estimator": (
        Plot("accuracy [m]", ("estimator_status/pos_horiz_accuracy",
                              "estimator_status/pos_vert_accuracy")),
        Plot("innovations over their limits",
             ("estimator_status/pos_test_ratio", "estimator_status/hgt_test_ratio",
              "estimator_status/hdg_test_ratio", "estimator_status/vel_test_ratio")),
        Plot("true and estimated height [m]", ("sim_ground_truth/p_WB",
                                               "vehicle_local_position/z")),
    ),
}  # fmt: skip


def plotjuggler_layout() -> str:
    """The tabs as PlotJuggler saves them, for a ULog file."""
    root = ET.Element("root")
    tabbed = _child(root, "tabbed_widget", parent="main_window", name="Main Window")
    for name, plots in TABS.items():
        tab = _child(tabbed, "Tab", containers="1", tab_name=name)
        sizes = ";".join([f"{1.0 / len(plots):.6f}"] * len(plots))
        rows = _child(_child(tab, "Container"), "DockSplitter", orientation="-",
                      count=str(len(plots)), sizes=sizes)  # fmt: skip
        for plot in plots:
            area = _child(rows, "DockArea", name=plot.title)
            axes = _child(area, "plot", mode="TimeSeries", style="Lines", flip_x="false",
                          flip_y="false")  # fmt: skip
            _child(axes, "limitY")
            for k, curve in enumerate(of for one in plot.curves for of in plotjuggler_curves(one)):
                _child(axes, "curve", name=curve, color=_COLOURS[k % len(_COLOURS)])
    _child(tabbed, "currentTabIndex", index="0")
    _child(root, "use_relative_time_offset", enabled="1")
    plugins = _child(root, "Plugins")
    _child(plugins, "plugin", ID="DataLoad ULog")
    ET.indent(root, " ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, "unicode") + "\n"


def plotjuggler_curves(name: str) -> tuple[str, ...]:
    """PlotJuggler's names of the series of ``topic/field``."""
    count = _field(name).count
    return tuple(f"{name}.{k:02d}" for k in range(count)) if count else (name,)


def foxglove_layout() -> str:
    """A scene beside a plot of each tab, and the log, as Foxglove saves them, for our MCAP."""
    configurations: dict[str, Any] = {
        "3D!flight": {
            "followTf": "world",
            "followMode": "follow-none",
            "scene": {"transforms": {"visible": False}},
            "cameraState": {"perspective": True, "distance": 4.0, "phi": 60.0, "thetaOffset": 225.0,
                            "targetOffset": [0, 0, 1.2], "target": [0, 0, 0],
                            "targetOrientation": [0, 0, 0, 1], "fovy": 45, "near": 0.05,
                            "far": 500},
            "topics": {topic: {"visible": True} for topic in ("/scene", "/arm", "/zones", "/path")},
            "layers": {"grid": {"layerId": "foxglove.Grid", "instanceId": "grid", "visible": True,
                                "label": "grid", "frameId": "world", "size": 6, "divisions": 6}},
        },
        "RosOut!log": {"searchTerms": [], "minLogLevel": 2, "topicToRender": "/log"},
    }  # fmt: skip
    for name in ("margins", "tracking", "inputs"):
        configurations[f"Plot!{name}"] = {
            "title": name,
            "paths": [
                {"value": path, "enabled": True, "timestampMethod": "receiveTime"}
                for path in foxglove_paths(TABS[name][0])
            ],
            "showLegend": True,
            "isSynced": True,
            "xAxisVal": "timestamp",
        }
    plots = _stacked("Plot!margins", _stacked("Plot!tracking", "Plot!inputs", 50), 33)
    layout = {
        "configById": configurations,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1.0},
        "layout": {
            "direction": "row",
            "first": _stacked("3D!flight", "RosOut!log", 78),
            "second": plots,
            "splitPercentage": 60,
        },
    }
    return json_text(layout, 2) + "\n"


def foxglove_paths(plot: Plot) -> tuple[str, ...]:
    """Foxglove's paths to the values of a plot."""
    found: list[str] = []
    for curve in plot.curves:
        path, count = curve.replace("/", "."), _field(curve).count
        found += [f"{path}[{k}]" for k in range(count)] if count else [path]
    return tuple(found)


def _stacked(first: Any, second: Any, share: int) -> dict[str, Any]:
    return {"direction": "column", "first": first, "second": second, "splitPercentage": share}


def _field(name: str) -> Field:
    """The field of ``topic/field``.

    Raises:
        KeyError: No log has it.
    """
    topic, _, wanted = name.partition("/")
    named: Topic = _TOPICS[topic]
    return {field.name: field for field in named.fields}[wanted]


def _child(into: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(into, tag, attributes)
