"""Which code is running: the git revision where there is one, the version where there is not."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Final

from command_line.version import version

_SOURCE: Final = Path(__file__).resolve().parents[2]
_PATIENCE_S: Final = 5.0


def revision() -> str:
    """The commit of this source tree, ``-dirty`` behind it where files differ from it."""
    if (_SOURCE / ".git").exists():
        command = ["git", "-C", str(_SOURCE), "describe", "--always", "--dirty", "--abbrev=40"]
        try:
            described = subprocess.run(
                [*command, "--exclude=*"],
                capture_output=True,
                text=True,
                timeout=_PATIENCE_S,
                check=True,
                # Reading must not lock the index of the work tree.
                env={**os.environ, "GIT_OPTIONAL_LOCKS": "0"},
            )
            return described.stdout.strip()
        except (OSError, subprocess.SubprocessError):
            pass
    return f"version {version()}"
