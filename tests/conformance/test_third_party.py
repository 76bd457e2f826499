"""The conformance suite as the author of another driver runs it, with the least that is needed."""

import subprocess
import sys
from pathlib import Path

from support.pages import blocks

STAND_IN = """
from wheelwire.drivers.mock import MockDriver

def MyDriver(_host, _port):
    return MockDriver(realtime=False)
"""


def test_a_bench_that_only_opens_is_enough_for_most_of_it(tmp_path: Path) -> None:
    (least,) = (b.text for b in blocks("docs/drivers.md") if "DriverConformance" in b.text)
    (tmp_path / "test_mine.py").write_text(least, "utf-8")
    (tmp_path / "my_package").mkdir()
    (tmp_path / "my_package" / "driver.py").write_text(STAND_IN, "utf-8")
    command = [sys.executable, "-m", "pytest", "-rs", "-p", "no:cacheprovider", "test_mine.py"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout
    assert "29 passed, 9 skipped" in result.stdout
    for lack in ("cut the link", "see the bridge", "break an encoder", "count the true ticks"):
        assert lack in result.stdout
