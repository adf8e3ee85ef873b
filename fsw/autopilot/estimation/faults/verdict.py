r"""Who is wrong, of all residuals: the one without whom the others agree.

Of a culprit X all residuals with X are large and all others are not, so

.. math:: J(X) = \sum_{k \not\ni X} \min(r_k / t_k, 5)^2, \quad
          t_k = \text{the largest that is nominal},

is least for the culprit. It is named where by how much more the next hypothesis costs adds up to 3,
in looks in a row in which that is more than 1. Until then all that are not excluded are suspects:
the filter takes their biases for unknown.

Source: ``residuals.py``; docs/decisions/0041-one-law-for-who-is-wrong.md.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from fsw.autopilot.estimation.faults.residuals import CONTAINED, Evidence, pose_stands
from fsw.autopilot.estimation.faults.sources import (
    AA,
    AM,
    AN,
    AP,
    COUNT,
    GB,
    GM,
    GP,
    MB,
    MN,
    MP_FORCE,
    MP_TURN,
    NOBODY,
    OF,
    A,
    B,
    G,
    M,
    P,
    Q,
    Source,
)
from fsw.autopilot.signals import Vec2

_LEAD: Final = 1.0
_DISTURBED: Final = 0.6  # by so much less a disturbed field costs: there is iron everywhere
_MOST: Final = 25.0  # of one residual
_OF_PLACES: Final = (AP, MP_FORCE)
_TURN: Final = G | Q
_TIPPED: Final = 1.0  # s without a difference in tilt, after which it is not contested any more
_TILTED: Final = 1.5  # m/s^2, that a pose shows whose attitude is off by 0.15 rad
# What is off shows at once in the first, while the trial is this young [s], and in others later.
_SHOWN: Final = {G: (GM, (GP, GB)), A: (AM, (AP, AN))}
_SHOWS: Final = 1.5
# What contradicts rotors in the first contradicts the inertial unit in the second as much, over the
# same time and with the same noise: unless it does, it is the rotors that are off, by a push.
_SHOWN_TOO: Final = ((MP_FORCE, AP), (MN, AN), (MP_TURN, GP), (MB, GB))
_SURE: Final = 3.0  # sum of leads
_QUIET: Final = 0.3  # s without a residual that fires, until a trial is over
_STAYS: Final = 0.7  # of its threshold, down to which what has fired has not ended
_NEARLY: Final = 0.4  # of its threshold, from which on an attitude may explain what is felt
_AGREES: Final = 5.0  # s of agreement, until what was named is believed again
# By so much faster down the vehicle may go than the rotors make it: at once, and in each second.
_GAINED: Final = 0.4  # m/s
_MODEL_OFF: Final = 0.1  # m/s^2
UNDECIDED: Final = 2.0  # s, after which suspects are not told apart any more


class Verdict(NamedTuple):
    """What is known of who is wrong; times are in seconds."""

    evidence: Evidence | None = None
    since: float = -1.0  # of the trial that is on; -1: none
    fired: float = -math.inf  # when a residual did last
    shown: frozenset[int] = frozenset()  # which have in this trial
    suspects: Source = NOBODY
    # By how much the biases of accelerometer [m/s^2] and gyro [rad/s] were unknown in this trial.
    unknown: Vec2 = (0.0, 0.0)
    explained: bool = False  # in this trial the rotors' model was named
    leader: Source = NOBODY  # the one that is named once that is sure
    sum: float = 0.0  # of its leads
    wrong: Source = NOBODY  # not used
    agreed: tuple[float, ...] = (-math.inf,) * len(Source)  # since when each of them agrees again
    named: Source = NOBODY  # by the last look
    seen: tuple[object, ...] = (None, None, None)  # the last samples of pose, satellites, compass
    # When something measured the height last, and what the estimate's velocity [m/s] and place [m]
    # down were then, less the integrals of what the rotors make.
    measured: float = -1.0
    seen_down: Vec2 = (0.0, 0.0)

    @property
    def is_on(self) -> bool:
        """Whether sensors, or one and the rotors' model, contradict each other."""
        return self.since >= 0.0

    @property
    def contested(self) -> bool:
        """Whether gyro and poses that come seldom contradict each other on the tilt, and none else.

        Neither is asked for it then: places and what is felt tell it. Poses that come often are:
        their places show at once where the attitude leads astray, and the pose is named for it.
        """
        if not self.suspects or self.evidence is None:  # as nearly always
            return False
        if self.suspects & _TURN != _TURN or self.suspects & ~(_TURN | B):
            return False
        known = self.evidence[0]
        return bool(known["looked"] - known["tipped"] < _TIPPED)

    def acquitted(self) -> Verdict:
        """The verdict after the trial is over."""
        return self._replace(
            since=-1.0,
            shown=frozenset(),
            suspects=NOBODY,
            unknown=(0.0, 0.0),
            explained=False,
            leader=NOBODY,
            sum=0.0,
            named=NOBODY,
        )

    def on_ground(self, now: float) -> Verdict:
        """The verdict at ``now`` [s] on the ground, where nothing is compared.

        What was named is believed again after as long as if it agreed: its own checks are left.
        """
        agreed = tuple([now if since == math.inf else since for since in self.agreed])
        wrong = self.wrong
        for one, since in zip(Source, agreed, strict=True):
            if now - since >= _AGREES:
                wrong &= ~one
        return self._replace(wrong=wrong, agreed=agreed)

    @property
    def contradicts(self) -> bool:
        """Whether that is so, and not because the rotors do not give what the model says."""
        return self.is_on and self.suspects not in (NOBODY, Source.MODEL)


def judged(
    verdict: Verdict,
    ratios: tuple[float, ...],
    now: float,
    *,
    holds_attitude: bool,
    lost: Source = NOBODY,
    damaged: bool = False,
    sizes: tuple[float, ...] = (0.0,) * COUNT,
    headed: tuple[float, ...] = (math.inf,) * COUNT,
    unheard: tuple[float, ...] = (0.0,) * COUNT,
) -> Verdict:
    """The verdict after the ``ratios`` of all residuals over their thresholds at ``now`` [s].

    Their ``sizes`` are in SI, and so is what a heading that is wrong makes of each at most
    (``headed``). Where nothing that is used ``holds_attitude``, gyro and magnetometer do. What is
    ``lost`` says nothing, and is known to be of no use without this law; ``unheard`` are ratios in
    windows with such a silence. Of a ``damaged`` vehicle it is known that the rotors' model is off.
    """
    headings = [k for k in range(COUNT) if sizes[k] <= headed[k]]
    unused = verdict.wrong | (Q if verdict.contested else NOBODY)
    of = _sources(holds_attitude, unused, headings)
    # Where a pose holds the attitude, or has, a bias that is found with it is as much the pose's;
    # one that was taken for unknown in this trial is whatever the suspects made of it.
    found = holds_attitude or unused & Q or any(verdict.unknown)
    known = range(AA if found else COUNT)
    used = [k for k in known if not of[k] & (verdict.wrong | lost)]
    fires = [k for k in used if ratios[k] > 1.0]
    verdict = _with_return(verdict, ratios, of, now, lost)
    if not fires:
        # What is heard in short windows only, after a silence, acquits nobody.
        seen = [max(ratios[k], unheard[k]) for k in verdict.shown.intersection(used)]
        if max(seen, default=0.0) > _STAYS:
            verdict = verdict._replace(fired=now)
        elif verdict.is_on and now - verdict.fired > _QUIET:
            return verdict.acquitted()
        return verdict._replace(leader=NOBODY, sum=0.0, named=NOBODY)
    gone, young = verdict.wrong | lost, not verdict.is_on or now - verdict.since < _SHOWS
    young = young and now - _silent_at(verdict.evidence) >= CONTAINED[3]
    # Rotors that are known to be off say nothing of who else is wrong.
    explained = verdict.explained or damaged
    beside = [k for k in fires if not of[k] & M] if explained else []
    if beside:
        gone, fires, used = gone | M, beside, [k for k in used if not of[k] & M]
    cost = _costs(ratios, sizes, of, used, gone, young)
    first, *others = sorted(cost, key=cost.__getitem__)
    lead = cost[others[0]] - cost[first] if others else math.inf
    suspects = NOBODY
    for one in cost:
        # Of a bias that is too large the filter knows already.
        if cost[one] - cost[first] < _LEAD and fires[0] < AA:
            suspects |= one
    leader = first if lead > _LEAD else NOBODY
    total = lead if leader else 0.0
    if leader and leader is verdict.leader:
        total += verdict.sum
    named = leader if total > _SURE else NOBODY
    if named is Q and verdict.evidence is not None and pose_stands(verdict.evidence):
        named = P
    # What the rotors have been named for shows in some windows for longer than in others.
    explained = explained or named is M
    verdict = verdict._replace(
        since=verdict.since if verdict.is_on else now,
        fired=now,
        shown=verdict.shown.union(fires),
        suspects=M if explained and not beside else suspects,
        explained=explained,
        leader=leader,
        sum=total,
        named=named,
    )
    return verdict if not named or named is M else _convicted(verdict, named)


def lifted(verdict: Verdict, down: Vec2, now: float, *, told: bool) -> Verdict:
    """The verdict at ``now`` [s] on an accelerometer that says that the vehicle sinks.

    Who believes one that is wrong climbs for ever, and one that is right lands all the same: while
    nothing measures the height, rotors that say otherwise are right. The other way round the ground
    may carry the vehicle. Velocity and place of the estimate are ``down`` [m/s, m, NED] of the
    integrals of what rotors make. Nothing follows where the height, or that one of both is off, is
    ``told``.
    """
    told = told or verdict.explained or bool(verdict.wrong & A)
    if told or verdict.measured < 0.0:
        return verdict._replace(seen_down=down, measured=now)
    gained, since = down[0] - verdict.seen_down[0], now - verdict.measured
    return _convicted(verdict, A) if gained > _GAINED + _MODEL_OFF * since else verdict


def _convicted(verdict: Verdict, named: Source) -> Verdict:
    agreed = list(verdict.agreed)
    agreed[list(Source).index(named)] = math.inf
    convicted = verdict._replace(wrong=verdict.wrong | named, agreed=tuple(agreed))
    return convicted.acquitted()._replace(named=named)


def _silent_at(evidence: Evidence | None) -> float:
    """When what shows a change at once, the unit or the rotors, was silent last [s]."""
    if evidence is None:
        return -math.inf
    silent: list[float] = evidence[0]["silent"].tolist()
    return max(at for one, at in zip(Source, silent, strict=True) if one & (G | A | M))


def _costs(
    ratios: tuple[float, ...],
    sizes: tuple[float, ...],
    of: tuple[Source, ...],
    used: list[int],
    gone: Source,
    young: bool,
) -> dict[Source, float]:
    """What each hypothesis costs, of a trial that is ``young`` or not."""
    cost = {}
    for one in Source:
        if one & gone or not any(of[k] & one and ratios[k] > 0.0 for k in used):
            continue
        left = [k for k in used if not of[k] & one]
        if one is Q:
            # The filter has turned what is felt by it for as long as it agreed.
            left = [k for k in left if k not in _OF_PLACES or sizes[k] > _TILTED]
        cost[one] = sum(min(ratios[k] ** 2, _MOST) for k in left)
        cost[one] -= _DISTURBED if one is B else 0.0
        cost[one] += _not_shown(one, ratios, sizes, used) if young else 0.0
        cost[one] += _of_rotors_alone(one, ratios, of, used)
    # A pose that tilts slowly shows by what is felt first, and its place need not be lost for that.
    if not any(ratios[k] > _NEARLY for k in used if of[k] & Q):
        cost.pop(Q, None)
    if P in cost and cost.get(Q, math.inf) - cost[P] < _LEAD:
        del cost[P]  # nothing contradicts its place
    return cost


def _not_shown(
    one: Source, ratios: tuple[float, ...], sizes: tuple[float, ...], used: list[int]
) -> float:
    """What it costs that a half of the unit is off by more than it differs from the rotors."""
    at_once, others = _SHOWN.get(one, (GM, ()))
    fired = [sizes[k] for k in others if k in used and ratios[k] > 1.0]
    if not fired or at_once not in used or not sizes[at_once] > 0.0:
        return 0.0
    threshold = sizes[at_once] / ratios[at_once]
    unseen = max(max(fired) - sizes[at_once], 0.0)
    return min((unseen / threshold) ** 2, _MOST)


def _of_rotors_alone(
    one: Source, ratios: tuple[float, ...], of: tuple[Source, ...], used: list[int]
) -> float:
    """What it costs that what contradicts rotors agrees with the inertial unit."""
    cost = 0.0
    for k, other in _SHOWN_TOO:
        alone = k in used and other in used and ratios[k] > 1.0 >= ratios[other] > 0.0
        if alone and one is not M:
            cost += _SURE * (1.0 - ratios[other]) + (ratios[k] ** 2 if of[k] & one else 0.0)
    return cost


def _sources(holds_attitude: bool, wrong: Source, headings: list[int]) -> tuple[Source, ...]:
    """Who each residual is of; ``headings`` are those that a heading may explain."""
    if holds_attitude:
        return OF
    # A magnetometer that is used turns the heading, and with it what is felt across.
    turned = (AN, MN, *(_OF_PLACES if wrong & Q else ()))
    turns = {k: G | (B & ~wrong if k in headings else NOBODY) for k in turned}
    return tuple([one | turns.get(k, NOBODY) for k, one in enumerate(OF)])


def _with_return(
    verdict: Verdict, ratios: tuple[float, ...], of: tuple[Source, ...], now: float, lost: Source
) -> Verdict:
    """The verdict with what was named and has agreed with all others for long believed again."""
    if not verdict.wrong:
        return verdict
    agreed, wrong = list(verdict.agreed), verdict.wrong
    for place, one in enumerate(Source):
        if not one & wrong:
            continue
        others = (wrong | lost) & ~one
        heard = [ratios[k] for k in range(COUNT) if of[k] & one and not of[k] & others]
        if max(heard, default=0.0) > 1.0 or not any(heard):
            agreed[place] = math.inf
        elif agreed[place] == math.inf:
            agreed[place] = now
        elif now - agreed[place] >= _AGREES:
            wrong &= ~one
    return verdict._replace(wrong=wrong, agreed=tuple(agreed))
