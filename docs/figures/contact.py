"""A flight that touches: the force on the surface, whole and near, beside what was asked for."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from pyulog import ULog

from docs.figures.flight import BASE, END_EFFECTOR, FORBIDDEN, REFERENCE, seconds
from docs.figures.save import save

TRUE, ASKED, OBSERVED, BOUND = END_EFFECTOR, REFERENCE, BASE, FORBIDDEN
_BIN: Final = 20  # ticks, of which the largest true force is drawn
_BEFORE_S, _SHOWN_S = 1.0, 8.0  # of the nearer view, about the first touch

Numbers = np.ndarray[Any, Any]


def draw_contact(directory: Path, target: Path) -> None:
    """Draw the force of a run directory's flight, which touched one surface."""
    result = json.loads((directory / "result.json").read_text(encoding="utf-8"))
    (touch,) = result["touches"].values()
    log = ULog(str(directory / "flight.ulg"))
    true, observed = log.get_dataset("sim_contact").data, log.get_dataset("tool_contact").data
    bins = len(true["normal"]) // _BIN * _BIN
    t = seconds(log, true)[:bins:_BIN]
    force = true["normal"][:bins].reshape(-1, _BIN).max(axis=1)
    asked = true["asked"][:bins:_BIN]
    figure, (whole, near) = plt.subplots(
        1, 2, figsize=(10.0, 3.6), width_ratios=(1.3, 1.0), sharey=True, layout="constrained"
    )
    figure.suptitle(
        f"pandion fly {result['scenario']} --sensors {result['sensors']} --seed {result['seed']}: "
        f"at most {touch['force_max_n']:.1f} N of {touch['force_bound_n']:.0f} N",
        fontsize=10.0,
    )
    begins = float(t[np.argmax(force > 0.0)]) - _BEFORE_S
    for axes, left, right in ((whole, 0.0, float(t[-1])), (near, begins, begins + _SHOWN_S)):
        seen = (t >= left) & (t <= right)
        axes.plot(t[seen], force[seen], color=TRUE, lw=0.9, label="on the wall, true")
        axes.plot(t[seen], asked[seen], color=ASKED, lw=1.4, label="asked for")
        axes.set_xlim(left, right)
        axes.axhline(touch["force_bound_n"], color=BOUND, lw=1.0)
        axes.grid(axis="y", color="#d0d7de", lw=0.5)
        axes.set_xlabel("time [s]")
    whole.set_ylabel("normal force [N]")
    _draw_observed(near, seconds(log, observed), observed)
    near.set_ylim(0.0, 1.1 * touch["force_bound_n"])
    near.legend(loc="upper right", bbox_to_anchor=(1.0, 0.92), frameon=False, fontsize=8.0)
    whole.set_title("red: the bound", fontsize=9.0)
    near.set_title("the first touch, observed without a force sensor", fontsize=9.0)
    save(figure, target)


def _draw_observed(axes: Axes, t: Numbers, data: dict[str, Numbers]) -> None:
    left, right = axes.get_xlim()
    seen = (t >= left) & (t <= right)
    t, pressed, unsure = t[seen], data["pressed"][seen], data["unsure"][seen]
    low, high = pressed - unsure, pressed + unsure
    axes.fill_between(t, low, high, color=OBSERVED, alpha=0.15, lw=0.0)
    axes.plot(t, pressed, color=OBSERVED, lw=0.9, label="observed, and how sure")
