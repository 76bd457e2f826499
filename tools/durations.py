"""Seconds and tests of each folder, and the slowest tests, from pytest's own report.

make test-all PYTEST_ADDOPTS="--durations=0 -vv" | .venv/bin/python tools/durations.py
"""

import re
import sys
from collections import Counter

SLOWEST = 20
LINE = re.compile(r"([\d.]+)s (?:call|setup|teardown) +(tests/(?:(\w+)/)?.+)")


def main() -> None:
    """Print both tables."""
    seconds: Counter[str] = Counter()
    by_folder: Counter[str] = Counter()
    tests: dict[str, set[str]] = {}
    for line in sys.stdin:
        found = LINE.match(line)
        if found is None:
            continue
        folder = found[3] or "tests"
        seconds[found[2].strip()] += float(found[1])
        by_folder[folder] += float(found[1])
        tests.setdefault(folder, set()).add(found[2].strip())
    print("| folder | tests | seconds |\n| -- | -- | -- |")
    for folder, total in sorted(by_folder.items()):
        print(f"| `{folder}` | {len(tests[folder])} | {total:.0f} |")
    print("\n| test | seconds |\n| -- | -- |")
    for test, total in seconds.most_common(SLOWEST):
        print(f"| `{test.removeprefix('tests/')}` | {total:.0f} |")


if __name__ == "__main__":
    main()
