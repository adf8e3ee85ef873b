"""Planners and controllers of the user's by import path: options that several verbs share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from command_line.options import option

if TYPE_CHECKING:
    from studies.campaign.plan import OwnNames


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnOptions:
    """What takes the place of ours."""

    planner: str = option(
        "--planner MODULE:NAME", "fly with this planner, see docs/reference/library.md", default=""
    )
    controller: str = option(
        "--controller MODULE:NAME", "fly with this control law in place of ours", default=""
    )

    @property
    def names(self) -> OwnNames:
        """As a campaign file has them."""
        from studies.campaign.plan import OwnNames

        return OwnNames(self.planner, self.controller)
