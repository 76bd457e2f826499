"""Covariance of a dead-reckoned pose: error propagation over the odometry's updates.

The motion model, its Jacobians and the error model are from Siegwart and Nourbakhsh, Introduction
to Autonomous Mobile Robots, section 5.2.4.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..arguments import number
from ..errors import InvalidArgument
from .odometry import OdometryUpdate

Matrix = npt.NDArray[np.float64]

ROLL_OUT = 0.3
"""How much further one wheel may roll out than the other after a reset, as a share."""


class PoseCovariance:
    """The covariance of (x, y, heading), in m and rad, since the last reset.

    Each wheel's travel has an independent error, whose variance grows with the distance.

    Args:
        left_variance_m: Variance of the left wheel's travel per metre travelled. [m^2/m]
        right_variance_m: The same for the right wheel. [m^2/m]
    """

    def __init__(self, left_variance_m: float, right_variance_m: float) -> None:
        right = number("right_variance_m", right_variance_m, 0.0, math.inf, InvalidArgument)
        left = number("left_variance_m", left_variance_m, 0.0, math.inf, InvalidArgument)
        self._variances_m = np.array([right, left])
        self.matrix: Matrix = np.zeros((3, 3))

    def update(self, update: OdometryUpdate, wheel_separation: float) -> Matrix:
        """Propagate over one update of the odometry; returns the new matrix, 3 by 3.

        `P <- F_p P F_p' + F_d S F_d'`, with `S = diag(k_r |ds_r|, k_l |ds_l|)`. Across a reset of
        the device the pose stays, and S is of what may have been driven unseen: the wheels stopped
        at the same time, sooner or later, and each rolled out a little differently.
        """
        heading = update.pose.heading_rad
        if update.rebased:
            unseen_m = np.array([update.unseen_right_m, update.unseen_left_m])
            distance = float(unseen_m.sum()) / 2
            turn = float(unseen_m[0] - unseen_m[1]) / wheel_separation
            # The pose has not moved, so it is still at the beginning of the unseen arc.
            by_travel = _by_travel(heading + turn / 2, distance, wheel_separation)
            # Correlated, since both wheels stopped at the same time; the diagonal is the roll-out.
            errors = np.outer(unseen_m, unseen_m) + np.diag((ROLL_OUT * unseen_m) ** 2)
            # The arc may end anywhere between its two ends, which the Jacobian takes for a line.
            bent = (distance * turn / 4) ** 2 * np.diag([1.0, 1.0, 0.0])
            self.matrix = self.matrix + by_travel @ errors @ by_travel.T + bent
            return self.matrix
        distance, turn = update.distance_m, update.turn_rad
        if not (distance or turn):
            return self.matrix  # it stands
        # The pose is at the end of the arc.
        middle = heading - turn / 2
        cosine, sine = math.cos(middle), math.sin(middle)
        by_pose = np.array([[1, 0, -distance * sine], [0, 1, distance * cosine], [0, 0, 1.0]])
        half_turn_m = turn * wheel_separation / 2
        travel_m = np.abs([distance + half_turn_m, distance - half_turn_m])  # right, left
        by_travel = _by_travel(middle, distance, wheel_separation)
        # F_d S: S is diagonal, so it scales the columns.
        spread = by_travel * (self._variances_m * travel_m)
        self.matrix = by_pose @ self.matrix @ by_pose.T + spread @ by_travel.T
        return self.matrix

    def reset(self) -> None:
        """Reset the covariance to zero."""
        self.matrix = np.zeros((3, 3))


def _by_travel(heading_rad: float, distance_m: float, wheel_separation: float) -> Matrix:
    """The Jacobian of the pose by the travel of the right and the left wheel, 3 by 2.

    Args:
        heading_rad: In the middle of the arc.
        distance_m: Length of the arc.
        wheel_separation: [m]
    """
    cosine, sine = math.cos(heading_rad), math.sin(heading_rad)
    across = distance_m / (2 * wheel_separation)
    return np.array(
        [
            [cosine / 2 - across * sine, cosine / 2 + across * sine],
            [sine / 2 + across * cosine, sine / 2 - across * cosine],
            [1 / wheel_separation, -1 / wheel_separation],
        ]
    )
