"""What the errors of a driver say of the stop that is behind them."""

from __future__ import annotations

from contextlib import AbstractContextManager
from types import TracebackType
from typing import TYPE_CHECKING

from ..errors import WheelwireError

if TYPE_CHECKING:
    from ..link.device_link import DeviceLink
    from ..log.why.watch import StopWatch


class Explanations(AbstractContextManager["Explanations"]):
    """Explains each error of one robot that leaves a `with` block of it.

    Attributes:
        watch: Watch of the robot's stops, if there is one.
        link: To the robot, whose sensors may say what stopped it.
    """

    def __init__(self, link: DeviceLink) -> None:
        self.watch: StopWatch | None = None
        self.link = link

    def explain(self, error: WheelwireError) -> None:
        """Add to the error the sentence of its stop, the evidence and what to look at."""
        from ..log.why.explanation import explain  # here, for most programs meet no such error

        hold = self.link.hold
        held_by = None if hold is None else self.link.held_by(hold)
        explain(error, self.watch, lambda: self.link.sensors, self.link.name, held_by)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if isinstance(error, WheelwireError):
            self.explain(error)
