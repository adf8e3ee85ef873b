"""Which plots Flight Review's own code draws of a log; run by its Python in its ``plot_app``.

Prints as JSON what it says of the vehicle, the plots that it draws and those that it leaves out.
"""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

# What stands for the page of a browser, and for a log that nobody has rated.
_REQUEST = SimpleNamespace(headers={"User-Agent": ""})
_DOCUMENT = SimpleNamespace(
    template_variables={}, session_context=SimpleNamespace(request=_REQUEST)
)
_NUMBERS = {"wind_speed": -1, "num_logged_errors": 0, "num_logged_warnings": 0}
# What is beside the plots: text, or nothing.
_TEXTS = ("get_heading_html", "get_error_labels_html", "get_corrupt_log_html")
_NOTHING = (
    "get_hardfault_html", "get_changed_parameters", "get_connected_devices", "get_logged_messages",
)  # fmt: skip


class NoRecord:
    """What its database knows of the log."""

    def __getattr__(self, name: str) -> Any:
        return _NUMBERS.get(name, "")


def main() -> None:
    sys.path[:0] = [str(Path.cwd()), str(Path.cwd().parent)]
    # Of tail-sitters only, and asks the database.
    tailsitter: Any = SimpleNamespace(tailsitter_orientation=lambda *_: None)
    sys.modules["vtol_tailsitter"] = tailsitter
    plots, helper, plotting = map(
        importlib.import_module, ("configured_plots", "helper", "plotting")
    )
    for module in (plots, helper, plotting):
        vars(module)["curdoc"] = lambda: _DOCUMENT
    vars(plots).update({name: lambda *_, **__: "" for name in _TEXTS})
    vars(plots).update({name: lambda *_, **__: None for name in _NOTHING})
    drawn, left = [], []
    usual = plotting.DataPlot.finalize

    def finalize(plot: Any) -> Any:
        made = usual(plot)
        (left if made is None else drawn).append(getattr(plot, "title", "Position 2D"))
        return made

    plotting.DataPlot.finalize = finalize
    log = helper.load_ulog_file(sys.argv[1])
    px4 = importlib.import_module("pyulog.px4").PX4ULog(log)
    px4.add_roll_pitch_yaw()
    plots.generate_plots(log, px4, NoRecord(), None, "", "")
    print(json.dumps({"type": px4.get_mav_type(), "drawn": drawn, "left": left}))


if __name__ == "__main__":
    main()
