"""Fuzz everything for a while: `make fuzz SECONDS=...` gives each target so much time."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from rich.console import Console

from support import fuzzing

CONSOLE = Console(markup=False, highlight=False)
ATHERIS = Path(__file__).with_name("atheris_decoder.py")


def summary(text: str) -> str:
    """What libFuzzer says of its coverage and its runs, in the end."""
    covered = re.findall(r"cov: \d+", text)
    runs = re.findall(r"Done (\d+) runs", text)
    return f"{runs[-1] if runs else 'no'} runs, {covered[-1] if covered else 'no cov'}"


def report(name: str, result: subprocess.CompletedProcess[str]) -> bool:
    passed = result.returncode == 0
    CONSOLE.print(f"{name:12} {'ok' if passed else 'FAILED'}, {summary(result.stderr)}")
    if not passed:
        CONSOLE.print(result.stderr[-4000:])
    return passed


def fuzz_host_decoder(seconds: float) -> bool:
    """The host's decoder against the firmware's, guided by the coverage of the host's."""
    if importlib.util.find_spec("atheris") is None:
        CONSOLE.print("host decoder skipped: atheris is not installed")
        return True
    corpus = fuzzing.BUILD / "corpus" / "host-decoder"
    corpus.mkdir(parents=True, exist_ok=True)
    limits = [f"-max_total_time={seconds:g}", f"-artifact_prefix={fuzzing.BUILD}/host-decoder-"]
    command = [sys.executable, str(ATHERIS), *limits, str(corpus), str(fuzzing.seed("decoder"))]
    return report(
        "host decoder", subprocess.run(command, capture_output=True, text=True, check=False)
    )


def main() -> int:
    seconds = float(sys.argv[1])
    # A fuzzer is one process: each processor has one at a time.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        runs = {target: pool.submit(fuzzing.fuzz, target, seconds) for target in fuzzing.TARGETS}
        decoder = pool.submit(fuzz_host_decoder, seconds)
        results = [report(target, run.result()) for target, run in runs.items()]
        return 0 if all([*results, decoder.result()]) else 1


if __name__ == "__main__":
    sys.exit(main())
