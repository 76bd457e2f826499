"""l298n: a process makes the edges, a thread here takes them from a pipe, as lgpio's does."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from unittest import mock

from gpiozero import Device

from support.driver_bench.rig import Rig
from support.gpio_robot import GpioRobot
from wheelwire.drivers import enable_pwm
from wheelwire.drivers.l298n import L298NDriver

READ_SIZE = 4096
_REPORT = struct.Struct("<QII")
"""As edge_source makes them."""


class GpioRig(Rig):
    """Runs from `with` to the end of its block."""

    name = "l298n"

    def __enter__(self) -> GpioRig:
        self._directory = tempfile.TemporaryDirectory()
        root = Path(self._directory.name) / "pwm"
        self._robot = GpioRobot(root)
        for channel in (0, 1):
            (root / "pwmchip0" / "export").write_text(f"{channel}\n")
            assert self._robot.pwm
            self._robot.pwm.export()
        self._en_low_us = 0
        self._high = False
        self._patches = [
            mock.patch.object(Device, "pin_factory", self._robot.factory),
            mock.patch.object(enable_pwm.KernelPwm, "set", self._watched(enable_pwm.KernelPwm.set)),
        ]
        for patch in self._patches:
            patch.start()
        self.driver = L298NDriver(parameters={"overrun_limit_us": 1e6}, pwm_directory=root)
        pins = self._robot.pins
        inputs = (pins.left_enc_a, pins.left_enc_b, pins.right_enc_a, pins.right_enc_b)
        self._inputs = [self._robot.factory.pin(gpio) for gpio in inputs]
        return self

    def __exit__(self, *_: object) -> None:
        self.driver.shutdown()
        for patch in self._patches:
            patch.stop()
        self._directory.cleanup()

    def spin(self, ticks_per_s: float, seconds: float) -> tuple[int, float]:
        source = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "support.driver_bench.edge_source",
                str(ticks_per_s),
                str(seconds),
            ],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        assert source.stdout
        reader = threading.Thread(target=self._read, args=(source.stdout.fileno(),))
        reader.start()
        reader.join()
        assert source.stderr
        true_ticks, true_seconds = source.stderr.read().split()
        source.wait()
        source.stdout.close()
        source.stderr.close()
        return int(true_ticks), float(true_seconds)

    def en_low_us(self) -> int:
        return self._en_low_us

    def _read(self, pipe: int) -> None:
        while data := os.read(pipe, READ_SIZE):
            for _, index, level in _REPORT.iter_unpack(data):
                self._inputs[index].wire(level)

    def _watched(self, original: object) -> object:
        def set_duty(pwm: enable_pwm.KernelPwm, duty: float) -> None:
            original(pwm, duty)  # type: ignore[operator]
            if self._high and duty == 0:
                self._en_low_us = time.monotonic_ns() // 1000
            self._high = duty > 0

        return set_duty
