"""The order in which the core's process starts and ends: what the guard sees of it."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from wheelwire.board import DigitalInput, ImuSensor
from wheelwire.errors import DriverUnavailable, LinkLost
from wheelwire.pi import __main__ as program
from wheelwire.pi import core, gpio, guard
from wheelwire.pi.guard import Heartbeat, Phase
from wheelwire.pi.line import Line
from wheelwire.pi.pins import Pins
from wheelwire.pi.settings import McuSettings
from wheelwire_protocol.codes import PeripheralKind, Place
from wheelwire_protocol.peripherals import Axis, SensorChip


class Scene:
    """The pins, the loop and the guard's readiness, which write down the phase at each of them."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.log: list[tuple[str, Phase]] = []
        self.heartbeat = Heartbeat()
        self.ours, theirs = socket.socketpair()
        self.settings = McuSettings("l298n", Pins(), socket=theirs.detach())
        self.failure: Exception | None = None
        self.open_failure: Exception | None = None
        monkeypatch.setattr(guard, "request_realtime", lambda _: None)
        monkeypatch.setattr(gpio, "open_gpio", self._open)
        monkeypatch.setattr(program, "_open_end_signal", lambda: -1)
        monkeypatch.setattr(core, "McuLoop", self._loop)
        monkeypatch.setattr(program, "_await_guard", lambda _: self.note("guard awaited"))

    def note(self, what: str) -> None:
        self.log.append((what, self.heartbeat.phase))

    def run(self) -> int:
        return program._run_core(self.settings, self.heartbeat, [None])

    def answer(self) -> dict[str, Any]:
        answer: dict[str, Any] = json.loads(self.ours.recv(4096))
        return answer

    def _open(self, *_: object) -> SimpleNamespace:
        self.note("opened")
        if self.open_failure is not None:
            raise self.open_failure
        return SimpleNamespace(close=lambda: self.note("closed"), limits=())

    def _loop(self, _core: object, _gpio: object, line: Line, *_: object) -> SimpleNamespace:
        return SimpleNamespace(run=lambda: self._run(line))

    def _run(self, line: Line) -> None:
        line.close()
        self.note("driving")
        assert self.answer() == {"limits": []}
        if self.failure is not None:
            raise self.failure


@pytest.fixture
def scene(monkeypatch: pytest.MonkeyPatch) -> Iterator[Scene]:
    scene = Scene(monkeypatch)
    with scene.ours:
        yield scene


ORDER = [
    ("opened", Phase.OPENING),
    ("guard awaited", Phase.OPENING),
    ("driving", Phase.RUNNING),
    ("closed", Phase.RUNNING),
]
"""A guard that finds the core dead while it closes its pins still pulls them low."""


@pytest.mark.parametrize("failure", [None, LinkLost("the pins"), OSError("the line")])
def test_until_its_pins_are_closed_a_core_counts_as_running(
    scene: Scene, failure: Exception | None
) -> None:
    scene.failure = failure
    assert scene.run() == (0 if failure is None else program.FAILED)
    assert scene.log == ORDER
    assert scene.heartbeat.phase is Phase.CLOSED


def test_a_core_that_fails_in_another_way_has_closed_its_pins(scene: Scene) -> None:
    scene.failure = RuntimeError("a bug")
    with pytest.raises(RuntimeError):
        scene.run()
    assert scene.log == ORDER
    assert scene.heartbeat.phase is Phase.CLOSED


def test_unavailable_pins_are_reported_and_never_driven(scene: Scene) -> None:
    scene.open_failure = DriverUnavailable("in use")
    assert scene.run() == program.FAILED
    os.close(scene.settings.socket or 0)
    assert scene.answer() == {"error": "DriverUnavailable", "text": "in use"}
    assert scene.log == [("opened", Phase.OPENING)]
    assert scene.heartbeat.phase is Phase.OPENING


def test_a_pin_of_the_bus_is_refused_before_the_bus_is_opened(scene: Scene) -> None:
    imu = ImuSensor(SensorChip.MPU6050, None, None, forward=Axis.Y, up=Axis.Z, bus=1)
    bumper = DigitalInput(PeripheralKind.BUMPER, Place.FRONT, 2)
    scene.settings = replace(scene.settings, board=replace(Pins(), peripherals=(imu, bumper)))
    assert scene.run() == program.FAILED
    os.close(scene.settings.socket or 0)
    assert "inputs.bumper_front: 2: GPIO 2 is in use already" in scene.answer()["text"]
    assert scene.log == []
