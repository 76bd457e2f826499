"""The demonstration: a simulated robot driven through the public API, and what it measured."""

from .report import Report as Report
from .scenario import run as run
