"""Control quality of the firmware on the simulated robot, in virtual time: `make bench`."""

from __future__ import annotations

import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support import control_quality as quality
from support.benchmark import output_folder, table

METHOD = """\
The firmware's velocity loop on the simulated robot, in virtual time: the same at every run.
"""


def rows() -> list[tuple[str, str, str]]:
    """(measure, value, target) triples."""
    step = quality.velocity_step()
    dip, recovery_s = quality.load_step()
    rough = quality.CRAWL_EDGE_ERROR_TICKS
    return [
        (
            "0 to 0.3 m/s: settled within 5 %",
            f"{step.settling_s:.3f} s (the acceleration limit alone: {step.slew_s:.3f} s)",
            "",
        ),
        ("0 to 0.3 m/s: overshoot", f"{step.overshoot:.1%}", ""),
        ("ripple at 0.03 m/s, even edges", f"{quality.crawl_ripple():.1%}", "< 5 %"),
        (
            f"ripple at 0.03 m/s, edges off by {rough} ticks",
            f"{quality.crawl_ripple(edge_error_ticks=rough):.1%}",
            "< 5 %",
        ),
        ("load of 0.02 N m at 0.2 m/s: dip", f"{dip:.1%}", ""),
        ("load of 0.02 N m at 0.2 m/s: recovered after", f"{recovery_s:.3f} s", ""),
        (
            "5 s straight with one motor 15 % weaker",
            f"{math.degrees(quality.straightness()):.2f} deg off",
            "",
        ),
    ]


def main() -> None:
    """Print the table."""
    output_folder(__doc__)
    found = table(("measure", "value", "target"), rows())
    sys.stdout.write(f"## Control quality\n\n{METHOD}\n{found}")


if __name__ == "__main__":
    main()
