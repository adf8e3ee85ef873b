"""What flies, by name; imports nothing, so that a command line can offer it at once."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ControlChoice:
    """What flies, by name; the names are checked where the flight software is built."""

    controller: str
    inner: str
    robustness: str
    solver: str
    soft: bool

    def as_arguments(self) -> list[str]:
        """The same choice as a command line."""
        named = (
            f"--controller={self.controller}",
            f"--inner={self.inner}",
            f"--robustness={self.robustness}",
            f"--solver={self.solver}",
        )
        return [*named, *(["--soft"] if self.soft else [])]
