"""`python -m support.wire_tap PORT`: a pseudo-terminal that leads to PORT, and sees what is asked.

Each line on its standard input is answered by a line of JSON, in times of this computer's monotonic
clock: `asked`, when each velocity of the left wheel, in micrometres a second, was first asked for;
`estops`, when each e-stop came.
"""

from __future__ import annotations

import json
import os
import select
import sys
import time
import tty

from wheelwire_protocol.decoder import Decoder
from wheelwire_protocol.types import Estop, SetWheelVelocity

READ_SIZE = 4096


def say(line: object) -> None:
    sys.stdout.write(json.dumps(line) + "\n")
    sys.stdout.flush()


def main() -> None:
    device = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
    master, slave = os.openpty()
    for terminal in (device, slave):
        tty.setraw(terminal)
    say({"port": os.ttyname(slave)})
    decoder = Decoder()
    asked_s: dict[int, float] = {}
    estops_s: list[float] = []
    while True:
        ready, _, _ = select.select([master, device, sys.stdin], [], [])
        if master in ready:
            data, now_s = os.read(master, READ_SIZE), time.monotonic()
            os.write(device, data)
            for message in decoder.feed(data):
                if isinstance(message, SetWheelVelocity):
                    asked_s.setdefault(round(message.left_mps * 1e6), now_s)
                elif isinstance(message, Estop):
                    estops_s.append(now_s)
        if device in ready:
            os.write(master, os.read(device, READ_SIZE))
        if sys.stdin in ready:
            question = sys.stdin.readline()
            if not question:
                return
            say({"estops_s": estops_s} if question == "estops\n" else asked_s)


if __name__ == "__main__":
    main()
