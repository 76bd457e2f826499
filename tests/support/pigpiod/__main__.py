"""`python -m support.pigpiod`: a daemon that is controlled by its standard input."""

from __future__ import annotations

import argparse
import threading

from support.pigpiod.daemon import Daemon
from support.pigpiod.pins import PinBank
from support.pigpiod.world import World
from support.stand_in import serve
from wheelwire.board import unpacked
from wheelwire.pi.pins import Pins


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

    def answer(command: str, *words: str) -> dict[str, object]:
        if command == "refuse":
            daemon.refuse()
        elif command == "accept":
            daemon.listen(port)
        daemon.world.robot.obey(command, *words)
        daemon.world.apply_pins()
        return {"port": port, **daemon.world.robot.truth(), "pulls": bank.pulls}

    threading.Thread(target=daemon.world.run, daemon=True).start()
    serve({"port": port}, answer)


if __name__ == "__main__":
    main()
