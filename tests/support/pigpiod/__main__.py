"""`python -m support.pigpiod`: a daemon that is controlled by its standard input."""

from __future__ import annotations

import argparse

from support.bare_robot import run
from support.pigpiod.daemon import Daemon
from support.pigpiod.pins import PinBank
from wheelwire.board import unpacked
from wheelwire.pi.pins import Pins


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--board", default=Pins().packed().hex())
    parser.add_argument("-t", choices=["0", "1"], default="1")
    arguments = parser.parse_args()
    bank = PinBank(pwm_is_clock=arguments.t == "0")
    daemon = Daemon(bank, unpacked(bytes.fromhex(arguments.board)))
    port = daemon.listen(arguments.port)

    def answer(command: str = "", *_: str) -> dict[str, object]:
        if command == "refuse":
            daemon.refuse()
        elif command == "accept":
            daemon.listen(port)
        daemon.apply_pins()
        return {"port": port, "pulls": bank.pulls}

    run(daemon.robot, daemon.advance, answer)


if __name__ == "__main__":
    main()
