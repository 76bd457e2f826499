"""The settings of the process, passed as JSON so that it needs no configuration library."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Literal

from ..board import Configuration, ImuSensor, PowerSensor, unpacked

CORE_TIMEOUT_MS = 100
"""A core that is silent for this long while it drives is considered hung."""
PIGPIO_CORE_TIMEOUT_MS = 1000
"""As `CORE_TIMEOUT_MS`, behind a pigpiod: an answer over a wireless network takes longer."""


@dataclass(frozen=True)
class McuSettings:
    """One robot on this computer's pins, and its application.

    Attributes:
        backend: What moves the pins.
        board: The wiring of this computer's pins, and its peripherals.
        parameters: Values that differ from the defaults, by name.
        store: File for saved parameters; without one nothing can be saved.
        pwm_directory: `l298n`: directory of the kernel's PWM chips.
        pwm_chip: `l298n`: number of the kernel's PWM chip, if there are several.
        host: `pigpio`: the daemon's computer.
        port: `pigpio`: its TCP port.
        core_timeout_ms: How long the core may be silent before the guard kills it.
        socket: Descriptor of a socket connected to the application; or
        listen: Path of a Unix socket to which one application at a time may connect.
        parent: Process id of the application; this process ends with it.
    """

    backend: Literal["l298n", "pigpio"]
    board: Configuration
    parameters: dict[str, float] = field(default_factory=dict)
    store: str | None = None
    pwm_directory: str = "/sys/class/pwm"
    pwm_chip: int | None = None
    host: str = "localhost"
    port: int = 8888
    core_timeout_ms: int = CORE_TIMEOUT_MS
    socket: int | None = None
    listen: str | None = None
    parent: int | None = None

    @property
    def identity(self) -> str:
        """The robot's name by its pins, which two robots cannot share, and by its pigpiod."""
        place = f"-{self.host}-{self.port}" if self.backend == "pigpio" else ""
        return f"{self.backend}-{self.board.fingerprint():08x}{place}"

    @property
    def buses(self) -> list[int]:
        """The numbers of this computer's I2C buses on which there are sensors."""
        chips = [one for one in self.board.peripherals if isinstance(one, (ImuSensor, PowerSensor))]
        return sorted({chip.bus for chip in chips if chip.bus is not None})

    def to_json(self) -> str:
        """The settings as one line of JSON, with the board in its packed form."""
        # JSON knows neither the board's enumerations nor its set of pins.
        return json.dumps({**vars(self), "board": self.board.packed().hex()})

    @classmethod
    def from_json(cls, text: str) -> McuSettings:
        """The settings from the output of `to_json`."""
        content = json.loads(text)
        return cls(**{**content, "board": unpacked(bytes.fromhex(content["board"]))})
