"""Control quality.

The firmware's velocity loop on the simulated robot, in virtual time.
"""

from __future__ import annotations

import math

from harness import Report, run
from support import control_quality as quality


def main(report: Report) -> None:
    """Print the list."""
    step = quality.velocity_step()
    dip, recovery_s = quality.load_step()
    rough = quality.CRAWL_EDGE_ERROR_TICKS
    settled = f"{step.settling_s:.3f} s (the acceleration limit alone: {step.slew_s:.3f} s)"
    ripple = quality.crawl_ripple(edge_error_ticks=rough)
    turned = math.degrees(quality.straightness())
    rows = [
        f"0 to 0.3 m/s, settled within 5 % | {settled}",
        f"0 to 0.3 m/s, overshoot | {step.overshoot:.1%}",
        f"ripple at 0.03 m/s, even edges | {quality.crawl_ripple():.1%} | target < 5 %",
        f"ripple at 0.03 m/s, edges off by {rough} ticks | {ripple:.1%} | target < 5 %",
        f"load of 0.02 N m at 0.2 m/s, dip | {dip:.1%}",
        f"load of 0.02 N m at 0.2 m/s, recovered after | {recovery_s:.3f} s",
        f"5 s straight with one motor 15 % weaker | {turned:.2f} deg off",
    ]
    report.items(rows)


run(main)
