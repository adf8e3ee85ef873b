"""The shapes of zones, one file each: a table of a scenario, and the distance to it.

A file that is added here is a shape. Its number is that of PANDION_SHAPE in the dialect.
"""

from __future__ import annotations

import importlib
import pkgutil
from typing import Final

from sitl.scenario import ScenarioZone
from sitl.shapes.kind import ShapeKind


def _found() -> tuple[ShapeKind, ...]:
    """The ``KIND`` of each module of this folder that has one, by its number."""
    modules = [
        importlib.import_module(f"{__name__}.{module.name}")
        for module in pkgutil.iter_modules(__path__)
    ]
    kinds = [module.KIND for module in modules if hasattr(module, "KIND")]
    return tuple(sorted(kinds, key=lambda kind: kind.number))


KINDS: Final = _found()
TABLES: Final[tuple[type[ScenarioZone], ...]] = tuple(kind.table for kind in KINDS)
_BY_TABLE: Final = {kind.table: kind for kind in KINDS}


def kind_of(zone: ScenarioZone) -> ShapeKind:
    """The kind of a zone's shape."""
    return _BY_TABLE[type(zone)]
