r"""Clearances that grow with what the estimator does not know.

A point of the vehicle at :math:`\ell` from the base is where the estimate says but for
:math:`\delta p + \phi\times\ell`, with the attitude's error :math:`\phi` in the world. Along a
zone's normal n its standard deviation is

.. math:: \sigma^2 = g^T P g, \qquad g = (n, \ell\times n),

P being the covariance of position and attitude. The planner keeps each zone's clearance and k
sigma of the base or the end-effector, whichever is less certain. So a vehicle whose pose is lost
draws back from walls by itself.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fsw.estimation.error_state import TH, Array, P
from fsw.geometry.vectors import subtract
from fsw.model.kinematics import point_in_flight
from fsw.shapes.zones import surfaces
from fsw.signals import SafeSet, StateEstimate, Vec2

_STEP = 1e-3  # m; what is less uncertain than a step more is the same safe set, laid out once
_MOST = 0.5  # m; a room that is lost altogether is none to plan in


def widened(
    safe_set: SafeSet, estimate: StateEstimate, covariance: Array, sigmas: float, links: Vec2
) -> SafeSet:
    """A safe set whose clearances are ``sigmas`` [1] standard deviations larger.

    The ``covariance`` (17, 17) [SI] is of the error of the estimate; the arm has ``links`` [m]. A
    zone that follows the target comes along with it and stays as it is.
    """
    pose = _pose_covariance(covariance, estimate)
    tip = point_in_flight(estimate, links)[0]
    places = (estimate.p_WB, tip)
    zones = []
    for zone in safe_set.zones:
        alone, most = SafeSet((zone,)), 0.0
        for place in places:
            for at in surfaces(alone, place, estimate.t_us):
                lever = np.cross(subtract(place, estimate.p_WB), at.normal)
                g = np.concatenate([at.normal, lever])
                most = max(most, float(g @ pose @ g))
        more = min(sigmas * math.sqrt(most), _MOST)
        zones.append(replace(zone, clearance=zone.clearance + math.ceil(more / _STEP) * _STEP))
    return SafeSet(tuple(zones))


def _pose_covariance(covariance: Array, estimate: StateEstimate) -> Array:
    """Covariance (6, 6) of position [m, NED] and attitude [rad, NED]."""
    turn = np.eye(6)
    turn[3:, 3:] = np.reshape(estimate.R_WB, (3, 3))
    kept = [P, P + 1, P + 2, TH, TH + 1, TH + 2]
    found: Array = turn @ covariance[np.ix_(kept, kept)] @ turn.T
    return found
