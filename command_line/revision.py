"""Which code is running: the git revision where there is one, the version where there is not."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Final

from command_line.version import version

_SOURCE: Final = Path(__file__).resolve().parents[1]
_PATIENCE_S: Final = 5.0
_OF_A_REPOSITORY: Final = (
    "GIT_DIR",
    "GIT_WORK_TREE",
    "GIT_INDEX_FILE",
    "GIT_COMMON_DIR",
    "GIT_OBJECT_DIRECTORY",
    "GIT_NAMESPACE",
    "GIT_PREFIX",
)


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
                env=_environment(),
            )
            return described.stdout.strip()
        except subprocess.CalledProcessError as error:
            why = f", commit unknown: {_first_line(error.stderr)}"
        except (OSError, subprocess.SubprocessError) as error:
            why = f", commit unknown: {_first_line(str(error))}"
    return f"version {version()}{why}"


def _environment() -> dict[str, str]:
    """For git: a hook of another repository says which one is meant, and it is not this one."""
    kept = {name: value for name, value in os.environ.items() if name not in _OF_A_REPOSITORY}
    # Reading must not lock the index of the work tree.
    return {**kept, "GIT_OPTIONAL_LOCKS": "0"}


def _first_line(text: str) -> str:
    return (text.strip().splitlines() or ["git failed"])[0]
