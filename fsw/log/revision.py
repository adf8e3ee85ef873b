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
    """The commit of this source tree, ``-dirty`` behind it where files differ from it.

    Where there is none, the version; and why the commit is not known, if there is a repository.
    """
    why = ""
    if (_SOURCE / ".git").exists():
        # git does not read the checkout of another user, whose settings might run programs. This
        # program is from that checkout, so whoever may change it runs already.
        command = ["git", "-c", "safe.directory=*", "-C", str(_SOURCE)]
        command += ["describe", "--always", "--dirty", "--abbrev=40"]
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
        except subprocess.CalledProcessError as error:
            why = f", commit unknown: {_first_line(error.stderr)}"
        except (OSError, subprocess.SubprocessError) as error:
            why = f", commit unknown: {_first_line(str(error))}"
    return f"version {version()}{why}"


def _first_line(text: str) -> str:
    return (text.strip().splitlines() or ["git failed"])[0]
