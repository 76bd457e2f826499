"""The stand-in for pigpiod as a process of its own, as the real one is."""

from __future__ import annotations

from support.stand_in import StandIn


class PigpioProcess(StandIn):
    """Runs from `with` to the end of its block."""

    def __init__(self, *arguments: str) -> None:
        super().__init__("support.pigpiod", *arguments)
        self.port = int(self.first_answer["port"])
