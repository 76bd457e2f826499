"""`python -m support.gpio_chip SOCKET BOARD [PWM_DIRECTORY]`: its input says what to do."""

from __future__ import annotations

import sys
from pathlib import Path

from support.bare_robot import run
from support.gpio_chip.chip import EVENT, Chip
from support.gpio_chip.pwm_directory import PwmDirectory
from wheelwire.board import unpacked


def main() -> None:
    pwm = PwmDirectory(Path(sys.argv[3])) if len(sys.argv) > 3 else None
    chip = Chip(Path(sys.argv[1]), pwm, unpacked(bytes.fromhex(sys.argv[2])))

    def answer(command: str = "", *words: str) -> dict[str, object]:
        if command == "pwm_away" and pwm:
            pwm.remove()
        elif command == "pwm_back" and pwm:
            pwm.restore()
        elif command == "level":
            chip.lines[int(words[0])].level = float(words[1])
            chip.send(EVENT.pack(0, int(words[0]), int(words[1])))
        # Whoever asks may know of a change since the directory was last looked at.
        chip.apply_pins()
        return {
            "lines": [gpio.level for gpio in chip.lines],
            "pulls": [gpio.pull for gpio in chip.lines],
        }

    run(chip.robot, chip.advance, answer)


if __name__ == "__main__":
    main()
