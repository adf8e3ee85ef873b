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


# What can be chosen, by the name of the choice; a test holds it against what can be built.
KNOWN: dict[str, tuple[str, ...]] = {
    "controller": ("blf", "hc", "sc", "naive"),
    "inner": ("tracking", "pid"),
    "robustness": ("consistent", "paper-1", "paper-5"),
    "solver": ("clarabel", "slsqp"),
}


def check(choice: ControlChoice) -> None:
    """Refuse an unknown name before anything is started.

    Raises:
        ValueError: naming it and the known ones.
    """
    for what, known in KNOWN.items():
        name = getattr(choice, what)
        if name not in known:
            raise ValueError(f"unknown {what} '{name}'; known: {', '.join(known)}")
