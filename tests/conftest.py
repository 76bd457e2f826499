"""For all tests. Hypothesis measures no time: it says how busy the computer is."""

from __future__ import annotations

import os

from hypothesis import HealthCheck, settings

os.environ.pop("WHEELWIRE_ROBOT", None)  # the robot of whoever runs the tests is none of theirs

settings.register_profile("wheelwire", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("wheelwire")
