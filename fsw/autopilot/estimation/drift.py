r"""The frame of an odometry that drifts: how far it has moved since it was the true one.

Odometry states a variance that grows as it travels, and falls when it recognises a place. What has
grown is no noise: it stays from one pose to the next, and no number of poses takes it away. So the
filter follows the vehicle in the odometry's frame, with the noise alone. The frame's own error

.. math:: f = (b, \psi), \qquad p' = R_z(\psi)\, p + b

cannot be measured. It is considered (Schmidt): its variance D and its covariance X with the
filter's error are kept beside the filter, and the error in the world is the filter's minus L f:

.. math:: P_{world} = P - X L^T - L X^T + L D L^T, \qquad
          L = \begin{pmatrix} I & \hat z \times p \\ 0 & \hat z \times v \\ 0 & R^T \hat z
              \end{pmatrix}

When the frame moves by a little, the vehicle moves below the filter: P, X and D grow by
:math:`L Q L^T`, :math:`L Q` and Q. When it jumps, its old error is forgotten.

Source: S. F. Schmidt, Application of State-Space Methods to Navigation Problems, Advances in
Control Systems 3 (1966) 293; docs/decisions/0030-an-estimate-of-the-present.md.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from fsw.autopilot.estimation.error_state import ERRORS, FRAME, TH, Array, P, V
from fsw.autopilot.geometry.rotation import matrix_from_quaternion
from fsw.autopilot.signals import Vec3

_NEVER: Final[Vec3] = (math.inf, math.inf, math.inf)
_STILL: Final = np.zeros(FRAME)


class FrameDrift(NamedTuple):
    """What is known of an odometry's frame; X is in the filter, which carries it on."""

    place_noise: Vec3 = _NEVER  # m^2, NED: the smallest variance stated so far
    attitude_noise: Vec3 = _NEVER  # rad^2, roll, pitch, yaw
    variance: Array = _STILL  # (4,) D: m^2, NED, and rad^2 of the heading; never changed in place

    @classmethod
    def at_start(cls, x: Any, noise: tuple[Vec3, Vec3], stated: tuple[Vec3, Vec3]) -> FrameDrift:
        """The frame in which a filter ``x`` has just begun, at a pose.

        Its variances ``stated`` are [m^2, NED] and [rad^2, FRD]; what is more than ``noise`` [as
        they] is the frame's, of which the filter knows nothing yet.
        """
        x["drifts"] = 1
        return cls(*noise, _of_frame(noise, stated, _levers(x)))

    def moved(self, x: Any, stated: tuple[Vec3, Vec3], jumped: bool) -> FrameDrift:
        """The frame at the next pose; lets the covariances of the filter ``x`` grow.

        The pose's variances ``stated`` are [m^2, NED] and [rad^2, FRD].
        """
        noise = least((self.place_noise, self.attitude_noise), stated)
        levers = _levers(x)
        variance = _of_frame(noise, stated, levers)
        M, shared = x["covariance"], x["shared"]
        if jumped:
            M[:] = self.in_world(M, shared, x)
            shared[:] = 0.0
            grown = variance
        else:
            grown = np.maximum(variance - self.variance, 0.0)
            # Of a frame that is better known by itself, the filter knows as much better.
            share = np.divide(
                variance, self.variance, out=np.ones(FRAME), where=self.variance > 0.0
            )
            shared *= np.minimum(share, 1.0)
        M += (levers * grown) @ levers.T
        shared += levers * grown
        x["drifts"] = 1
        return FrameDrift(*noise, variance)

    def in_world(self, covariance: Array, shared: Array, x: Any) -> Array:
        """A ``covariance`` (17, 17) [SI] and the ``shared`` one (17, 4) [SI] as one in the world.

        They are of the state of the filter ``x``.
        """
        levers = _levers(x)
        both = shared @ levers.T
        found: Array = covariance - both - both.T + (levers * self.variance) @ levers.T
        return found


def _levers(x: Any) -> Array:
    """L (17, 4): what the frame's error makes of a state's."""
    levers = np.zeros((ERRORS, FRAME))
    levers[P : P + 3, :3] = np.eye(3)
    levers[P, 3], levers[P + 1, 3] = -x["p"][1], x["p"][0]
    levers[V, 3], levers[V + 1, 3] = -x["v"][1], x["v"][0]
    w, i, j, k = x["q"].tolist()
    levers[TH : TH + 3, 3] = matrix_from_quaternion((w, i, j, k))[6:]
    return levers


def _of_frame(noise: tuple[Vec3, Vec3], stated: tuple[Vec3, Vec3], levers: Array) -> Array:
    """D (4,) of variances that are stated at a place with these ``levers``, without their noise."""
    heading = stated[1][2] - noise[1][2]
    variance = np.array([*np.subtract(stated[0], noise[0]), heading])
    # What is stated holds at this place, and the turned frame has a share in it.
    variance[:3] = np.maximum(variance[:3] - heading * levers[P : P + 3, 3] ** 2, 0.0)
    return variance


def least(a: tuple[Vec3, Vec3], b: tuple[Vec3, Vec3]) -> tuple[Vec3, Vec3]:
    """The smaller ones of two poses' variances, [m^2, NED] and [rad^2, FRD]."""
    return _least(a[0], b[0]), _least(a[1], b[1])


def _least(a: Vec3, b: Vec3) -> Vec3:
    return min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2])
