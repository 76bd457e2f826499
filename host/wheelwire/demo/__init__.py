"""The demonstration: drives a simulated robot through the public API and measures it."""

from .report import Report as Report
from .scenario import run as run
