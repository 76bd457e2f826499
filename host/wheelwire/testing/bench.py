"""What a driver is tested on: a robot, simulated or with its wheels off the ground."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod

import pytest

from ..drivers.base import BaseDriver


class Bench(ABC):
    """A robot that the tests may drive at up to 0.4 m/s, each way and turning on the spot.

    Only `open` is asked of everybody. A test that needs one of the others is skipped where the
    bench cannot do it.
    """

    @abstractmethod
    def open(self) -> BaseDriver:
        """The driver under test; the tests shut it down."""

    def pass_time(self, seconds: float) -> None:
        """Let the robot's time pass without the driver being asked for anything."""
        time.sleep(seconds)

    def true_ticks(self) -> tuple[int, int]:
        """(left, right) that faultless encoders would have counted by now."""
        pytest.skip("this bench does not know the truth")

    def is_driven(self) -> bool:
        """Current is driven through a motor; braking is not driving."""
        pytest.skip("this bench does not see the bridge")

    def lose_link(self) -> None:
        """Cut what connects the driver to the robot."""
        pytest.skip("this bench cannot cut the link")

    def restore_link(self) -> None:  # noqa: B027 - called after lose_link only
        """Mend it again."""

    def block_left_encoder(self) -> None:
        """From now on the left encoder does not count."""
        pytest.skip("this bench cannot break an encoder")
