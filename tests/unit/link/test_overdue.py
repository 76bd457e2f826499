"""A call whose time is up is withdrawn: nothing of it goes out after its caller has gone on."""

from __future__ import annotations

import asyncio
import time

import pytest

from support.pty_device import PtyDevice
from wheelwire import aio
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import RequestTimeout
from wheelwire.link import device_link
from wheelwire.robot import loop_link
from wheelwire_protocol.types import ParameterSet

pytestmark = pytest.mark.timeout(60)

LIMIT_S = 0.02
"""Before a request is repeated for the first time."""
REPEATS_S = 0.5
"""Several repeats would have been due by then."""


def test_it_is_not_repeated(
    device: PtyDevice, robot: SerialDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    device.device.lost.add(ParameterSet)
    monkeypatch.setattr(device_link, "CALL_TIMEOUT_S", LIMIT_S)
    with pytest.raises(RequestTimeout, match="unknown whether that was done"):
        robot.parameters.set("integral_gain", 7.5)
    monkeypatch.undo()
    robot.stop()  # comes after the withdrawal
    sent = device.device.count(ParameterSet)
    time.sleep(REPEATS_S)
    assert device.device.count(ParameterSet) == sent
    robot.stop()


def test_one_that_was_not_begun_is_never_sent(
    device: PtyDevice, robot: SerialDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The port's thread has something else to do meanwhile.
    robot._link._loop.call(  # type: ignore[attr-defined]
        lambda done, _: (time.sleep(10 * LIMIT_S), done(None))[1],  # type: ignore[func-returns-value]
        lambda _: None,
    )
    monkeypatch.setattr(device_link, "CALL_TIMEOUT_S", LIMIT_S)
    with pytest.raises(RequestTimeout):
        robot.parameters.set("integral_gain", 7.5)
    monkeypatch.undo()
    time.sleep(REPEATS_S)
    assert device.device.count(ParameterSet) == 0
    robot.stop()


async def test_the_same_with_asyncio(device: PtyDevice, monkeypatch: pytest.MonkeyPatch) -> None:
    async with aio.connect(device.path) as driver:
        device.device.lost.add(ParameterSet)
        monkeypatch.setattr(loop_link, "CALL_TIMEOUT_S", LIMIT_S)
        with pytest.raises(RequestTimeout, match="unknown whether that was done"):
            await driver.parameters.set("integral_gain", 7.5)
        monkeypatch.undo()
        await driver.stop()  # comes after the withdrawal
        sent = device.device.count(ParameterSet)
        await asyncio.sleep(REPEATS_S)
        assert device.device.count(ParameterSet) == sent
        await driver.stop()
