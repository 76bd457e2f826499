"""The serial link: round trips, CPU and loss, in real time: `make bench`, or this file alone."""

from __future__ import annotations

import os
import sys
import time
import tty
from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support import round_trips
from support.bare_host import PING_SIZE, PONG_SIZE, BareHost
from support.benchmark import Target, cpu_seconds, output_folder, ratio, table, table_of_targets
from support.captures import capture
from support.load import Load, frames_lost, load_while, read_for
from wheelwire.drivers.serial import SerialDriver
from wheelwire.link.port_policy import REST_US
from wheelwire.simulation.simulator import Simulator
from wheelwire_protocol import Decoder, Encoder
from wheelwire_protocol.types import SetWheelVelocity

RATE_HZ = 1000
READS_HZ = 50
CPU_ROUNDS = 3
CPU_S = 2.0
IDLE_S = 10.0
SLOW_HZ = 100
SLOW_ROUNDS = 5
SETTLING_S = 0.3
DECODED = 20_000
FAST_HZ = 5000
FAST_S = 5.0
BURST = 40
BURSTS = 50
BURST_PAUSE_S = 0.02
TIGHT = 100
TIGHT_LOOPS = 80

ROUND_TRIPS = f"""\
Host and peer are processes on a pseudo-terminal: the firmware's core (`wheelwire-fwsim`), or an
echo of 40 lines of C. The *bare host* is the least that Python can do, the same for both: one
thread, `poll`, `os.read`, `os.write`. It sends a ping of {PING_SIZE} bytes; the echo returns it,
the firmware answers with {PONG_SIZE}. The *library* is all of Wheelwire: its pings, from the
clock's reading before the send to the one at the arrival, and a request, from the call in the
application's thread to its return. {round_trips.ROUNDS} interleaved rounds of
{round_trips.EXCHANGES}, each after a pause of {round_trips.PAUSE_S * 1e3:g} ms; medians of the
rounds and of their ratios.
"""
SLOW_LINES = """\
The same with the line's baud rate modelled, against the time that the bytes of both ways take on
it. Two byte times of silence, after which an ESP32's UART reports what came, are not in the model.
"""
CPU = f"""\
CPU of the host's process by the kernel's accounts, medians of {CPU_ROUNDS} interleaved rounds of
{CPU_S:g} s; the idle link {IDLE_S:g} s. The *bare host* reads the same stream and throws it away.
A fast stream that nobody asks for is read every {REST_US / 1e3:g} ms only, unless an answer is
under way. *Decoding* is the codec's time for so many frames, fed one by one. At {SLOW_HZ} states
a second every wake-up finds cold caches; {SLOW_ROUNDS} rounds.
"""


CALLS = f"""\
`set_velocity` returns when its frame is written; nobody is waited for. *Encode and write* is the
least that a program of one thread has to do: the same message through the same encoder, and
`os.write` to the port of another simulated robot, whose process it wakes as well. Each call is
timed by itself, in *tight loops* of {TIGHT}, {TIGHT_LOOPS} of each, and in {BURSTS} *bursts* of
{BURST}, {BURST_PAUSE_S * 1e3:g} ms apart. Interleaved; medians of all calls.
"""


def at_most(what: str, measured: float, limit: float, unit: str = "") -> Target:
    """The limit itself is reached."""
    number, bound = (f"{number:.3g}{unit}" for number in (measured, limit))
    return Target(what, number, f"<= {bound}", measured <= limit)


def show_round_trips() -> list[Target]:
    """Print the round trips without a baud rate."""
    with TemporaryDirectory() as folder:
        found = round_trips.compare(Path(folder))
    echo = found[round_trips.ECHO]
    # Within each round: on a shared machine ratios hold, times do not.
    ratios = {
        name: (ratio(one.p50s_us, echo.p50s_us), ratio(one.p99s_us, echo.p99s_us))
        for name, one in found.items()
    }
    rows = [
        [
            name,
            *(f"{us:.0f}" for us in (one.p50_us, one.p99_us)),
            *(f"{times:.2f}" for times in ratios[name]),
        ]
        for name, one in found.items()
    ]
    header = ("round trip [us]", "p50", "p99", "p50 / echo's", "p99 / echo's")
    sys.stdout.write(f"{ROUND_TRIPS}\n{table(header, rows)}\n")
    p50, p99 = ratios[round_trips.FIRMWARE]
    bare, ping, request = (
        found[name] for name in (round_trips.FIRMWARE, round_trips.PING, round_trips.REQUEST)
    )
    return [
        at_most("p50 of the firmware / the echo's", p50, 1.25),
        at_most("p99 of the firmware / the echo's", p99, 2),
        at_most("p50 of a request / a bare host's ping", ratio(request.p50s_us, bare.p50s_us), 2),
        at_most("p99 of the library's ping / a bare host's", ratio(ping.p99s_us, bare.p99s_us), 2),
    ]


def show_slow_lines() -> list[Target]:
    """Print the round trips at baud rates."""
    rows, targets = [], []
    for baud, found in round_trips.on_slow_lines().items():
        line_us = round_trips.line_us(baud)
        p50, p99 = found.p50_us / line_us, found.p99_us / line_us
        microseconds = (f"{us:.0f}" for us in (line_us, found.p50_us, found.p99_us))
        rows.append([f"{baud} baud", *microseconds, f"{p50:.2f}", f"{p99:.2f}"])
        targets += [
            at_most(f"p50 at {baud} baud / the line's", p50, 1.25),
            at_most(f"p99 at {baud} baud / the line's", p99, 2),
        ]
    header = ("round trip [us]", "on the line", "p50", "p99", "p50 / line's", "p99 / line's")
    sys.stdout.write(f"{SLOW_LINES}\n{table(header, rows)}\n")
    return targets


def library_load(port: str, rate_hz: int, duration_s: float, reads_hz: int = 0) -> Load:
    """Load of an open link, with or without reading samples."""
    with SerialDriver(port, stream_rate_hz=rate_hz) as robot:
        # What opening a link costs is no part of its load.
        time.sleep(SETTLING_S)
        return load_while(lambda: read_for(duration_s, robot, reads_hz))


def idle_load(port: str) -> Load:
    """Load of an open link without state frames."""
    with round_trips.open_without_stream(port):
        time.sleep(SETTLING_S)
        return load_while(lambda: time.sleep(IDLE_S))


def bare_load(port: str) -> Load:
    """Load of a minimal host that reads what the device still sends."""
    with closing(BareHost(port, round_trips.ANY_BAUD)) as host:
        return load_while(lambda: host.discard(CPU_S))


def iterated_load(port: str) -> Load:
    """Load of an open link at the slow rate, with every sample read."""
    with SerialDriver(port, stream_rate_hz=SLOW_HZ) as robot:
        samples = robot.samples()
        time.sleep(SETTLING_S)
        # As many as come in the time of the other measures.
        return load_while(lambda: [next(samples) for _ in range(round(CPU_S * SLOW_HZ))])


def decoding() -> float:
    """CPU of decoding the stream's frames, as a fraction of one core."""
    stream = capture(DECODED)
    # All states have one payload size, so that their frames have one length, too.
    size = len(stream) // DECODED
    frames = [stream[start : start + size] for start in range(0, len(stream), size)]
    decoder = Decoder()
    return RATE_HZ / DECODED * cpu_seconds(lambda: [decoder.feed(frame) for frame in frames])


def show_cpu() -> list[Target]:
    """Print the load of an idle and of a busy link."""
    with Simulator() as simulator:
        port = simulator.port
        idle = idle_load(port)
        # The bare host comes last: it reads the stream that the others have started.
        measures = {
            "library": lambda: library_load(port, RATE_HZ, CPU_S),
            "read": lambda: library_load(port, RATE_HZ, CPU_S, READS_HZ),
            "bare": lambda: bare_load(port),
        }
        loads = in_rounds(measures)
        slow = in_rounds(
            {
                "unread": lambda: library_load(port, SLOW_HZ, CPU_S),
                "read": lambda: iterated_load(port),
                "bare": lambda: bare_load(port),
            },
            SLOW_ROUNDS,
        )
    decode = decoding()
    rows = [
        _load_row("library, idle link (no stream)", idle),
        _load_row(f"bare host, {RATE_HZ} states/s", loads["bare"]),
        [f"decoding {RATE_HZ} states", f"{decode:.2%}", ""],
        _load_row(f"library, {RATE_HZ} states/s, none asked for", loads["library"]),
        _load_row(f"library, {RATE_HZ} states/s, {READS_HZ} reads/s", loads["read"]),
        _load_row(f"bare host, {SLOW_HZ} states/s", slow["bare"]),
        _load_row(f"library, {SLOW_HZ} states/s, none asked for", slow["unread"]),
        _load_row(f"library, {SLOW_HZ} states/s, each read", slow["read"]),
    ]
    sys.stdout.write(f"{CPU}\n{table(('host', 'CPU of a core', 'wake-ups/s'), rows)}\n")
    # The bare host does not decode: its CPU with a margin, and the codec's on top.
    limit = 1.3 * loads["bare"].cpu + decode
    return [
        at_most("CPU of an idle link", 100 * idle.cpu, 0.5, " %"),
        at_most(
            f"CPU at {RATE_HZ} Hz, none asked for", 100 * loads["library"].cpu, 100 * limit, " %"
        ),
        at_most(
            f"CPU at {RATE_HZ} Hz with {READS_HZ} reads/s / the bare host's",
            loads["read"].cpu / loads["bare"].cpu,
            2,
        ),
        at_most(
            f"CPU of a sample at {SLOW_HZ} Hz, unread / the bare host's",
            slow["unread"].cpu / slow["bare"].cpu,
            2.5,
        ),
        at_most(
            f"CPU of a sample at {SLOW_HZ} Hz, read / the bare host's",
            slow["read"].cpu / slow["bare"].cpu,
            3.5,
        ),
    ]


def in_rounds(
    measures: Mapping[str, Callable[[], Load]], count: int = CPU_ROUNDS
) -> dict[str, Load]:
    """The medians of interleaved rounds."""
    rounds = [{name: measure() for name, measure in measures.items()} for _ in range(count)]
    return {
        name: Load(
            median(loads[name].cpu for loads in rounds),
            median(loads[name].wake_ups for loads in rounds),
        )
        for name in measures
    }


def _load_row(name: str, load: Load) -> list[str]:
    return [name, f"{load.cpu:.2%}", f"{load.wake_ups:.0f}"]


def show_calls() -> list[Target]:
    """Print the time that a setpoint takes in the calling thread."""
    encoder = Encoder()
    tight_us: list[list[float]] = [[], []]
    burst_us: list[list[float]] = [[], []]
    with Simulator() as simulator, Simulator() as other, SerialDriver(simulator.port) as robot:
        # Only emptied now and then, and that must not wait.
        line = os.open(other.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        # Raw, as the driver sets a port: otherwise the terminal processes each byte.
        tty.setraw(line)

        def drive() -> None:
            robot.set_velocity(0.1, 0.1)

        def write() -> None:
            with suppress(BlockingIOError):  # full; the library would queue the frame
                os.write(line, encoder.encode(SetWheelVelocity(1, 2, 3, 0.1, 0.2)))

        time.sleep(SETTLING_S)
        for times_us, rounds, calls in (
            (tight_us, TIGHT_LOOPS, TIGHT),
            (burst_us, BURSTS, BURST),
        ):
            for _ in range(rounds):
                for which, work in enumerate((drive, write)):
                    for _ in range(calls):
                        begun = time.perf_counter_ns()
                        work()
                        times_us[which].append((time.perf_counter_ns() - begun) / 1e3)
                    time.sleep(BURST_PAUSE_S)
                    with suppress(BlockingIOError):  # the refusals: the robot knows no session 1
                        while os.read(line, 65_536):
                            pass
        os.close(line)
    tight, least = (median(times_us) for times_us in tight_us)
    burst, burst_least = (median(times_us) for times_us in burst_us)
    rows = [
        ["set_velocity, in a tight loop", f"{tight:.1f}", f"{tight / least:.2f}"],
        ["encode and write, in a tight loop", f"{least:.1f}", "1.00"],
        ["set_velocity, in bursts", f"{burst:.1f}", f"{burst / burst_least:.2f}"],
        ["encode and write, in bursts", f"{burst_least:.1f}", "1.00"],
    ]
    sys.stdout.write(f"{CALLS}\n{table(('call [us]', 'p50', 'p50 / the least'), rows)}\n")
    return [
        at_most("a call of set_velocity in a tight loop", tight, 12, " us"),
        at_most("set_velocity / encode and write, in bursts", burst / burst_least, 3),
    ]


def show_fast_stream() -> list[Target]:
    """Print the losses of a fast stream."""
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
    sys.stdout.write(
        f"{FAST_HZ} states a second, one in each control step, for {FAST_S:g} s: {received} frames "
        f"received, {lost} lost, {load.cpu:.0%} of a core.\n\n"
    )
    return [at_most(f"frames lost at {FAST_HZ} Hz", lost, 0)]


def main() -> int:
    """Measure and print; returns 1 if a target is missed."""
    output_folder(__doc__)
    sys.stdout.write("## The serial link\n\n")
    targets = [
        *show_round_trips(),
        *show_slow_lines(),
        *show_calls(),
        *show_cpu(),
        *show_fast_stream(),
    ]
    sys.stdout.write(table_of_targets(targets))
    return 0 if all(target.reached for target in targets) else 1


if __name__ == "__main__":
    sys.exit(main())
