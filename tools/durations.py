"""Seconds and tests of each folder, and the slowest tests, from pytest's own report.

make test-all PYTEST_ADDOPTS="--durations=0 -vv" | .venv/bin/python tools/durations.py
"""

import re
import sys
from collections import defaultdict

SLOWEST = 10
LINE = re.compile(r"([\d.]+)s (?:call|setup|teardown) +(tests/(?:(\w+)/)?.+)")


def main() -> None:
    """Print both tables."""
    seconds: defaultdict[str, float] = defaultdict(float)
    by_folder: defaultdict[str, float] = defaultdict(float)
    tests: dict[str, set[str]] = {}
    for line in sys.stdin:
        found = LINE.match(line)
        if found is None:
            continue
        took, test, folder = float(found[1]), str(found[2]).strip(), str(found[3] or "tests")
        seconds[test] += took
        by_folder[folder] += took
        tests.setdefault(folder, set()).add(test)
    print("| folder | tests | seconds |\n| -- | -- | -- |")
    for folder, total in sorted(by_folder.items()):
        print(f"| `{folder}` | {len(tests[folder])} | {total:.0f} |")
    print("\n| test | seconds |\n| -- | -- |")
    for test, total in sorted(seconds.items(), key=lambda item: -item[1])[:SLOWEST]:
        print(f"| `{test.removeprefix('tests/')}` | {total:.0f} |")


if __name__ == "__main__":
    main()
