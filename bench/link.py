"""The serial link.

On a pseudo-terminal, to the firmware's core (`wheelwire-fwsim`) or an echo in C. The *bare host* is
one thread with `poll`, `os.read` and `os.write`, which sends a ping of {PING_SIZE} bytes; the
firmware answers with {PONG_SIZE}. The *library* is all of Wheelwire. Medians of
{round_trips.ROUNDS} rounds of {EXCHANGES}, {PAUSE_MS:g} ms apart, in turns of
{round_trips.EXCHANGES}.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from statistics import median

from harness import Report, run
from support import round_trips
from support.bare_host import PING_SIZE, PONG_SIZE, BareHost  # noqa: F401 - the section has them
from support.benchmark import cpu_seconds, ratio
from support.captures import capture
from support.load import Load, frames_lost, load_while, read_for
from wheelwire.drivers.serial import SerialDriver
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol import Decoder

EXCHANGES = round_trips.TURNS * round_trips.EXCHANGES
PAUSE_MS = round_trips.PAUSE_S * 1e3
RATE_HZ, SLOW_HZ, FAST_HZ, READS_HZ = 1000, 100, 5000, 50
CPU_S = 2.0
READS = round(CPU_S * SLOW_HZ)
ROUNDS = 5
IDLE_S = 10.0
SETTLING_S = 0.3
DECODED = 20_000
FAST_S = 5.0
BURST, BURSTS, BURST_PAUSE_S = 40, 50, 0.02
TIGHT, TIGHT_LOOPS = 100, 80
APART_US = 50

CPU = f"""\
CPU of a core and wake-ups a second of the host's process, medians of {ROUNDS} interleaved rounds of
{CPU_S:g} s and of their ratios; idle link {IDLE_S:g} s. The *bare host* throws the stream away, in
one thread or handed to a second one; *decoding* is the codec alone."""
CALLS = f"""\
`set_velocity` returns when its frame is written. *Encode and write* is the least that a program
needs for a setpoint that its robot obeys. {TIGHT_LOOPS} tight loops of {TIGHT}, and {BURSTS} bursts
of {BURST}, {BURST_PAUSE_S * 1e3:g} ms apart, a call every {APART_US} us; medians of all calls in
us: `set_velocity`, encode and write, ratio."""


def show_round_trips(report: Report) -> None:
    """Round trips without a baud rate, and with one."""
    found = round_trips.compare(report.scratch)
    echo, bare, ping, request = found.values()
    # Within each round: on a shared machine ratios hold, times do not.
    rows = [
        f"{name} | {one.p50_us:.0f} | {one.p99_us:.0f} | {ratio(one.p50s_us, echo.p50s_us):.2f} | "
        f"{ratio(one.p99s_us, echo.p99s_us):.2f}"
        for name, one in found.items()
    ]
    report.table("round trip [us] | p50 | p99 | p50 / echo's | p99 / echo's", rows)
    report.at_most("p50 of the firmware / the echo's", ratio(bare.p50s_us, echo.p50s_us), 1.25)
    report.at_most("p99 of the firmware / the echo's", ratio(bare.p99s_us, echo.p99s_us), 2)
    times = ratio(request.p50s_us, bare.p50s_us)
    report.at_most("p50 of a request / a bare host's ping", times, 2)
    times = ratio(ping.p99s_us, bare.p99s_us)
    report.at_most("p99 of the library's ping / a bare host's", times, 2)
    rows = []
    for baud, one in round_trips.on_slow_lines().items():
        line_us = round_trips.line_us(baud)
        p50, p99 = one.p50_us / line_us, one.p99_us / line_us
        microseconds = f"{line_us:.0f} | {one.p50_us:.0f} | {one.p99_us:.0f}"
        rows.append(f"{baud} baud | {microseconds} | {p50:.2f} | {p99:.2f}")
        report.at_most(f"p50 at {baud} baud / the line's", p50, 1.25)
        report.at_most(f"p99 at {baud} baud / the line's", p99, 2)
    report.say("With the line's baud rate modelled, without the UART's idle time of two bytes:")
    report.table("round trip [us] | on the line | p50 | p99 | p50 / line's | p99 / line's", rows)


def show_calls(report: Report) -> None:
    """The time that a setpoint takes in the calling thread."""
    rows = []
    with (
        Simulator() as simulator,
        Simulator() as other,
        SerialDriver(simulator.port) as robot,
        closing(BareHost(other.port, round_trips.ANY_BAUD)) as host,
    ):
        host.open_session(stream_rate_hz=0)
        host.arm()
        measured = partial(robot.set_velocity, 0.1, 0.0), partial(host.drive, 0.1)
        time.sleep(SETTLING_S)
        for where, rounds, calls in (
            ("in a tight loop", TIGHT_LOOPS, TIGHT),
            ("in bursts", BURSTS, BURST),
        ):
            times_us: tuple[list[float], list[float]] = [], []
            for _ in range(rounds):
                for taken_us, work in zip(times_us, measured, strict=True):
                    for _ in range(calls):
                        begun = time.perf_counter_ns()
                        work()
                        taken_us.append((time.perf_counter_ns() - begun) / 1e3)
                        # Only a write that comes late enough has to wake the robot's process, which
                        # takes as long as half of a call: each of both kinds is late enough.
                        while time.perf_counter_ns() < begun + 1000 * APART_US:
                            pass
                    time.sleep(BURST_PAUSE_S)
                    host.drain()
            ours, least = map(median, times_us)
            rows.append(f"{where} | {ours:.1f} | {least:.1f} | {ours / least:.2f}")
            report.at_most(f"set_velocity / encode and write, {where}", ours / least, 2)
    report.say(CALLS)
    report.items(rows)


def read_load(port: str, rate_hz: int, reads_hz: int) -> Load:
    """Load of an open link, with or without reading samples."""
    with SerialDriver(port, stream_rate_hz=rate_hz) as robot:
        # Opening a link does not count as load.
        time.sleep(SETTLING_S)
        return load_while(lambda: read_for(CPU_S, robot, reads_hz))


def idle_load(port: str) -> Load:
    """Load of an open link without state frames."""
    with round_trips.open_without_stream(port):
        time.sleep(SETTLING_S)
        return load_while(lambda: time.sleep(IDLE_S))


def bare_load(port: str, reads: int = 0) -> Load:
    """Load of a minimal host that reads what the device still sends.

    Or so many reads of a thread, each of which another one takes from it.
    """
    with closing(BareHost(port, round_trips.ANY_BAUD)) as host:
        return load_while(lambda: host.hand_over(reads) if reads else host.discard(CPU_S))


def iterated_load(port: str) -> Load:
    """Load of an open link at the slow rate, with every sample read."""
    with SerialDriver(port, stream_rate_hz=SLOW_HZ) as robot:
        samples = robot.samples()
        time.sleep(SETTLING_S)
        # As many as come in the time of the other measures.
        return load_while(lambda: [next(samples) for _ in range(READS)])


def decoding() -> float:
    """CPU of decoding the stream's frames, as a fraction of one core."""
    stream = capture(DECODED)
    # All states have one payload size, so that their frames have one length, too.
    size = len(stream) // DECODED
    frames = [stream[start : start + size] for start in range(0, len(stream), size)]
    decoder = Decoder()
    return RATE_HZ / DECODED * cpu_seconds(lambda: [decoder.feed(frame) for frame in frames])


def show_cpu(report: Report) -> None:
    """The load of an idle and of a busy link."""
    with Simulator() as simulator:
        port = simulator.port
        # A bare host comes last: it reads the stream that the others have started.
        measures: Mapping[str, Callable[[], Load]] = {
            "library, idle link (no stream)": lambda: idle_load(port),
            f"library, {RATE_HZ} states/s, none asked for": lambda: read_load(port, RATE_HZ, 0),
            f"library, {RATE_HZ} states/s, {READS_HZ} reads/s": lambda: read_load(
                port, RATE_HZ, READS_HZ
            ),
            f"bare host, {RATE_HZ} states/s": lambda: bare_load(port),
            f"library, {SLOW_HZ} states/s, none asked for": lambda: read_load(port, SLOW_HZ, 0),
            f"library, {SLOW_HZ} states/s, each read": lambda: iterated_load(port),
            f"bare host, {SLOW_HZ} states/s": lambda: bare_load(port),
            f"bare host, {SLOW_HZ} states/s, to a second thread": lambda: bare_load(port, READS),
        }
        rounds = [{name: of() for name, of in measures.items()} for _ in range(ROUNDS)]
    cpus = [[loads[name].cpu for loads in rounds] for name in measures]
    rows = [
        f"{name} | {median(cpu):.2%} | {median(loads[name].wake_ups for loads in rounds):.0f}"
        for name, cpu in zip(measures, cpus, strict=True)
    ]
    decode = decoding()
    report.say(CPU)
    report.items([*rows, f"decoding {RATE_HZ} states | {decode:.2%}"])
    idle, unread, read, bare, slow_unread, slow_read, slow_bare, slow_handed = cpus
    report.at_most("CPU of an idle link", 100 * median(idle), 0.5, " %")
    # The bare host does not decode: its CPU with a margin, and the codec's on top.
    limit = 1.3 * median(bare) + decode
    what = f"CPU at {RATE_HZ} Hz, none asked for"
    report.at_most(what, 100 * median(unread), 100 * limit, " %")
    what = f"CPU at {RATE_HZ} Hz with {READS_HZ} reads/s / the bare host's"
    report.at_most(what, ratio(read, bare), 2)
    what = f"CPU of a sample at {SLOW_HZ} Hz"
    report.at_most(f"{what}, unread / the bare host's", ratio(slow_unread, slow_bare), 2.5)
    what = f"{what}, read / the bare host's to a second thread"
    report.at_most(what, ratio(slow_read, slow_handed), 3)


def show_fast_stream(report: Report) -> None:
    """The losses of a fast stream."""
    with Simulator() as simulator:
        # First, over a link of its own: a stream faster than the control loop is refused.
        with SerialDriver(simulator.port) as robot:
            robot.parameters.set("control_rate_hz", FAST_HZ)
        with SerialDriver(simulator.port, stream_rate_hz=FAST_HZ) as robot:
            before = robot.statistics
            load = load_while(lambda: time.sleep(FAST_S))
            after = robot.statistics
            # The device drops what the line has no room for, and no gap shows a last frame.
            dropped = robot.device_counters().send_dropped
    received = after.frames_received - before.frames_received
    lost = frames_lost(before, after) + dropped
    report.say(
        f"{FAST_HZ} states a second, one in each control step, for {FAST_S:g} s: {received} frames "
        f"received, {lost} lost, {load.cpu:.0%} of a core."
    )
    report.equal(f"frames lost at {FAST_HZ} Hz", lost, 0)


def main(report: Report) -> None:
    """Measure and print."""
    show_round_trips(report)
    show_calls(report)
    show_cpu(report)
    show_fast_stream(report)


run(main)
