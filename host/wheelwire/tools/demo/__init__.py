"""The demonstration: drives a simulated robot through the public API and measures it.

`scenario` opens simulator and driver, drives, hangs on purpose, and reports what was measured.
`figure` says which velocity to command when. `display` shows the run live and plots it at the end.
Data flow: figure -> setpoints -> driver -> simulated robot; its samples go through the odometry to
the display; the simulator's true states go into the `Report`.
"""

from .scenario import Report as Report
from .scenario import run as run
