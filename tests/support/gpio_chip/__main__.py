"""`python -m support.gpio_chip SOCKET BOARD [PWM_DIRECTORY]`: its input says what to do.

Each line is a command, each answer a line of JSON; the end of the input is the end of the chip.
"""

from __future__ import annotations

import json
import sys
import threading
from pathlib import Path

from support.gpio_chip.factory import EVENT
from support.gpio_chip.pwm_directory import PwmDirectory
from support.gpio_chip.world import World
from wheelwire.board import unpacked

SHOWN = 20
"""The newest changes of the drive that an answer has."""


def answer(world: World, line: str) -> dict[str, object]:
    command, *arguments = line.split()
    if command == "pwm_away" and world.pwm:
        world.pwm.remove()
    elif command == "pwm_back" and world.pwm:
        world.pwm.restore()
    elif command == "spin":
        world.robot.spin(float(arguments[0]))
    elif command == "dead_left_encoder":
        world.robot.kill_left_encoder()
    elif command == "level":
        world.chip.lines[int(arguments[0])].level = float(arguments[1])
        world.chip.send(EVENT.pack(0, int(arguments[0]), int(arguments[1])))
    return {
        "ticks": world.robot.ticks,
        "driven": world.robot.driven,
        "driven_changed_us": world.robot.driven_changed_us,
        "changes": world.robot.changes[-SHOWN:],
        "lines": [gpio.level for gpio in world.chip.lines],
        "pulls": [gpio.pull for gpio in world.chip.lines],
    }


def main() -> None:
    pwm = PwmDirectory(Path(sys.argv[3])) if len(sys.argv) > 3 else None
    world = World(Path(sys.argv[1]), pwm, unpacked(bytes.fromhex(sys.argv[2])))
    threading.Thread(target=world.run, daemon=True).start()
    print(json.dumps(answer(world, "truth")), flush=True)  # noqa: T201
    for line in sys.stdin:
        print(json.dumps(answer(world, line)), flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
