"""The planner's quadratic program as data: fixed sparsity, numbers refilled in place.

Unknowns are the inputs U (6 n) followed by the slacks of every soft block. In Clarabel's
form, minimise ``1/2 x' P x + q' x`` subject to ``A x + s = b`` with s in a product of cones:

====================  ==========================================  =============
rows                  meaning                                     cone
====================  ==========================================  =============
soft blocks           gradient U + slack >= required - constant   non-negative
slacks                slack >= 0                                  non-negative
input bounds          -u_max <= u <= u_max                        non-negative
tilt, one a node      |a_xy| <= tan(tilt) (g - a_z)               second-order
====================  ==========================================  =============

Source: docs/equations.md E17.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from fsw.barriers.soft_rows import SoftRows
from fsw.model.airframe import GRAVITY
from fsw.model.prediction import INPUTS, Array


@dataclass(frozen=True)
class QuadraticProgram:
    """One program in Clarabel's form; the arrays' data may change, the pattern may not."""

    p: sparse.csc_matrix  # upper triangle
    q: Array
    a: sparse.csc_matrix
    b: Array
    general_rows: int  # the first; the other non-negative ones have one entry that never changes
    nonnegative_rows: int
    tilt_cones: int  # of three rows each, after the non-negative ones


@dataclass(frozen=True, slots=True)
class RowGroup:
    """Rows that can be left out together while none of them binds."""

    rows: NDArray[np.intp]  # of A
    columns: NDArray[np.intp]  # slacks that only these rows use
    are_cones: bool = False


@dataclass(frozen=True, slots=True)
class InputLimits:
    """Bounds on the paper's u; the horizontal acceleration is bounded by the tilt."""

    tilt: float = math.pi / 10.0  # rad
    vertical: float = 3.0  # m/s^2, |a_z|
    yaw_acc: float = 0.1  # rad/s^2; the rotors' drag gives hardly more
    joint_acc: float = 10.0  # rad/s^2


@dataclass(frozen=True, slots=True)
class SlackPrice:
    """Cost of softening a block: ``linear s + quadratic s^2``.

    The linear part makes the penalty exact: rows that can hold, do hold. A block without
    a price is hard.
    """

    linear: float
    quadratic: float = 0.1


class Program:
    """Assembles the program; owns its arrays."""

    def __init__(
        self,
        horizon: int,
        limits: InputLimits,
        blocks: tuple[tuple[SoftRows, SlackPrice | None], ...],
    ) -> None:
        self._blocks = tuple(rows for rows, _ in blocks)
        self._slack_counts = [rows.slacks if price is not None else 0 for rows, price in blocks]
        self.inputs = INPUTS * horizon
        slacks = self._slack_counts
        self.unknowns = self.inputs + sum(slacks)
        soft = sum(len(rows.node) for rows in self._blocks)
        self.soft_rows = soft
        bounded = np.flatnonzero(np.tile(np.arange(INPUTS) >= 2, horizon))
        bound = np.tile([limits.vertical, limits.yaw_acc, *[limits.joint_acc] * 2], horizon)
        nonnegative_rows = soft + sum(slacks) + 2 * len(bounded)
        self.groups = (*self._soft_groups(soft), *_input_groups(soft + sum(slacks), horizon))

        pattern = _Pattern(self.unknowns)
        slack_column = self.inputs
        for rows, count in zip(self._blocks, slacks, strict=True):
            pattern.block(rows, slack_column if count else None)
            slack_column += count
        pattern.signed_rows(np.arange(self.inputs, self.unknowns), -1.0)  # -s <= 0
        pattern.signed_rows(bounded, 1.0)
        pattern.signed_rows(bounded, -1.0)
        slope = math.tan(limits.tilt)
        for node in range(horizon):
            for axis, coefficient in ((2, slope), (0, -1.0), (1, -1.0)):
                pattern.signed_rows(np.array([INPUTS * node + axis]), coefficient)
        a, self._soft_at, self._soft_from = pattern.finish()
        b = np.concatenate(
            (
                np.zeros(soft + sum(slacks)),
                bound,
                bound,
                np.tile([slope * GRAVITY, 0.0, 0.0], horizon),
            )
        )

        upper = np.triu(np.ones((self.inputs, self.inputs), dtype=bool))
        p_pattern = np.zeros((self.unknowns, self.unknowns), dtype=bool)
        p_pattern[: self.inputs, : self.inputs] = upper
        p_pattern[range(self.inputs, self.unknowns), range(self.inputs, self.unknowns)] = True
        p = sparse.csc_matrix(p_pattern.astype(float))
        columns = np.repeat(np.arange(self.unknowns), np.diff(p.indptr))
        in_inputs = columns < self.inputs
        self._p_at = np.flatnonzero(in_inputs)
        self._p_from = p.indices[in_inputs] * self.inputs + columns[in_inputs]
        q = np.zeros(self.unknowns)
        priced = [(rows.slacks, price) for rows, price in blocks if price is not None]
        q[self.inputs :] = np.concatenate([np.full(n, price.linear) for n, price in priced])
        p.data[~in_inputs] = np.concatenate(
            [np.full(n, 2.0 * price.quadratic) for n, price in priced]
        )
        self.whole = QuadraticProgram(p, q, a, b, soft, nonnegative_rows, horizon)
        self.hessian = np.zeros((self.inputs, self.inputs))
        self._gradient = np.zeros((soft, self.inputs))

    def refill(self, guess: Array, gradient: Array) -> None:
        """Bring P, q, A and b up to date with ``hessian`` and the soft blocks.

        Args:
            guess: Inputs around which the blocks are linearised, (6 n,).
            gradient: Linear cost term in the inputs, (6 n,).
        """
        whole = self.whole
        whole.p.data[self._p_at] = self.hessian.take(self._p_from)
        whole.q[: self.inputs] = gradient
        row = 0
        for block in self._blocks:
            end = row + len(block.node)
            self._gradient[row:end] = block.gradient
            # A carries -gradient and -1 for the slack, so b is value at U = 0 minus required.
            whole.b[row:end] = block.value - block.gradient @ guess - block.required
            row = end
        whole.a.data[self._soft_at] = -self._gradient.take(self._soft_from)

    def _soft_groups(self, soft_rows: int) -> list[RowGroup]:
        """A group for each group of each block, with the slacks it alone uses."""
        groups = []
        row, slack = 0, 0
        for block, count in zip(self._blocks, self._slack_counts, strict=True):
            numbers = np.zeros(len(block.node), dtype=int) if block.group is None else block.group
            for number in np.unique(numbers):
                members = np.flatnonzero(numbers == number)
                own = slack + np.unique(block.slack[members]) if count else np.zeros(0, dtype=int)
                rows = np.concatenate((row + members, soft_rows + own))
                groups.append(RowGroup(rows, self.inputs + own))
            row, slack = row + len(block.node), slack + count
        return groups


def _input_groups(first_bound: int, horizon: int) -> tuple[RowGroup, RowGroup]:
    """Bounds that hardly ever bind, and the tilt cones; yaw's bounds bind often and stay."""
    bounds = np.arange(8 * horizon)  # upper then lower, (vertical, yaw, joint 1, joint 2) a node
    cones = first_bound + len(bounds) + np.arange(3 * horizon)
    none = np.zeros(0, dtype=int)
    return (
        RowGroup(first_bound + bounds[bounds % 4 != 1], none),
        RowGroup(cones, none, are_cones=True),
    )


class _Pattern:
    """Collects the structural entries of A row by row and sorts them into CSC once."""

    def __init__(self, unknowns: int) -> None:
        self._unknowns = unknowns
        self._rows: list[NDArray[np.intp]] = []
        self._columns: list[NDArray[np.intp]] = []
        self._values: list[Array] = []
        self._sources: list[NDArray[np.intp]] = []  # index into the stacked gradients, or -1
        self._next_row = 0
        self._gradient_size = 0

    def block(self, block: SoftRows, slack_column: int | None) -> None:
        """Rows -gradient U - slack <= ..., gradients to be filled later; no slack: hard."""
        row, column = np.nonzero(block.feels())
        self._add(
            self._next_row + row,
            column,
            np.zeros(len(row)),
            self._gradient_size + row * block.unknowns + column,
        )
        rows = np.arange(len(block.node))
        if slack_column is not None:
            self._add(self._next_row + rows, slack_column + block.slack, np.full(len(rows), -1.0))
        self._next_row += len(rows)
        self._gradient_size += len(rows) * block.unknowns

    def signed_rows(self, columns: NDArray[np.intp], coefficient: float) -> None:
        """One row a column, with one constant entry."""
        rows = self._next_row + np.arange(len(columns))
        self._add(rows, columns, np.full(len(columns), coefficient))
        self._next_row += len(columns)

    def _add(
        self,
        rows: NDArray[np.intp],
        columns: NDArray[np.intp],
        values: Array,
        sources: NDArray[np.intp] | None = None,
    ) -> None:
        self._rows.append(rows)
        self._columns.append(columns)
        self._values.append(values)
        self._sources.append(np.full(len(rows), -1) if sources is None else sources)

    def finish(self) -> tuple[sparse.csc_matrix, NDArray[np.intp], NDArray[np.intp]]:
        """A, the places of the soft gradients in A.data, and where each comes from."""
        rows, columns = np.concatenate(self._rows), np.concatenate(self._columns)
        order = np.lexsort((rows, columns))
        pointer = np.concatenate(([0], np.cumsum(np.bincount(columns, minlength=self._unknowns))))
        a = sparse.csc_matrix(
            (np.concatenate(self._values)[order], rows[order], pointer),
            shape=(self._next_row, self._unknowns),
        )
        sources = np.concatenate(self._sources)[order]
        places = np.flatnonzero(sources >= 0)
        return a, places, sources[places]
