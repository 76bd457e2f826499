"""The measurements of `make hil` on a board with the self-test image.

Ends with 1 if a row fails. It drives nothing before somebody has said that the motor supply is off.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import serial
from rich.console import Console

sys.path.insert(0, str(Path(__file__).parents[1]))
from support import hil, hil_board
from support.hil_board import Board, BoardError

ROOT = Path(__file__).parents[2]
CONSOLE = Console(markup=False, highlight=False, soft_wrap=True)
TIMES_LONG = 10
BAUD_RATE = 921_600
REOPEN_S = 0.2


class SerialLine:
    """A serial port, opened again when the board's own USB comes back after a reset.

    Args:
        port: Its name, or a URL of pyserial.
    """

    def __init__(self, port: str) -> None:
        self._port = port
        self._serial = self._open()

    def _open(self) -> serial.SerialBase:
        line = serial.serial_for_url(self._port, BAUD_RATE, timeout=0, do_not_open=True)
        line.dtr = line.rts = False  # They would hold a DevKit in reset.
        line.open()
        return line

    def read(self) -> bytes:
        """What has arrived, possibly nothing."""
        try:
            return bytes(self._serial.read(4096))
        except OSError:
            self._reopen()
            return b""

    def write(self, data: bytes) -> None:
        """Send it; what is sent while the port is gone is lost."""
        try:
            self._serial.write(data)
        except OSError:
            self._reopen()

    def _reopen(self) -> None:
        self._serial.close()
        time.sleep(REOPEN_S)
        try:
            self._serial = self._open()
        except OSError:
            return


def is_supply_off() -> bool:
    """Whether the user says so."""
    CONSOLE.print("This crashes the firmware while it drives: switch the motor supply off.")
    try:
        return input("Is it off? Type off: ").strip().lower() == "off"
    except EOFError:  # Nobody is there to ask.
        return False


def main() -> int:
    """Measure, print the table, write the measurements."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", required=True)
    parser.add_argument("--loop", default="", help="wires, OUTPUT:INPUT, as 25:18,26:19")
    parser.add_argument("--long", action="store_true", help="ten times as often")
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "hil.json")
    options = parser.parse_args()
    try:
        loops = hil_board.parsed_loops(options.loop)
        board = Board(SerialLine(options.port))
        board.open(10.0)
        if not hil_board.has_self_test(board):
            CONSOLE.print("For the measurements flash the self-test image: docs/hardware-test.md")
            return 0
        hil_board.check_confirmed(board)
        if len(loops) < 2:
            wires = hil_board.suggested_loops(board.configuration())
            CONSOLE.print(
                f"With two wires more can be measured: connect these pins, and add LOOP={wires}"
            )
        if not is_supply_off():
            CONSOLE.print("Nothing was measured.")
            return 2
        measured = hil_board.measure(board, loops, TIMES_LONG if options.long else 1)
    except (BoardError, OSError) as error:
        CONSOLE.print(f"make hil: {error}")
        return 2
    return 0 if hil.report(measured, options.output, CONSOLE.print) else 1


if __name__ == "__main__":
    sys.exit(main())
