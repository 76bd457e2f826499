"""Sensors on the line.

{SECONDS:g} s of virtual time, with {IMU_HZ} samples of the IMU a second asked for and
{SETPOINTS_HZ} setpoints sent. On a slow line the states come first, then every second or fourth
sample.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from harness import Report, run
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


def over_a_line(baud: int, asked_hz: int) -> tuple[str, int, float]:
    """Drive on a line of this rate: a row, what was lost, and the lower of the two rates."""
    with MockDriver(realtime=False) as robot:
        robot.simulator.set("baud_rate", baud)
        tap = TrafficReader()
        robot._link.listen_to_traffic(tap)
        robot._link.request(SetStreamRate(0, 0, asked_hz))
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
    # A request that is repeated gets the same answer again.
    answers = [(i, one) for i, one in enumerate(messages) if isinstance(one, LinkCounters)]
    first, before = answers[0]
    last, after = next(one for one in answers if one[1] != before)
    imu = [one.sample for one in messages if isinstance(one, Imu)]
    skips = {(b - a) % 2**16 for a, b in pairwise(imu)}
    capacity = baud / BITS_PER_BYTE * SECONDS
    states_hz = sum(isinstance(one, WheelState) for one in messages) / SECONDS
    imu_hz = len(imu) / SECONDS
    sent, received = after.frames_sent - before.frames_sent, last - first
    gaps = lost + (len(skips - {1}) if not said else 0)
    row = (
        f"{baud} | {asked_hz} | {states_hz:.1f} | {imu_hz:.1f} | "
        f"{len(came) / capacity:.0%} | {len(went) / capacity:.1%}"
    )
    return row, abs(sent - received) + gaps, min(states_hz, imu_hz)


def _bytes_of(records: Iterable[Record], *kinds: Kind) -> bytes:
    return b"".join(record.data for record in records if record.kind in kinds)


def main(report: Report) -> None:
    """Print the tables; no frame may be lost."""
    found = [over_a_line(*load) for load in LOADS]
    report.table(
        "line [baud] | states asked | states a second | IMU samples a second | line to the host | "
        "to the device",
        [row for row, *_ in found],
    )
    report.equal("frames lost", sum(lost for _, lost, _ in found), 0)
    least, wanted = found[0][2], LOADS[0][1] - 1
    what = f"states and samples at {FAST_BAUD}"
    report.target(what, f"{least:.0f} Hz", f">= {wanted} Hz", least >= wanted)


run(main)
