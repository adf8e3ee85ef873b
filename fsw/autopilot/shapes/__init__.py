"""One file a shape; a file that is added here is a shape that can be kept out of, or in."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Final

from fsw.autopilot.shapes.kind import ShapeKind
from fsw.autopilot.signals import Shape


def _found() -> tuple[ShapeKind, ...]:
    """The ``KIND`` of each module of this folder that has one, by its number in the dialect."""
    modules = [
        importlib.import_module(f"{__name__}.{module.name}")
        for module in pkgutil.iter_modules(__path__)
        if module.name != "zones"  # which compiles what is found here
    ]
    kinds = [module.KIND for module in modules if hasattr(module, "KIND")]
    return tuple(sorted(kinds, key=lambda kind: kind.number))


KINDS: Final = _found()
BY_NAME: Final = {kind.name: kind for kind in KINDS}
BY_NUMBER: Final = {kind.number: kind for kind in KINDS}


def kind_of(shape: Shape) -> ShapeKind:
    """The kind of a shape.

    Raises:
        KeyError: There is none of that name.
    """
    return BY_NAME[shape.kind]
