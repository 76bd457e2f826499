"""A program that is interrupted by signals while it uses a robot; run as a process of its own.

Usage: interrupted_host.py PORT SEED COUNT {raise,stop}. It ends after COUNT signals that arrived
within a call; each raises KeyboardInterrupt there, or calls `stop()`. It prints the results of the
calls as one line of JSON.
"""

from __future__ import annotations

import json
import random
import signal
import sys
import time
from collections import Counter
from types import FrameType

import wheelwire
from support.threads import link_threads
from wheelwire.drivers.serial import SerialDriver

LONGEST_S = 6.0
"""The longest time that any call may take."""
TTL_S = 5.0
"""Long enough that no setpoint expires in flight, even on a busy computer."""


class Host:
    """The program's state. `sent` has the values of the calls that succeeded."""

    def __init__(self, port: str, seed: int, mode: str) -> None:
        self.robot = SerialDriver(port)
        self.random = random.Random(seed)
        self.mode = mode
        self.interrupts = 0
        self.handling = False
        self.duties: list[int] = []
        self.values: list[float] = []
        self.succeeded: Counter[str] = Counter()
        self.errors: Counter[str] = Counter()
        self.longest_s = 0.0
        self.number = 0

    def handle(self, _number: int, frame: FrameType | None) -> None:
        """Only what interrupts a call counts."""
        while frame is not None and frame.f_code is not Host.attempt.__code__:
            frame = frame.f_back
        if frame is None or self.handling:
            return
        self.interrupts += 1
        if self.mode == "raise":
            raise KeyboardInterrupt
        self.handling = True
        try:
            self.stop()
        finally:
            self.handling = False

    def stop(self) -> None:
        began = time.monotonic()
        try:
            self.robot.stop()
            self.succeeded["stop"] += 1
        except wheelwire.WheelwireError as error:
            self.errors[repr(error)] += 1
        self.longest_s = max(self.longest_s, time.monotonic() - began)

    def attempt(self) -> None:
        """Make one call and note its success."""
        robot, kind = self.robot, self.random.randrange(7)
        if kind < 2:
            self.number = self.number % 32767 + 1
            robot.set_duty(self.number / 32767, 0.0, TTL_S)
            self.duties.append(self.number)
        elif kind == 2:
            value = round(1.0 + self.number / 10_000, 4)
            robot.parameters.set("integral_gain", value)
            self.values.append(value)
        elif kind == 3:
            robot.stop()
            self.succeeded["stop"] += 1
        elif kind == 4:
            robot.read(timeout=1.0)
        elif kind == 5:
            robot.get_encoder_ticks()
        else:
            robot.set_velocity(0.1, 0.2, TTL_S)

    def run(self, count: int) -> None:
        while self.interrupts < count:
            began = time.monotonic()
            try:
                self.attempt()
            except KeyboardInterrupt:
                pass
            except wheelwire.WheelwireError as error:
                self.errors[repr(error)] += 1
            self.longest_s = max(self.longest_s, time.monotonic() - began)


def _say(line: str) -> None:
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main() -> None:
    port, seed, count, mode = sys.argv[1:]
    host = Host(port, int(seed), mode)
    host.robot.parameters.list()
    signal.signal(signal.SIGINT, host.handle)
    _say("ready")
    host.run(int(count))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    host.robot.read(timeout=5.0)
    host.robot.stop()
    alive = len(link_threads())
    host.robot.shutdown()
    report = {
        "interrupts": host.interrupts,
        "duties": host.duties,
        "values": host.values,
        "stops": host.succeeded["stop"],
        "errors": host.errors,
        "longest_s": host.longest_s,
        "alive": alive,
        "left": len(link_threads()),
    }
    _say(json.dumps(report))


if __name__ == "__main__":
    main()
