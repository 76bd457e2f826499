"""A robot on a computer's own pins with sensors on its I2C bus, in virtual time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from wheelwire.board import BatteryLevels, Configuration, ImuSensor, Peripheral, PowerSensor
from wheelwire.pi.i2c import BusReader
from wheelwire.pi.pins import Pins
from wheelwire_protocol.codes import Chip, ResetReason, SensorState
from wheelwire_protocol.core import Core, Identity, Outputs, Sensors, TransferResult
from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.peripherals import Axis, PeripheralFault, SensorChip
from wheelwire_protocol.types import AnyMessage, SensorEvent

from .i2c_chips import Chips
from .library_robot import LibraryRobot

BUS = 1
IMU = ImuSensor(SensorChip.MPU6050, None, None, forward=Axis.Y, up=Axis.Z, bus=BUS)
POWER = PowerSensor(SensorChip.INA219, None, None, 100.0, bus=BUS)
LEVELS = BatteryLevels(10.5, 10.2, 9.9)
TRANSFER_US = 400
M = TypeVar("M")


def board_with(*peripherals: Peripheral) -> Configuration:
    return replace(Pins(), peripherals=peripherals)


class PiRobot(LibraryRobot):
    """Its reader polls when something is due, and its core steps; neither waits for the other.

    Args:
        peripherals: On its board.

    Attributes:
        chips: What is on its bus.
        in_transfer: Called within each transfer, as by a kernel that takes its time.
        failure: What comes of each transfer; None: what its chip says.
        reads: Whether the reader runs.
        steps: How many there were.
        messages: What the core has sent.
    """

    def __init__(self, *peripherals: Peripheral) -> None:
        core = Core(Identity(0x1234, Chip.LINUX, 7, ResetReason.POWER_ON))
        board = board_with(*(peripherals or (IMU, POWER)))
        core.take_board(board.packed())
        self.sensors = Sensors(board.packed())
        assert core.sense(self.sensors) is PeripheralFault.NONE
        super().__init__(core)
        self.chips = Chips(lambda: self.bus_us)
        self.in_transfer: Callable[[], None] = lambda: None
        self.failure: TransferResult | None = None
        self.reads = True
        self.messages: list[AnyMessage] = []
        self.steps = 0
        self.bus_us = self.now_us
        self._poll_us = self.now_us
        self._decoder = Decoder()
        self._reader = BusReader(self.sensors, BUS, self._transfer, lambda: self.bus_us)

    def step(self) -> Outputs:
        """One control step, and the polls that are due before it."""
        # A transfer may let time pass.
        while self.reads and self._poll_us <= self.now_us + self.outputs.period_us:
            self.poll()
        self.steps += 1
        return super().step()

    def receive(self, data: bytes) -> None:
        """As the base's, and each message."""
        self.messages += self._decoder.feed(data)
        super().receive(data)

    def poll(self) -> None:
        """Let the reader do what is due."""
        self.bus_us = max(self._poll_us, self.bus_us)
        self._poll_us = self.bus_us + 1 + round(self._reader.poll() * 1e6)

    def run_ms(self, milliseconds: int) -> None:
        """Let time pass."""
        self.run(milliseconds / 1000)

    def of(self, kind: type[M]) -> list[M]:
        """The core's messages of one type."""
        return [one for one in self.messages if isinstance(one, kind)]

    def states(self, channel: int) -> list[SensorState]:
        """What became of a channel, one after the other."""
        return [
            SensorState(one.value)
            for one in self.of(SensorEvent)
            if one.channel == channel and one.code == 0
        ]

    def _transfer(self, address: int, out: bytes, size: int) -> tuple[TransferResult, bytes]:
        self.bus_us += TRANSFER_US
        self.in_transfer()
        if self.failure is not None:
            return self.failure, b""
        data = self.chips.transfer(address, out, size)
        return (TransferResult.NO_ANSWER, b"") if data is None else (TransferResult.DONE, data)
