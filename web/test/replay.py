"""Repeat the calls on a simulator that a page recorded (web/src/recorder.ts).

Reads a line of JSON for each call, and writes the same lines with the answers of this computer's
simulator. The two take sine and cosine from different libraries, which may differ in the last bit:
what the lines show is whole numbers.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from wheelwire.simulation.libfwsim import FwSim


def repeat(sim: FwSim, call: dict[str, Any]) -> dict[str, Any]:
    """A call, with this simulator's answer."""
    match call["call"]:
        case "advance":
            sim.advance_us(call["us"])
        case "write":
            sim.write(bytes.fromhex(call["bytes"]))
        case "set":
            sim.set(call["name"], call["value"])
        case "read":
            ticks = [int(sim.get(f"true.{side}_ticks")) for side in ("left", "right")]
            return call | {"bytes": sim.read().hex(), "state": int(sim.state), "ticks": ticks}
        case other:
            sys.exit(f"not a call: {other}")
    return call


def main() -> None:
    """Repeat the run that standard input has."""
    calls = map(json.loads, sys.stdin)
    seed = next(calls)
    with FwSim(seed["seed"]) as sim:
        print(json.dumps(seed, separators=(",", ":")))
        for call in calls:
            print(json.dumps(repeat(sim, call), separators=(",", ":")))


if __name__ == "__main__":
    main()
