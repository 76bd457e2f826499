"""Write each sample to a CSV file: python examples/log_csv.py run.csv /dev/ttyUSB0.

It sends no setpoint; turn the wheels by hand. To log while driving, write the samples in the
program that drives: only one program can use a port.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
from pathlib import Path

import wheelwire

ROBOT = "a port, a YAML file, mock, ...; default: $WHEELWIRE_ROBOT"
COLUMNS = ("left_ticks", "right_ticks", "left_mps", "right_mps", "left_duty", "right_duty")


def main() -> None:
    """Log for some seconds."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("robot", nargs="?", help=ROBOT)
    parser.add_argument("--seconds", type=float, default=10.0)
    arguments = parser.parse_args()

    with (
        arguments.file.open("w", newline="") as file,
        wheelwire.connect(arguments.robot) as robot,
    ):
        writer = csv.writer(file)
        writer.writerow(["device_time_s", "state", *COLUMNS])
        end = time.monotonic() + arguments.seconds
        samples = robot.samples()
        rows = 0
        for sample in samples:  # 100 a second by default
            if time.monotonic() > end:
                break
            values = [getattr(sample, column) for column in COLUMNS]
            writer.writerow([sample.t_us / 1e6, sample.state.name, *values])
            rows += 1
        lost = robot.statistics.frames_lost
    print(f"{rows} samples in {arguments.file}, {lost + samples.dropped} lost")


if __name__ == "__main__":
    try:
        main()
    except wheelwire.WheelwireError as error:
        sys.exit(str(error))
    except KeyboardInterrupt:
        sys.exit("interrupted; the robot was stopped")
