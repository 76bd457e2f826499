"""Calls in signal handlers, and exceptions out of them, at every step of the calls they interrupt.

The handler is called between two bytecodes of the main thread, as a signal's is, in the library's
frames and in the standard library's, and at each of them in turn.
"""

import gc
import signal
import threading
from collections.abc import Callable
from contextlib import suppress

import pytest

from support.bytecodes import interrupted
from support.interrupted_host import LONGEST_S
from support.interrupts import interrupt_program
from support.pty_device import PtyDevice
from support.threads import link_threads
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver
from wheelwire.drivers.transport import TransportDriver
from wheelwire.link.threads import Notifier
from wheelwire.link.transports import Transport, open_transport
from wheelwire_protocol.types import ParameterSet

CALLS: dict[str, Callable[[SerialDriver], object]] = {
    "set_duty": lambda robot: robot.set_duty(0.1, 0.1, ttl=5.0),
    "stop": lambda robot: robot.stop(),
    # A busy computer may take more than the usual second for a sample.
    "read": lambda robot: robot.read(30.0),
    "get_encoder_ticks": lambda robot: robot.get_encoder_ticks(),
    "statistics": lambda robot: robot.statistics,
    "refresh": lambda robot: robot.parameters.refresh("wheel_radius"),
}


def interrupt(*_: object) -> None:
    raise KeyboardInterrupt


STRIDE = 7
"""An opening has a thousand bytecodes and more: every seventh takes a few seconds."""


@pytest.mark.whole
@pytest.mark.parametrize("name", CALLS)
def test_any_call_may_be_interrupted_by_a_stop(robot: SerialDriver, name: str) -> None:
    step = 1
    while interrupted(lambda: CALLS[name](robot), step, robot.stop):
        step += 1
    assert step > 20


# A coroutine that was just made: no handler runs there, but this test interrupts anywhere.
@pytest.mark.whole
@pytest.mark.filterwarnings("ignore:coroutine .* was never awaited:RuntimeWarning")
@pytest.mark.parametrize("name", CALLS)
def test_an_exception_out_of_a_handler_leaves_a_link_that_goes_on(
    robot: SerialDriver, name: str
) -> None:
    step, done = 0, False
    while not done:
        step += 1
        try:
            done = not interrupted(lambda: CALLS[name](robot), step, interrupt)
        except KeyboardInterrupt:
            robot.stop()
    robot.read()
    assert step > 20


def test_a_request_whose_caller_was_interrupted_is_not_sent_again(
    device: PtyDevice, robot: SerialDriver
) -> None:
    main, core = threading.get_ident(), device.device
    core.lost.add(ParameterSet)

    def interrupt_the_wait() -> None:
        wait_until(lambda: core.count(ParameterSet) > 0)
        signal.pthread_kill(main, signal.SIGUSR1)

    thread = threading.Thread(target=interrupt_the_wait)
    former = signal.signal(signal.SIGUSR1, interrupt)
    thread.start()
    with pytest.raises(KeyboardInterrupt):
        robot.parameters.set("wheel_radius", 0.05)
    thread.join()
    signal.signal(signal.SIGUSR1, former)
    robot.stop()  # its answer comes behind all copies that were sent until now
    sent = core.count(ParameterSet)
    robot.parameters.refresh("wheel_radius")  # waits until the time of the first is up
    assert core.count(ParameterSet) == sent


def test_a_read_in_a_handler_while_a_read_waits(robot: SerialDriver) -> None:
    step = 1
    while interrupted(lambda: robot.read(10.0), step, lambda: robot.read(10.0)):
        step += 1


# An exception in a finaliser, and sockets of an interrupted constructor that are freed, warn.
@pytest.mark.whole
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupted_opening_leaves_the_port_free(device: PtyDevice) -> None:
    path, step, done = str(device.path), 1, False
    opened: list[SerialDriver] = []
    while not done:
        with suppress(KeyboardInterrupt):
            done = not interrupted(lambda: opened.append(SerialDriver(path)), step, interrupt)
        for driver in opened:
            driver.shutdown()
        opened.clear()
        wait_until(lambda: not link_threads())
        step += STRIDE
    SerialDriver(path).shutdown()
    assert step > 500
    gc.collect()  # the sockets, or a later test would be blamed for them


def test_no_handler_interrupts_the_opening_itself(device: PtyDevice) -> None:
    threads: list[threading.Thread] = []

    def open_port(baud_rate: int) -> Transport:
        threads.append(threading.current_thread())
        return open_transport(str(device.path), baud_rate)

    with TransportDriver("robot", open_port, baud_rate=921_600):
        assert threads
        assert threading.main_thread() not in threads


def test_an_interrupted_shutdown_can_be_repeated(device: PtyDevice) -> None:
    for step in range(1, 60):
        driver = SerialDriver(str(device.path))
        try:
            interrupted(driver.shutdown, step, interrupt)
        except KeyboardInterrupt:
            driver.shutdown()
        with pytest.raises(errors.LinkClosed):
            driver.stop()
        SerialDriver(str(device.path)).shutdown()


@pytest.mark.whole
@pytest.mark.parametrize("mode", ["raise", "stop"])
def test_a_storm_of_interrupts(mode: str) -> None:
    result = interrupt_program(500, mode)
    # A named error may come of a busy computer, now and then.
    assert sum(result.report["errors"].values()) < result.report["interrupts"] / 10
    assert result.unsent == []
    assert (result.report["alive"], result.report["left"]) == (2, 0)  # the port's and the tap's
    assert result.report["longest_s"] < LONGEST_S


def test_nobody_who_gave_up_waiting_is_remembered() -> None:
    notifier = Notifier()
    assert not notifier.wait_for(lambda: False, 0.01)
    assert not notifier.waiting


def test_a_notification_between_look_and_wait_is_not_missed() -> None:
    notifier, looks = Notifier(), iter([False, True, True])
    assert notifier.wait_for(lambda: next(looks), 10)
