"""Intervals of what a fitted generalised Pareto tail says, from its likelihood.

An interval holds the values that some law has whose likelihood is not too far below the largest: a
profile likelihood. How far is the quantile of chi-square, times the mean that twice the fall has in
simulated tails, where it would be 1 if the tail were long (Bartlett, 1937). The share of the
flights that lie in the tail is not known either: it is one more number of the law.

A law is given by its shape and by the quotient of shape and scale. For a quotient the likelihood
depends on the sample through one mean alone, and the shapes that are likely enough are an interval
with ends in closed form. So the law is searched over the quotient and the share only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtri, lambertw

Array: TypeAlias = np.ndarray[Any, np.dtype[np.float64]]

MIN_SHAPE: Final = -1.0  # below, the likelihood has no maximum
_SPAN: Final = 12.0  # of the logarithm of how far the largest excess is from the end of the law
_STRAIGHT: Final = 1e-9  # a quotient [1/excess] below which the law is exponential
_PLACES: Final = 98  # that the maximum is looked for at; even, so that 0 is not one of them
_FINE: Final = (240, 25)  # quotients and shares that an interval is looked for at
_ROUGH: Final = (80, 21)  # the same of a fall
_WIDE: Final = 25.0  # a fall that hardly ever is


@dataclass(frozen=True, slots=True)
class Quantity:
    """Something that a law has.

    It rises with the shape, for any quotient and share; so the shape follows from it.
    """

    of: Callable[[Array, Array, Array], Array]  # shape, quotient, share
    shape: Callable[[float, Array, Array], Array]  # value, quotient, share; nan: no law has it


SHAPE: Final = Quantity(
    of=lambda shape, _, __: shape,
    shape=lambda value, quotient, _: np.where(value * quotient > 0.0, value, np.nan),
)
SCALE: Final = Quantity(
    of=lambda shape, quotient, _: shape / quotient,
    shape=lambda value, quotient, _: value * quotient,
)
END: Final[Literal["end"]] = "end"  # the largest excess that a law has; of the quotient alone


def depth(rare: float) -> Quantity:
    """The excess that a share ``rare`` of all flights is beyond [excess]."""
    return Quantity(
        of=lambda shape, quotient, share: np.expm1(shape * np.log(share / rare)) / quotient,
        shape=lambda value, quotient, share: _log1p(quotient * value) / np.log(share / rare),
    )


def beyond(excess: float) -> Quantity:
    """The share of all flights that are beyond an ``excess`` [excess]."""

    def of(shape: Array, quotient: Array, share: Array) -> Array:
        found: Array = share * np.exp(-_log1p(quotient * excess) / shape)
        return np.where(quotient * excess > -1.0, found, 0.0)

    def shape(value: float, quotient: Array, share: Array) -> Array:
        inside = quotient * excess > -1.0
        if value <= 0.0:  # of every law that ends before
            return np.where(inside, np.nan, -np.inf)
        return np.where(inside, -_log1p(quotient * excess) / np.log(value / share), np.nan)

    return Quantity(of, shape)


class Intervals:
    """Of the quantities of a fitted law, with what their likelihoods come to in simulated tails."""

    def __init__(
        self,
        excess: Array,
        total: int,
        law: tuple[float, float],
        confidence: float,
        simulated: Array,
        random: np.random.Generator,
    ) -> None:
        """Of the ``excess`` (n,) of a tail of ``total`` flights, fitted by shape and scale.

        The ``simulated`` tails (m, n) are of this law. Of each, the share of the flights is drawn
        that its threshold has below it in truth.
        """
        count = len(excess)
        shape, scale = law
        quotient = shape / scale
        if abs(quotient) < _STRAIGHT:
            shape, quotient = _STRAIGHT * scale, _STRAIGHT
        self._law = np.array(shape), np.array(quotient)
        self._share = count / total
        self._seen = Likelihood(excess, total)
        self._simulated = [Likelihood(one, total) for one in simulated]
        self._shares = random.beta(count + 1, total - count, len(simulated)).tolist()
        self._fall = float(chdtri(1, 1.0 - confidence))

    def of(self, quantity: Quantity | Literal["end"]) -> tuple[float, float, float]:
        """The value, and the two ends of its interval."""
        shape, quotient = self._law
        if quantity == "end":
            end = -1.0 / float(quotient)
            fall = self._fall * _mean([one.fall_of_end(end) for one in self._simulated])
            return end, *self._seen.interval_of_end(fall)
        value = float(quantity.of(shape, quotient, np.array(self._share)))
        times = self._times(quantity)
        if value == 0.0:
            # Nothing is beyond: simulated tails of such a law say little of how far others are.
            times = max(times, self._times(SHAPE))
        return value, *self._seen.interval(quantity, self._fall * times)

    def _times(self, quantity: Quantity) -> float:
        """By how much the fall of a quantity is more than that of a long tail."""
        shape, quotient = self._law
        return _mean(
            [
                one.fall(quantity, float(quantity.of(shape, quotient, np.array(share))))
                for one, share in zip(self._simulated, self._shares, strict=True)
            ]
        )


def _mean(falls: list[float]) -> float:
    """At least 1: no tail is longer than a long one."""
    return max(float(np.mean(falls)), 1.0)


def _log1p(x: Array) -> Array:
    """The logarithm of 1 + ``x``; nan where there is none."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(x > -1.0, np.log1p(x), np.nan)


class Likelihood:
    """How likely laws are after the excesses of a tail of ``total`` flights."""

    def __init__(self, excess: Array, total: int) -> None:
        self.count, self.total = len(excess), total
        self._excess, self._most = excess, float(excess.max())
        places = np.linspace(-_SPAN, _SPAN, _PLACES)
        ridge = self._ridge(self._quotients(places))
        best = int(np.argmax(ridge))
        near = np.linspace(places[max(best - 1, 0)], places[min(best + 1, _PLACES - 1)], _PLACES)
        fine = self._ridge(self._quotients(near))
        self._place, self.most = float(near[np.argmax(fine)]), float(fine.max())
        self._places, self._coarse = places, ridge

    def fall(self, quantity: Quantity, value: float) -> float:
        """By how much twice the logarithm of the likelihood falls if a ``value`` [1] is true."""
        quotients, shares = self._grid(_WIDE, _ROUGH)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            shape = quantity.shape(value, quotients, shares)
            mean = self._means(quotients[:, 0])[:, None]
            shape = np.where(np.isneginf(shape), np.maximum(mean, MIN_SHAPE), shape)
            ratio = shape / mean
            loss = self.count * (np.log(ratio) + 1.0 / ratio - 1.0)
            found = self._ridge_of(quotients[:, 0], mean[:, 0])[:, None] - loss
            found = np.where(shape >= MIN_SHAPE, found - self._loss(shares), np.nan)
        if np.isnan(found).all():
            return _WIDE
        return min(max(2.0 * (self.most - float(np.nanmax(found))), 0.0), _WIDE)

    def fall_of_end(self, end: float) -> float:
        """The same if the law ends at an excess ``end`` [excess]."""
        place = math.log1p(-self._most / end) if end > self._most else -_SPAN
        return max(
            2.0 * (self.most - float(self._ridge(self._quotients(np.array([place])))[0])), 0.0
        )

    def interval(self, quantity: Quantity, fall: float) -> tuple[float, float]:
        """The values of the laws whose likelihood falls by no more than ``fall`` [1]."""
        quotients, shares = self._grid(fall, _FINE)
        mean = self._means(quotients[:, 0])[:, None]
        spare = self._ridge_of(quotients[:, 0], mean[:, 0])[:, None] - self.most + 0.5 * fall
        spare = (spare - self._loss(shares)) / self.count
        ends = []
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            for branch in (0, -1):
                inverse = -lambertw(-np.exp(-1.0 - np.maximum(spare, 0.0)), branch).real
                shape = np.maximum(mean / inverse, MIN_SHAPE)
                possible = (spare >= 0.0) & ((shape > MIN_SHAPE) | (inverse <= -mean))
                ends.append(np.where(possible, quantity.of(shape, quotients, shares), np.nan))
        return float(np.nanmin(ends)), float(np.nanmax(ends))

    def interval_of_end(self, fall: float) -> tuple[float, float]:
        """The same, for a ``fall`` [1], of the excess where the law ends; infinite: it does not."""
        low, high = self._quotients(np.array(self._ends(fall)))
        return -1.0 / float(low), math.inf if high >= 0.0 else -1.0 / float(high)

    def _quotients(self, places: Array) -> Array:
        found: Array = np.expm1(places) / self._most
        return found

    def _means(self, quotients: Array) -> Array:
        """The most likely shape for each quotient."""
        found: Array = np.log1p(np.outer(quotients, self._excess)).mean(axis=1)
        return found

    def _ridge(self, quotients: Array) -> Array:
        return self._ridge_of(quotients, self._means(quotients))

    def _ridge_of(self, quotients: Array, means: Array) -> Array:
        """The logarithm of the likelihood for each quotient, at its most likely shape."""
        shape = np.maximum(means, MIN_SHAPE)
        found: Array = -self.count * (np.log(shape / quotients) + means * (1.0 + 1.0 / shape))
        return found

    def _loss(self, shares: Array) -> Array:
        """How much less likely a share of flights in the tail is than the one that was seen."""
        inside, outside = self.count, self.total - self.count
        found: Array = inside * np.log(inside / self.total / shares) + outside * np.log(
            outside / self.total / (1.0 - shares)
        )
        return found

    def _ends(self, fall: float) -> tuple[float, float]:
        """The least and the largest place of a quotient that is likely enough."""

        def spare(place: float) -> float:
            return float(self._ridge(self._quotients(np.array([place])))[0]) - least

        least = self.most - 0.5 * fall
        inside = np.flatnonzero(self._coarse >= least)
        first = float(self._places[inside[0]]) if len(inside) else self._place
        last = float(self._places[inside[-1]]) if len(inside) else self._place
        first, last = min(first, self._place), max(last, self._place)
        step = self._places[1] - self._places[0]
        out = []
        for place, side in ((first, -step), (last, step)):
            far = min(max(place + side, -_SPAN), _SPAN)
            out.append(float(brentq(spare, place, far)) if spare(far) < 0.0 else far)
        return out[0], out[1]

    def _grid(self, fall: float, size: tuple[int, int]) -> tuple[Array, Array]:
        """Quotients (n, 1) and shares (1, m) of all laws that are likely enough."""
        low, high = self._ends(fall)
        places = np.linspace(low, high, size[0])
        places = np.where(np.abs(places) < _STRAIGHT, _STRAIGHT, places)
        most = self.count / self.total

        def spare(share: float) -> float:
            return 0.5 * fall - float(self._loss(np.array(share)))

        ends = brentq(spare, most * 1e-6, most), brentq(spare, most, 1.0 - 1e-9)
        shares = np.linspace(*ends, size[1])
        return self._quotients(places)[:, None], shares[None, :]
