"""`python -m support.gpio_chip SOCKET BOARD [PWM_DIRECTORY]`: its input says what to do."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

from support.gpio_chip.chip import EVENT
from support.gpio_chip.pwm_directory import PwmDirectory
from support.gpio_chip.world import World
from support.stand_in import serve
from wheelwire.board import unpacked


def main() -> None:
    pwm = PwmDirectory(Path(sys.argv[3])) if len(sys.argv) > 3 else None
    world = World(Path(sys.argv[1]), pwm, unpacked(bytes.fromhex(sys.argv[2])))
    lines = world.chip.lines

    def answer(command: str, *words: str) -> dict[str, object]:
        if command == "pwm_away" and pwm:
            pwm.remove()
        elif command == "pwm_back" and pwm:
            pwm.restore()
        elif command == "level":
            lines[int(words[0])].level = float(words[1])
            world.chip.send(EVENT.pack(0, int(words[0]), int(words[1])))
        world.robot.obey(command, *words)
        return {
            **world.robot.truth(),
            "lines": [gpio.level for gpio in lines],
            "pulls": [gpio.pull for gpio in lines],
        }

    threading.Thread(target=world.run, daemon=True).start()
    serve(answer("truth"), answer)


if __name__ == "__main__":
    main()
