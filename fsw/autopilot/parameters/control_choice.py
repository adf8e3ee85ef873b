"""What flies, by name; imports little, so that a command line can offer it at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from command_line.options import ContradictionError, option, switch
from command_line.values import one_of

# What can be chosen, by the name of the choice; a test holds it against what can be built.
KNOWN: dict[str, tuple[str, ...]] = {
    "controller": ("blf", "hc", "sc", "naive"),
    "tracking": ("lqr", "pid"),
    "lambda": ("consistent", "paper-1", "paper-5"),
    "solver": ("clarabel", "slsqp"),
    "body": ("points", "full"),
}
FULL = "full"  # the body where none is named
INNER_LOOPS = {"lqr": "tracking", "pid": "pid"}  # their names in logs and configurations


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlChoice:
    """What flies, by name; the fields are the options of a command line."""

    controller: str = option(
        "--controller NAME",
        "predictive controller: blf, hc, sc or naive",
        one_of("controller", *KNOWN["controller"]),
        default="blf",
    )
    tracking: str = option(
        "--tracking NAME",
        "inner loop that tracks the plan: lqr or pid",
        one_of("tracking", *KNOWN["tracking"], old={"tracking": "lqr"}),
        default="lqr",
        old="--inner",
    )
    lambda_: str = option(
        "--lambda NAME",
        "lambda of the barrier: consistent, or the paper's, paper-1 or paper-5, which "
        "need --allow-inconsistent",
        one_of("lambda", *KNOWN["lambda"]),
        default="consistent",
        old="--robustness",
    )
    solver: str = option(
        "--solver NAME",
        "optimiser: clarabel or the paper's slsqp",
        one_of("solver", *KNOWN["solver"]),
        default="clarabel",
    )
    body: str | None = option(
        "--body NAME",
        "what keeps clear: full, or the paper's points (default the scenario's, or full)",
        one_of("body", *KNOWN["body"]),
    )
    allow_inconsistent: bool = switch(
        "--allow-inconsistent",
        "fly a configuration that cannot keep its safe set, with a warning",
        old="--soft",
    )

    def check(self) -> None:
        """Refuse a lambda that the vehicle would refuse to arm with, before anything starts.

        Raises:
            ContradictionError: It needs --allow-inconsistent.
        """
        # Only this controller has a barrier, and with it a lambda.
        named = self.controller == "blf" and self.lambda_ != "consistent"
        if named and not self.allow_inconsistent:
            raise ContradictionError(
                f"--lambda {self.lambda_} contradicts the limits of the vehicle, which would not "
                "arm: add --allow-inconsistent to fly it all the same"
            )

    @property
    def kernels(self) -> str:
        """A name for the kernels that it flies with."""
        return f"{self.controller}-{self.tracking}-{self.solver}"

    @property
    def inner(self) -> str:
        """The name of the inner loop in logs and configurations."""
        return INNER_LOOPS.get(self.tracking, self.tracking)

    def facts(self) -> dict[str, str | int]:
        """What a flight log says about the choice."""
        return {
            "controller": self.controller,
            "inner": self.inner,
            "robustness": self.lambda_,
            "solver": self.solver,
            "body": self.body or FULL,
            "soft": int(self.allow_inconsistent),
        }


def choice_of(fact: Callable[[str], str]) -> ControlChoice:
    """The choice that a flight log tells of, given what it says under a name."""
    inner = fact("inner")
    return ControlChoice(
        controller=fact("controller"),
        tracking=next((name for name, known in INNER_LOOPS.items() if known == inner), inner),
        lambda_=fact("robustness"),
        solver=fact("solver"),
        body=fact("body"),
        allow_inconsistent=fact("soft") != "0",
    )
