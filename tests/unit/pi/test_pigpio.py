"""pigpio's traps, and what the driver makes of them, with the real client library."""

import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from itertools import count
from typing import Any

import pigpio
import pytest

from support.pigpio_process import PigpioProcess
from support.pin_drivers import pigpio_on
from support.waiting import wait_until
from wheelwire.drivers.pigpio import PigpioDriver
from wheelwire.errors import ConfigurationError, DriverUnavailable
from wheelwire.pi.gpio.base import PinsBusy
from wheelwire.pi.gpio.pigpiod import MAX_SCRIPTS, REFRESH_US, PigpioClient, PigpioWatchdog
from wheelwire.tools.files.robot import parse_config

HOST = "127.0.0.1"
LONG_S = 30.0
MOTOR_PINS = (18, 19)


@pytest.fixture(scope="module")
def daemon() -> Iterator[PigpioProcess]:
    with PigpioProcess() as daemon:
        yield daemon


@pytest.fixture
def client(daemon: PigpioProcess) -> Iterator[Any]:
    client = pigpio.pi(HOST, daemon.port)
    callback_thread = client._notify  # `stop` forgets it without waiting for its end
    yield client
    client.stop()
    # Still alive when the daemon ends, it would raise ConnectionResetError in a later test.
    callback_thread.join(LONG_S)
    assert not callback_thread.is_alive()


def drive(driver: PigpioDriver, daemon: PigpioProcess) -> None:
    driver.set_velocity(0.2, 0.0, ttl=5)
    wait_until(lambda: bool(daemon.command("truth")["driven"]))


def test_the_driver_uses_hardware_pwm_at_the_frequency_asked_for(
    daemon: PigpioProcess, client: Any
) -> None:
    with pigpio_on(daemon) as driver:
        drive(driver, daemon)
        for gpio in (18, 19):
            assert client.get_PWM_frequency(gpio) == 20_000
            assert client.get_PWM_real_range(gpio) == 18_750


def test_a_daemon_whose_clock_is_the_pwm_hardware_is_refused_by_its_reason() -> None:
    with (
        PigpioProcess("-t", "0") as daemon,
        pytest.raises(DriverUnavailable, match="-t 0"),
        pigpio_on(daemon),
    ):
        pass


def test_no_daemon_says_how_to_start_one() -> None:
    with PigpioProcess() as daemon:
        port = daemon.port
    with pytest.raises(DriverUnavailable, match="systemctl start pigpiod"):
        PigpioDriver(HOST, port)


def test_two_wheels_on_one_pwm_channel_are_refused() -> None:
    with pytest.raises(ConfigurationError, match=r"right_pwm = 12.*share"):
        parse_config({"driver": "pigpio", "pins": {"right_pwm": 12}})
    with pytest.raises(ConfigurationError, match=r"left_pwm = 4.*12, 13, 18 and 19"):
        parse_config({"driver": "pigpio", "pins": {"left_pwm": 4}})


@pytest.mark.whole
def test_the_scripts_of_killed_programs_do_not_fill_the_daemon(
    daemon: PigpioProcess, client: Any
) -> None:
    for _ in range(3):
        subprocess.run(
            [sys.executable, "-c", _OPEN_AND_DIE, str(daemon.port)],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            check=False,
        )
    with pigpio_on(daemon):
        assert len(stored_scripts(client)) == 1
    assert stored_scripts(client) == []


_OPEN_AND_DIE = """
import os, signal, sys, wheelwire
robot = wheelwire.open_driver("pigpio", host="127.0.0.1", port=int(sys.argv[1]))
os.kill(os.getpid(), signal.SIGKILL)
"""


def stored_scripts(client: Any) -> list[int]:
    return [i for i in range(MAX_SCRIPTS) if client.script_status(i)[0] >= 0]


class ClientThatIsCalled(PigpioClient):
    """Calls `before` with the name of each request to the daemon that follows."""

    before: Callable[[str], object] = staticmethod(lambda _: None)

    def __init__(self, host: str, port: int) -> None:
        self.asked: Counter[str] = Counter()
        super().__init__(host, port)

    @property
    def waits(self) -> bool:
        """Whether it has looked at one script again and again."""
        return max(self.asked.values()) > 3

    def call(self, method: str, *arguments: object) -> Any:
        self.asked[f"{method} {arguments}"] += 1
        self.before(method)
        return super().call(method, *arguments)


Clients = tuple[ClientThatIsCalled, ClientThatIsCalled]


@pytest.fixture
def clients(daemon: PigpioProcess) -> Iterator[Clients]:
    """Of two programs."""
    with (
        closing(ClientThatIsCalled(HOST, daemon.port)) as first,
        closing(ClientThatIsCalled(HOST, daemon.port)) as second,
    ):
        yield first, second


def test_a_program_that_was_delayed_keeps_its_motors(clients: Clients, client: Any) -> None:
    first = PigpioWatchdog(clients[0], MOTOR_PINS)
    (script,) = stored_scripts(client)
    wait_until(lambda: client.script_status(script)[0] == pigpio.PI_SCRIPT_HALTED)
    requests = count()

    def go_on_later(_: str) -> None:
        if clients[1].waits:
            first.keep_alive(next(requests) * REFRESH_US)

    clients[1].before = go_on_later
    with pytest.raises(PinsBusy, match="another program drives GPIO 18 and 19"):
        PigpioWatchdog(clients[1], MOTOR_PINS)
    first.close()
    clients[1].before = lambda _: None
    PigpioWatchdog(clients[1], MOTOR_PINS).close()


@pytest.mark.parametrize("was_killed", [False, True])
def test_of_two_programs_that_start_at_once_only_one_drives(
    clients: Clients, client: Any, *, was_killed: bool
) -> None:
    """Also where both have waited for the same program that was killed."""
    started: list[PigpioWatchdog] = []
    if was_killed:
        PigpioWatchdog(clients[0], MOTOR_PINS)  # nobody refreshes it
        wait_until(
            lambda: client.script_status(stored_scripts(client)[0])[0] == pigpio.PI_SCRIPT_HALTED
        )

    def start_first(method: str) -> None:
        # The second one waits for the killed one's script, or has looked for others.
        is_time = clients[1].waits if was_killed else method == "store_script"
        if is_time and not started:
            started.append(PigpioWatchdog(clients[0], MOTOR_PINS))

    clients[1].before = start_first
    with pytest.raises(PinsBusy, match="another program drives GPIO 18 and 19"):
        PigpioWatchdog(clients[1], MOTOR_PINS)
    assert len(stored_scripts(client)) == 1
    (first,) = started
    assert first.keep_alive(REFRESH_US)
    first.close()


@pytest.mark.whole
def test_a_daemon_that_dies_is_a_lost_link_and_its_return_is_noticed() -> None:
    daemon = PigpioProcess()
    with pigpio_on(daemon) as driver:
        drive(driver, daemon)
        first = driver.read().boot_id
        daemon.kill()
        wait_until(lambda: not driver.is_open)
        with PigpioProcess("--port", str(daemon.port)):
            # The last sample of before may not have been read.
            wait_until(lambda: driver.read(LONG_S).boot_id != first)
            assert driver.statistics.reconnects == 1
            driver.set_velocity(0.0, 0.0)  # its core restarted, so it is unarmed
            driver.set_velocity(0.1, 0.0)
    daemon.close()


@pytest.mark.whole
def test_a_daemon_that_hangs_is_a_lost_link() -> None:
    with PigpioProcess() as daemon, pigpio_on(daemon) as driver:
        drive(driver, daemon)
        os.kill(daemon.pid, signal.SIGSTOP)
        try:
            wait_until(lambda: not driver.is_open)
        finally:
            os.kill(daemon.pid, signal.SIGCONT)


@pytest.mark.whole
def test_edges_closer_than_a_sample_are_reported_as_lost() -> None:
    # Its own: after it the motors no longer turn the wheels.
    with PigpioProcess() as daemon, pigpio_on(daemon) as driver:
        daemon.command("spin 250000")
        wait_until(lambda: driver.control_counters().left_illegal > 100, LONG_S)
        daemon.command("spin 0")
