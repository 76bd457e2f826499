"""What the firmware's core takes on RV32IMC at -Os: `make bench`."""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1]))
from support import rv32

WORK = {
    "step": "control step while driving",
    "step_with_setpoint": "... that takes a setpoint",
    "step_with_state": "... that sends a state",
    "step_with_both": "... that does both",
    "receive_setpoint": "receive and decode SetWheelVelocity",
    "send_state": "encode and send WheelState",
}
AIMS = {"step_with_both": f"max < {rv32.AIM_INSTRUCTIONS}"}


def instructions(cost: rv32.Cost) -> Table:
    """Rows of counted work."""
    table = Table(title="Instructions on RV32IMC, -Os, in QEMU", title_justify="left")
    table.add_column("work")
    for column in ("runs", "median", "max", "aim"):
        table.add_column(column, justify="right")
    for key, name in WORK.items():
        counts = cost.instructions[key]
        numbers = (str(number) for number in counts)
        table.add_row(name, *numbers, AIMS.get(key, ""))
    return table


def sizes(cost: rv32.Cost) -> Table:
    """Code and RAM."""
    table = Table(title="Bytes of the core", title_justify="left")
    table.add_column("part")
    for column in ("bytes", "aim"):
        table.add_column(column, justify="right")
    table.add_row("code and constants", str(cost.code_bytes), f"< {rv32.AIM_CODE_BYTES}")
    table.add_row("RAM without the stack", str(cost.ram_bytes), f"< {rv32.AIM_RAM_BYTES}")
    return table


def main() -> None:
    """Print the tables."""
    console = Console()
    if not rv32.available():
        console.print(f"Cost on RV32: left out, needs {rv32.INSTALL}")
        return
    rv32.build()
    cost = rv32.cost()
    console.print(instructions(cost))
    console.print(sizes(cost))


if __name__ == "__main__":
    main()
