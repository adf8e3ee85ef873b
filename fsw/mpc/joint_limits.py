"""Joint-angle limits (Table I) as soft rows: a disturbed arm may be found outside."""

from __future__ import annotations

import numpy as np

from fsw.barriers.constraint_block import block
from fsw.model.linearisation import Linearisation
from fsw.model.prediction import Q_ARM, CondensedModel

_LIMITED = np.array([[1.0, 0.0], [-1.0, 0.0], [1.0, 1.0], [-1.0, -1.0]])  # +-th1, +-(th1 + th2)


class JointLimits:
    """``|th1|`` and ``|th1 + th2|`` within their limits at every node, one slack a node."""

    def __init__(self, model: CondensedModel) -> None:
        airframe = model.airframe
        self.rows = block((len(_LIMITED),), 1, model.horizon)
        limits = np.array([airframe.joint1_limit] * 2 + [airframe.joint12_limit] * 2)
        self.rows.lower_bound[:] = np.tile(-limits, model.horizon)
        angles = model.gamma[1:, Q_ARM : Q_ARM + 2]  # (n, 2, 6 n)
        self.rows.gradient[:] = -np.einsum("lj,njk->nlk", _LIMITED, angles).reshape(
            self.rows.gradient.shape
        )

    def refill(self, horizon: Linearisation) -> None:
        """Bring the angles up to date; the gradient never changes."""
        angles = horizon.states[1:, Q_ARM : Q_ARM + 2]
        self.rows.value[:] = -(angles @ _LIMITED.T).ravel()
