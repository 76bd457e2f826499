"""`wheelwire sensors`: what the robot's sensors and inputs measure, and whether it can be used."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from typing import Annotated, Any

import typer

from wheelwire import samples
from wheelwire.errors import LinkLost, RequestTimeout, WheelwireError
from wheelwire.link.sample_stream import SampleIterator
from wheelwire.robot.robot import Robot
from wheelwire.robot.sensors import IN_FILE, SensorStatus, wait_until_read
from wheelwire_protocol.codes import INPUTS, BatteryLevel, PeripheralKind, RangeQuality, SensorState

from .address import Given
from .output import console, print_json, print_note, print_table, wants_json
from .registry import Heading, command

PERIOD_S = 1.0


@command("sensors", Heading.LOOK, 3, page="sensors")
def sensors(given: Given, seconds: Annotated[float, typer.Option(min=0.0)] = 0.0) -> None:
    """Show what the sensors and inputs measure, and why a sensor cannot be used.

    Beside a program that holds the robot, samples come at the rate that was asked for first.

    Args:
        given: The robot.
        seconds: For how long, once a second; 0: once.
    """
    with given.resolve().open_to_look() as driver:
        events = driver.sensors.events()
        wait_until_read(driver.sensors)
        end = time.monotonic() + seconds
        with suppress(StopIteration):  # the events have ended: so has the recording
            _print_events(events, warnings_only=True)
        with suppress(StopIteration):
            while True:
                driver.sensors.events()  # asks again in a new session; raises if out of reach
                _print(driver.sensors.channels)
                if time.monotonic() >= end:
                    return
                time.sleep(min(PERIOD_S, max(0.0, end - time.monotonic())))
                _print_events(events)


def ask_for_samples(driver: Robot) -> bool:
    """Ask a robot that this command holds for its sensors' samples, for others who need them.

    Attached programs get them, and so does a recording. A robot that cannot send any is not an
    error.

    Returns:
        False if the robot was not reached. Otherwise the link asks again in each new session.
    """
    try:
        driver.sensors.start()
    except (LinkLost, RequestTimeout):
        return False
    except WheelwireError:  # the driver or the firmware has no sensors
        pass
    return True


def _print_events(
    events: SampleIterator[samples.SensorEvent], *, warnings_only: bool = False
) -> None:
    while (event := events.poll()) is not None:
        if event.is_warning or not warnings_only:
            print_note(event.sentence)


def _print(channels: tuple[SensorStatus, ...]) -> None:
    if wants_json():
        print_json(
            [
                {
                    "channel": one.info.name,
                    "kind": one.info.kind.name.lower(),
                    "rate_hz": one.info.rate_hz,
                    "age_s": None if one.age_s is None else round(one.age_s, 6),
                    "state": _word(one.state),
                    "reason": one.state.name if _is_stale(one) else None,
                    "value": _value(one),
                }
                for one in channels
            ]
        )
    elif not channels:
        console.print(f"the robot has no sensor: name it {IN_FILE}")
    else:
        print_table(
            "Sensors",
            ("channel", "kind", "rate", "age", "state", "value"),
            [
                (
                    one.info.name,
                    one.info.kind.name.lower(),
                    _rate(one.info),
                    "" if one.age_s is None else f"{one.age_s:.3f} s",
                    _word(one.state) + (f", {one.state.name}" if _is_stale(one) else ""),
                    _text(one),
                )
                for one in channels
            ],
        )


def _rate(info: samples.SensorInfo) -> str:
    if info.kind is PeripheralKind.BATTERY and not info.rate_hz:
        return ""  # the power sensor measures it
    return "change" if info.kind in INPUTS else f"{info.rate_hz} Hz"


def _is_stale(one: SensorStatus) -> bool:
    return one.state is not SensorState.OK


def _word(state: SensorState) -> str:
    return "OK" if state is SensorState.OK else "STALE"


def _value(one: SensorStatus) -> dict[str, Any] | None:
    """The newest sample, without its times."""
    sample = one.sample
    if sample is None:
        return None
    if isinstance(sample, samples.InputsSample):
        reading = _of_input(sample, one)
        if not isinstance(reading, samples.InputReading):
            return {"voltage_v": reading}
        return {"triggered": reading.triggered, "level": int(reading.level), "edges": reading.edges}
    times = ("t_us", "sample", "name", "stamp", "stamp_error_s")
    value = {name: value for name, value in sample._asdict().items() if name not in times}
    # JSON has no infinite numbers: an infinite distance becomes null.
    return value | (
        {"quality": _quality(sample)} if isinstance(sample, samples.RangeSample) else {}
    )


def _of_input(sample: samples.InputsSample, one: SensorStatus) -> samples.InputReading | float:
    """What a digital input reads, or the voltage of an analogue one."""
    name = one.info.name
    return sample.channels[name] if name in sample.channels else sample.analog[name]


def _quality(sample: samples.RangeSample) -> RangeQuality:
    if math.isfinite(sample.distance_m):
        return RangeQuality.GOOD
    return RangeQuality.FAR if sample.distance_m > 0 else RangeQuality.NEAR


def _text(one: SensorStatus) -> str:
    sample = one.sample
    if isinstance(sample, samples.ImuSample):
        turning, pulling = (
            " ".join(f"{value:+.2f}" for value in vector)
            for vector in (sample.gyro, sample.acceleration)
        )
        return f"{turning} rad/s, {pulling} m/s^2, {sample.temperature_c:.0f} degC"
    if isinstance(sample, samples.PowerSample):
        current = "" if sample.current_a is None else f", {sample.current_a:.2f} A"
        used = "" if sample.used_ah is None else f", {sample.used_ah:.3f} Ah used"
        level = "" if sample.level is BatteryLevel.UNKNOWN else f", {sample.level.name.lower()}"
        return f"{sample.voltage_v:.2f} V{current}{used}{level}"
    if isinstance(sample, samples.RangeSample):
        return {
            RangeQuality.GOOD: f"{sample.distance_m:.2f} m",
            RangeQuality.FAR: f"nothing within {sample.max_m:g} m",
            RangeQuality.NEAR: f"nearer than {sample.min_m:g} m",
        }[_quality(sample)]
    if isinstance(sample, samples.InputsSample):
        reading = _of_input(sample, one)
        if not isinstance(reading, samples.InputReading):
            return f"{reading:.2f} V"
        return "triggered" if reading.triggered else "free"
    return ""
