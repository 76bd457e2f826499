"""A filter of robot_localization's kind, as `config/ekf.yaml` sets it up, without an IMU.

As robot_localization 3.6.0 (branch ros2, commit 1cb95337): process noise and first covariance are
those of `src/filter_base.cpp`, the motion model of `src/ekf.cpp`; `integrateMeasurements` of
`src/ros_filter.cpp` goes on by prediction alone once no measurement came for `sensor_timeout`.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from typing import Any

import numpy as np
import numpy.typing as npt
from nav_msgs.msg import Odometry

from support.ros import Graph

X, Y, YAW, VX, VY, VYAW, AX, AY = range(8)
PROCESS_NOISE = np.diag([0.05, 0.05, 0.06, 0.025, 0.025, 0.02, 0.01, 0.01])
"""Per second."""
FIRST_VARIANCE = 1e-9
SENSOR_TIMEOUT_S = 0.1
FREQUENCY_HZ = 50.0
MEASURED = {VX: 0, VY: 7, VYAW: 35}
"""What is fused, and where its variance stands in a twist's covariance."""


class Filter:
    """The filter alone; times are in seconds on one clock."""

    def __init__(self) -> None:
        self.state: npt.NDArray[np.float64] = np.zeros(8)
        self._covariance = np.eye(8) * FIRST_VARIANCE
        self._stamp_s: float | None = None

    def update(self, message: Any) -> None:
        """Predict up to a message of odom, and correct by its twist."""
        stamp_s = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
        # One from before the last prediction only corrects, as `processMeasurement` has it.
        if self._stamp_s is not None and stamp_s > self._stamp_s:
            self._predict(stamp_s - self._stamp_s)
        self._stamp_s = max(stamp_s, self._stamp_s or stamp_s)
        twist = message.twist.twist
        for which, value in ((VX, twist.linear.x), (VY, twist.linear.y), (VYAW, twist.angular.z)):
            variance = message.twist.covariance[MEASURED[which]]
            gain = self._covariance[:, which] / (self._covariance[which, which] + variance)
            self.state = self.state + gain * (value - self.state[which])
            self._covariance = self._covariance - np.outer(gain, self._covariance[which])

    def go_on(self, now_s: float) -> None:
        """Predict up to now if no measurement came for a while."""
        if self._stamp_s is not None and now_s - self._stamp_s >= SENSOR_TIMEOUT_S:
            self._predict(now_s - self._stamp_s)
            self._stamp_s = now_s

    def _predict(self, step_s: float) -> None:
        _, _, yaw, vx, vy, _, ax, ay = self.state
        cos, sin = math.cos(yaw), math.sin(yaw)
        far = 0.5 * step_s * step_s
        step = np.eye(8)
        step[X, [VX, VY, AX, AY]] = cos * step_s, -sin * step_s, cos * far, -sin * far
        step[Y, [VX, VY, AX, AY]] = sin * step_s, cos * step_s, sin * far, cos * far
        step[YAW, VYAW] = step[VX, AX] = step[VY, AY] = step_s
        jacobian = step.copy()
        dx, dy = vx * step_s + ax * far, vy * step_s + ay * far
        jacobian[X, YAW], jacobian[Y, YAW] = -sin * dx - cos * dy, cos * dx - sin * dy
        self.state = step @ self.state
        self._covariance = jacobian @ self._covariance @ jacobian.T + PROCESS_NOISE * step_s


class FilterNode:
    """The filter on a graph, fed by odom."""

    def __init__(self, graph: Graph) -> None:
        self._filter = Filter()
        self._node = graph.node
        self._lock = threading.Lock()
        self._waiting: deque[Any] = deque()
        self._node.create_subscription(Odometry, "odom", lambda m: self._waiting.append(m), 100)
        self._timer = self._node.create_timer(1 / FREQUENCY_HZ, self._step)

    def _step(self) -> None:
        with self._lock:
            if not self._waiting:
                self._filter.go_on(self._node.get_clock().now().nanoseconds / 1e9)
            while self._waiting:
                self._filter.update(self._waiting.popleft())

    @property
    def place(self) -> tuple[float, float, float]:
        """x, y and heading."""
        with self._lock:
            x_m, y_m, heading_rad = self._filter.state[[X, Y, YAW]]
            return float(x_m), float(y_m), float(heading_rad)
