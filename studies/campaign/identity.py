"""What two machines must have in common for a flight to be the same on both."""

from __future__ import annotations

import hashlib
import os
import platform
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, requires
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Final

import fsw
import sitl
import studies

_DIGITS: Final = 32
_SHOWN: Final = 15
_BESIDE: Final = ("llvmlite",)  # compiles the kernels; numba names it, we do not


@dataclass(frozen=True, slots=True)
class Identity:
    """Digests of code and packages."""

    code: str
    packages: str
    threads: str = "one thread"  # of its matrix products, on which their last bits depend

    def differs(self, other: Identity) -> str:
        """What of another machine is not as here, in words; empty if all is."""
        wrong = [
            f"{what} {there[:_SHOWN]} instead of {here[:_SHOWN]}"
            for what, here, there in (
                ("code", self.code, other.code),
                ("packages", self.packages, other.packages),
                ("linear algebra on", self.threads, other.threads),
            )
            if here != there
        ]
        return " and ".join(wrong)


@cache
def identity() -> Identity:
    """Of this process."""
    one = "1" in (os.environ.get("OPENBLAS_NUM_THREADS"), os.environ.get("OMP_NUM_THREADS"))
    return Identity(_code(), packages(), "one thread" if one else "several threads")


def _code() -> str:
    digest = hashlib.sha256()
    for package in (fsw, sitl, studies):
        folder = Path(str(package.__file__)).parent
        for path in sorted(folder.rglob("*.py")):
            digest.update(str(path.relative_to(folder.parent)).encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:_DIGITS]


@cache
def packages() -> str:
    """Digest of Python's version, the kind of processor and the packages that flights use.

    These are the installed versions: what the lock says only if they were installed from it.
    """
    found = [f"python {platform.python_version()} {platform.machine()}"]
    for line in sorted([*(requires("pandion") or ()), *_BESIDE]):
        if "extra ==" in line:
            continue
        name = line.split(";")[0].split(">")[0].split("=")[0].split("[")[0].strip()
        try:
            found.append(f"{name} {version_of(name)}")
        except PackageNotFoundError:
            found.append(f"{name} is missing")
    return hashlib.sha256("\n".join(found).encode()).hexdigest()[:_DIGITS]
