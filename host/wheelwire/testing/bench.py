"""The robot that a driver is tested on, simulated or with its wheels off the ground."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod

import pytest

from ..drivers.base import BaseDriver


class Bench(ABC):
    """A robot that the tests may drive at up to 0.4 m/s, each way and turning on the spot.

    Only `open` is mandatory. A test that needs one of the other methods is skipped if the bench
    does not have it.
    """

    @abstractmethod
    def open(self) -> BaseDriver:
        """Open the driver under test; the tests shut it down."""

    def pass_time(self, seconds: float) -> None:
        """Let the robot's time pass without calling the driver."""
        time.sleep(seconds)

    def true_ticks(self) -> tuple[int, int]:
        """The ticks (left, right) that perfect encoders would have counted."""
        pytest.skip("this bench cannot count the true ticks")

    def is_driven(self) -> bool:
        """Whether a motor is driven; braking is not driving."""
        pytest.skip("this bench does not see the bridge")

    def lose_link(self) -> None:
        """Cut the link between the driver and the robot."""
        pytest.skip("this bench cannot cut the link")

    def restore_link(self) -> None:  # noqa: B027 - called after lose_link only
        """Restore the link."""

    def block_left_encoder(self) -> None:
        """Make the left encoder stop counting."""
        pytest.skip("this bench cannot break an encoder")
