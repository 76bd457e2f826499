"""`python -m support.pigpiod`: a daemon that is controlled by its standard input.

Each line is a command, each answer a line of JSON; the end of the input is the end of the daemon.
"""

from __future__ import annotations

import argparse
import json
import sys
import threading

from support.pigpiod.daemon import Daemon
from support.pigpiod.pins import PinBank
from support.pigpiod.world import World
from wheelwire.board import unpacked
from wheelwire.files.pins import Pins

SHOWN = 20
"""The newest changes of the drive that an answer has."""


def answer(daemon: Daemon, port: int, line: str) -> dict[str, object]:
    command, *arguments = line.split()
    world = daemon.world
    if command == "refuse":
        daemon.refuse()
    elif command == "accept":
        daemon.listen(port)
    elif command == "spin":
        world.robot.spin(float(arguments[0]))
    elif command == "dead_left_encoder":
        world.robot.kill_left_encoder()
    return {
        "port": port,
        "ticks": world.robot.ticks,
        "driven": world.driven,
        "driven_changed_us": world.robot.driven_changed_us,
        "changes": world.robot.changes[-SHOWN:],
        "pulls": daemon.bank.pulls,
    }


def say(line: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(line) + "\n")
    sys.stdout.flush()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--board", default=Pins().packed().hex())
    parser.add_argument("-t", choices=["0", "1"], default="1")
    arguments = parser.parse_args()
    bank = PinBank(pwm_is_clock=arguments.t == "0")
    board = unpacked(bytes.fromhex(arguments.board))
    daemon = Daemon(bank, World(bank, board))
    port = daemon.listen(arguments.port)
    threading.Thread(target=daemon.world.run, daemon=True).start()
    say({"port": port})
    for line in sys.stdin:
        say(answer(daemon, port, line))


if __name__ == "__main__":
    main()
