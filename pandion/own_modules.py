"""Where modules are looked for: Pandion's first, those that PYTHONPATH brings last.

A shell that has sourced a ROS workspace brings modules to every Python, and one called ``messages``
would be taken for ours, an old NumPy for the one of this environment.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

_PACKAGE: Final = Path(__file__).resolve().parent


def put_first() -> None:
    """Order the search of this process, and of those that it starts."""
    ours = our_modules()
    brought = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    last = {Path(path).absolute() for path in brought}
    # Python puts the working directory first where a module is run.
    known = [path for path in sys.path if path and Path(path).absolute() not in (ours, Path.cwd())]
    own = [path for path in known if Path(path).absolute() not in last]
    sys.path[:] = [str(ours), *own, *(path for path in known if path not in own)]
    if brought:
        os.environ["PYTHONPATH"] = os.pathsep.join(sys.path)


def our_modules() -> Path:
    """Where our other packages are: inside this one in a wheel, beside it in a checkout."""
    inside = _PACKAGE / "packages"
    return inside if inside.is_dir() else _PACKAGE.parent
