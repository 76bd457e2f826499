"""Two clocks with a bad line between them, to test the estimate of one by the other."""

from __future__ import annotations

from dataclasses import dataclass, field
from operator import gt
from random import Random

from wheelwire.link.clock import ClockEstimator, Exchange

BURST = 8
BURST_GAP_US = 5_000
GAP_US = 500_000
"""The session's ping period."""
PROBES = 10
"""Samples between two exchanges that are converted and checked."""


@dataclass(frozen=True)
class LineDelays:
    """The delays of the line in each direction.

    Attributes:
        out_us: Minimum towards the device.
        back_us: Minimum towards the host.
        jitter_us: Mean of an exponentially distributed addition.
        burst: Probability of a further delay of up to `burst_us`.
        burst_us: See `burst`.
    """

    out_us: float = 200.0
    back_us: float = 900.0
    jitter_us: float = 300.0
    burst: float = 0.02
    burst_us: float = 20_000.0


USB = LineDelays()
SHORT_DELAYS = LineDelays(100.0, 100.0, 20.0, 0.0, 0.0)
LONG_DELAYS = LineDelays(200.0, 900.0, 3_000.0, 0.2, 50_000.0)


class Clocks:
    """A device clock with constant drift, and a line with asymmetric delays and jitter."""

    def __init__(self, seed: int, drift: float, ways: LineDelays = USB) -> None:
        self.random = Random(seed)
        self.drift = drift
        self.ways = ways
        self.offset_us = self.random.randrange(10**12)

    def device_us(self, host_us: float) -> int:
        """The device's clock at the host's `host_us`."""
        return int(host_us * (1 + self.drift)) + self.offset_us

    def way_us(self, base_us: float) -> float:
        """One delay."""
        ways, random = self.ways, self.random
        jitter_us = random.expovariate(1 / ways.jitter_us)
        burst_us = random.random() < ways.burst and random.uniform(0, ways.burst_us)
        return base_us + jitter_us + float(burst_us)

    def exchange(self, host_us: int) -> Exchange:
        """The exchange of a ping sent at the host's `host_us`."""
        received = host_us + self.way_us(self.ways.out_us)
        sent = received + self.random.uniform(5, 100)
        back = sent + self.way_us(self.ways.back_us)
        device = self.device_us(received), self.device_us(sent)
        return Exchange(host_us, *device, int(back))


@dataclass
class Coverage:
    """The errors of all converted samples, and their bounds."""

    errors_us: list[float] = field(default_factory=list)
    bounds_us: list[float] = field(default_factory=list)

    @property
    def missed(self) -> int:
        """The number of samples with an error beyond their bound."""
        return sum(map(gt, self.errors_us, self.bounds_us))

    @property
    def share(self) -> float:
        """The fraction of samples within their bound."""
        return 1 - self.missed / len(self.errors_us)


def session(
    coverage: Coverage, clocks: Clocks, exchanges: int = 200, step_us: int = 0, steps: int = 0
) -> None:
    """Ping as a session does, and convert samples in between.

    Args:
        coverage: Receives the results.
        clocks: The two.
        exchanges: Pings that are answered.
        step_us: Size of the device clock's jumps, in alternating directions.
        steps: Number of jumps, evenly spread, each just before an exchange: until then nobody
            could notice it.
    """
    estimator = ClockEstimator()
    now = 10**9
    every = exchanges // (steps + 1)
    for number in range(exchanges):
        if steps and number and number % every == 0:
            clocks.offset_us += step_us
            step_us = -step_us
        estimator.add(clocks.exchange(now))
        gap = BURST_GAP_US if number < BURST else GAP_US
        for _ in range(PROBES):
            moment = now + 25_000 + clocks.random.randrange(gap)
            host_us, bound_us = estimator.conversion.device_to_host(clocks.device_us(moment))
            coverage.errors_us.append(abs(host_us - moment))
            coverage.bounds_us.append(bound_us)
        now += gap
