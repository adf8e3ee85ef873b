"""One file a sensor that aids the filter; a file that is added here is a sensor that is fused."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any, Final

from fsw.autopilot.estimation.sensors.base import AidingSensor
from fsw.autopilot.measurements import Sensor


def _found() -> tuple[type[AidingSensor[Any, Any]], ...]:
    """The subclass of each module of this folder, in the order of ``Sensor``."""
    for module in pkgutil.iter_modules(__path__):
        importlib.import_module(f"{__name__}.{module.name}")
    known = {kind.sensor: kind for kind in AidingSensor.__subclasses__()}
    return tuple(known[sensor] for sensor in Sensor if sensor in known)


SENSORS: Final = _found()
