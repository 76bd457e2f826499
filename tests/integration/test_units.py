"""The service of a Pi's pins under the conditions of its documented unit."""

from __future__ import annotations

import sys
from pathlib import Path

from support.pigpio_process import PigpioProcess
from support.units import documented_units
from support.waiting import wait_until
from wheelwire.drivers.serial import SerialDriver

TIMEOUT_S = 60.0
CONFIG = """
driver: pigpio
pigpio: {{host: 127.0.0.1, port: {port}}}
store: {store}/saved
parameters: {{overrun_limit_us: 1000000}}
"""


def test_the_unit_starts_a_service_that_drives_saves_and_ends() -> None:
    (unit,) = (one for one in documented_units() if "mcu" in one.command)
    program, *words = unit.command
    config, address = (words[words.index(option) + 1] for option in ("--config", "--listen"))
    runtime, state = unit.writable
    with PigpioProcess() as daemon, unit.world() as world:
        world.add_link(program, Path(sys.prefix) / "bin" / Path(program).name)
        world.add_file(config, CONFIG.format(port=daemon.port, store=state))
        with world.start(unit.command, unit.folder, unit.environment) as process:
            assert process.stdout
            assert process.stdout.readline() == f"wheelwire: ready at {address}\n"
            here = address.replace(runtime, str(world.outside(runtime)))
            with SerialDriver(here) as driver:
                driver.parameters.set("max_duty", 0.9)
                driver.parameters.save()
                driver.set_velocity(0.2, 0.0, ttl=1)
                wait_until(lambda: bool(daemon.truth()["driven"]))
                process.terminate()
                output, _ = process.communicate(timeout=TIMEOUT_S)
        assert process.returncode == 0, output
        assert not daemon.truth()["driven"]
        assert (world.outside(state) / "saved").is_file()
