"""How much of the line states and an IMU take, and what is lost of them: `make bench`."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.benchmark import Target, output_folder, table, table_of_targets
from wheelwire.drivers.mock import MockDriver
from wheelwire.link.traffic import Kind, Record, TrafficReader
from wheelwire.samples import sentence_of_event
from wheelwire_protocol import Decoder
from wheelwire_protocol.sensors import SensorEventCode
from wheelwire_protocol.types import Imu, LinkCounters, SensorEvent, SetStreamRate, WheelState

SECONDS = 20.0
SETPOINTS_HZ = 50
IMU_HZ = 200
BITS_PER_BYTE = 10
"""On a UART, with start and stop."""
FAST_BAUD = 921_600
LOADS = ((FAST_BAUD, 200), (115_200, 150), (115_200, 100), (115_200, 50))
"""The line, and the states asked for a second."""

METHOD = f"""\
The simulated robot on a line whose rate is modelled, {SECONDS:g} s of virtual time: the same at
every run. The host asks for {IMU_HZ} samples of the IMU a second and sends {SETPOINTS_HZ}
setpoints. *Sent* are the device's frames by its own counter, *received* those that the host decoded
between two readings of that counter; *gaps* are missing numbers, in the frames' sequence and, where
all samples of the IMU come, in theirs. Where the line is too slow for all, the states come first,
and an event says how many samples it has room for. Fewer come: every second one, every fourth.
"""


class Load(NamedTuple):
    """What came over a line."""

    baud: int
    asked_hz: int
    states_hz: float
    imu_hz: float
    sent: int
    received: int
    gaps: int
    to_host: float
    """The share of the line that is used."""
    to_device: float
    said: str


def load_of(baud: int, states_hz: int) -> Load:
    """Drive on such a line."""
    with MockDriver(realtime=False) as robot:
        robot.simulator.set("baud_rate", baud)
        tap = TrafficReader()
        robot._link.listen_to_traffic(tap)
        robot._link.request(SetStreamRate(0, 0, states_hz))
        robot.sensors.start(IMU_HZ)
        robot.advance(0.5)
        said = [
            sentence_of_event("imu", SensorEventCode(one.code), one.value)
            for one in Decoder().feed(_bytes_of(tap.take(), Kind.RECEIVED, Kind.RECEIVED_EACH))
            if isinstance(one, SensorEvent) and one.code == SensorEventCode.REDUCED
        ]
        lost = robot.statistics.frames_lost
        robot.device_counters()
        records: list[Record] = []
        for step in range(round(SECONDS * SETPOINTS_HZ)):
            robot.set_velocity(0.2, 0.5 if step % 2 else -0.5)
            robot.advance(1 / SETPOINTS_HZ)
            records += tap.take()
        robot.device_counters()
        records += tap.take()
        lost = robot.statistics.frames_lost - lost
    came = _bytes_of(records, Kind.RECEIVED, Kind.RECEIVED_EACH)
    went = _bytes_of(records, Kind.SENT)
    messages = list(Decoder().feed(came))
    # An answer that is asked for again is the same once more.
    answers = [(i, one) for i, one in enumerate(messages) if isinstance(one, LinkCounters)]
    first, before = answers[0]
    last, after = next(one for one in answers if one[1] != before)
    imu = [one.sample for one in messages if isinstance(one, Imu)]
    skips = {(b - a) % 2**16 for a, b in pairwise(imu)}
    capacity = baud / BITS_PER_BYTE * SECONDS
    return Load(
        baud,
        states_hz,
        sum(isinstance(one, WheelState) for one in messages) / SECONDS,
        len(imu) / SECONDS,
        after.frames_sent - before.frames_sent,
        last - first,
        lost + (len(skips - {1}) if not said else 0),
        len(came) / capacity,
        len(went) / capacity,
        "; ".join(said) or "-",
    )


def _bytes_of(records: Iterable[Record], *kinds: Kind) -> bytes:
    return b"".join(record.data for record in records if record.kind in kinds)


def main() -> int:
    """Print the tables; returns 1 if a frame was lost."""
    output_folder(__doc__)
    loads = [load_of(*load) for load in LOADS]
    header = (
        *("line [baud]", "states asked", "states a second", "IMU samples a second"),
        *("sent", "received", "gaps", "line to the host", "to the device", "event"),
    )
    rows = [
        [
            *(f"{load.baud}", f"{load.asked_hz}", f"{load.states_hz:.1f}", f"{load.imu_hz:.1f}"),
            *(f"{load.sent}", f"{load.received}", f"{load.gaps}"),
            *(f"{load.to_host:.0%}", f"{load.to_device:.1%}", load.said),
        ]
        for load in loads
    ]
    lost = sum(abs(load.sent - load.received) + load.gaps for load in loads)
    fast = next(load for load in loads if load.baud == FAST_BAUD)
    least = min(fast.states_hz, fast.imu_hz)
    targets = [
        Target("frames lost", f"{lost}", "0", not lost),
        Target("states and samples at 921600", f"{least:.0f} Hz", ">= 199 Hz", least >= 199.0),
    ]
    sys.stdout.write(
        f"## Sensors on the line\n\n{METHOD}\n{table(header, rows)}\n{table_of_targets(targets)}"
    )
    return 0 if all(target.reached for target in targets) else 1


if __name__ == "__main__":
    sys.exit(main())
