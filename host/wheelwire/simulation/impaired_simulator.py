"""A simulated device behind a bad line."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from wheelwire.simulation.simulator import Simulator

from .impairment import ImpairedLine, LineProfile
from .relay import ImpairedRelay


class ImpairedSimulator(Simulator):
    """A `Simulator` whose port is the host's end of a bad line.

    Args:
        profile: The line's impairment.
        link: Path of a symbolic link to the port.
        **options: Those of `Simulator`.
    """

    def __init__(self, profile: LineProfile, *, link: Path | None = None, **options: Any) -> None:
        self._folder = TemporaryDirectory(prefix="wheelwire-")
        device_port = Path(self._folder.name) / "device"
        port = link or Path(self._folder.name) / "robot"
        # Locked is the name that hosts open. The simulator's own port is in a private folder, where
        # no other simulator could take its place.
        arguments = [*options.pop("arguments", ()), f"--lock={port}"]
        super().__init__(link=device_port, arguments=arguments, **options)
        self._relay = ImpairedRelay(device_port, port, profile, self.reset)

    @property
    def port(self) -> str:
        """The port for a host."""
        return str(self._relay.port)

    @property
    def line(self) -> ImpairedLine:
        """The impaired line, with its ground truth."""
        return self._relay.line

    def start(self) -> None:
        """Start the device, then the line."""
        super().start()
        try:
            self._relay.start()
        except BaseException:
            # Else the process would go on with nobody to end it.
            super().close()
            raise

    def close(self) -> None:
        """End the line, then the device."""
        # In this order: an incident on the line may be about to reset the device.
        self._relay.close()
        super().close()
        self._folder.cleanup()
