"""`wheelwire mcu`: a Pi's core as a service that outlives its hosts."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.cases import each
from support.command import check_error, run, run_json
from support.pigpio_process import PigpioProcess
from support.waiting import wait_until
from wheelwire import errors
from wheelwire.drivers.serial import SerialDriver

TIMEOUT_S = 30.0
AT_ONCE_US = 2_000_000
"""On a busy test machine, daemon included; without the socket's end it would be the setpoint's."""
CONFIG = """
driver: pigpio
pigpio: {{host: 127.0.0.1, port: {port}}}
store: {store}
parameters: {{overrun_limit_us: 1000000, ttl_max_s: 5, wheel_radius: 0.04}}
"""
DRIVING = """
import sys, time, wheelwire
robot = wheelwire.open_driver("serial", port=sys.argv[1])
while True:
    robot.set_velocity(0.2, 0.0, ttl=5)
    time.sleep(0.02)
"""


@pytest.fixture(scope="module")
def daemon() -> Iterator[PigpioProcess]:
    with PigpioProcess() as daemon:
        yield daemon


@contextmanager
def service(daemon: PigpioProcess, tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A service on the daemon's pins, in a process group of its own, and its address."""
    config = tmp_path / "robot.yaml"
    config.write_text(CONFIG.format(port=daemon.port, store=tmp_path / "saved"))
    address = f"unix:{tmp_path / 'mcu.sock'}"
    command = [sys.executable, "-m", "wheelwire", "mcu", "--config", str(config)]
    process = subprocess.Popen(
        [*command, "--listen", address], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout
    assert process.stdout.readline() == f"wheelwire: ready at {address}\n"
    try:
        yield process, address
    finally:
        process.terminate()
        process.stdout.close()
        assert process.wait(TIMEOUT_S) == 0
        assert not daemon.truth()["driven"]
        assert not Path(address.removeprefix("unix:")).exists()


@pytest.fixture
def address(daemon: PigpioProcess, tmp_path: Path) -> Iterator[str]:
    with service(daemon, tmp_path) as (_, address):
        yield address


def test_ctrl_c_stops_the_wheels_and_ends_the_service(
    daemon: PigpioProcess, tmp_path: Path
) -> None:
    with service(daemon, tmp_path) as (process, address), SerialDriver(address) as driver:
        driver.set_velocity(0.2, 0.0, ttl=5)
        wait_until(lambda: bool(daemon.truth()["driven"]))
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does
        assert process.wait(TIMEOUT_S) == 0
        assert not daemon.truth()["driven"]


def test_a_lost_host_ends_the_drive_and_not_the_service(
    daemon: PigpioProcess, address: str
) -> None:
    with subprocess.Popen([sys.executable, "-c", DRIVING, address]) as host:
        wait_until(lambda: bool(daemon.truth()["driven"]))
        host.send_signal(signal.SIGKILL)
        killed_us = time.monotonic_ns() // 1000
    wait_until(lambda: not daemon.truth()["driven"])
    assert daemon.truth()["driven_changed_us"] - killed_us < AT_ONCE_US
    with SerialDriver(address) as driver:
        first = driver.info.device.boot_id
    with SerialDriver(address) as driver:
        assert driver.info.device.boot_id == first
        assert driver.geometry.wheel_radius == 0.04
        driver.set_velocity(0.2, 0.0)
        wait_until(lambda: bool(daemon.truth()["driven"]))


def test_a_file_of_a_pis_own_pins_is_an_address(daemon: PigpioProcess, tmp_path: Path) -> None:
    config = tmp_path / "robot.yaml"
    config.write_text(CONFIG.format(port=daemon.port, store=tmp_path / "saved"))
    robot = str(config)
    assert run_json("drive", robot, "--linear", "0.2", "--seconds", "0.3")["linear_mps"] == 0.2
    assert run_json("estop", robot) == {"latched": "ESTOPPED"}
    assert run("drive", robot, "--linear", "0.2", "--seconds", "0.3").returncode != 0
    assert "ESTOPPED cleared" in run("clear", robot).stdout
    assert run_json("params", "set", robot, "path_gain", "1", "--save")["saved"]
    assert run_json("params", "get", robot, "path_gain") == {"path_gain": 1}
    assert not daemon.truth()["driven"]


@each(
    ("content", "listen", "told"),
    [
        ("driver: mock", "unix:x", "a service needs l298n or pigpio"),
        ("driver: pigpio", "/run/x", "it must be unix:PATH"),
    ],
)
def test_a_robot_that_cannot_be_served_is_refused(
    tmp_path: Path, content: str, listen: str, told: str
) -> None:
    config = tmp_path / "robot.yaml"
    config.write_text(content)
    result = run("mcu", f"--config={config}", f"--listen={listen}", COLUMNS="300")
    assert told in check_error(result, errors.ConfigurationError)
