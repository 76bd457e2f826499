"""The scripts that run inside the daemon: the part of their language that is used."""

from __future__ import annotations

import threading
from collections.abc import Callable

HALTED, RUNNING = 1, 2
PARAMETERS = 10
ARGUMENTS = {"tag": 1, "mils": 1, "dcr": 1, "jp": 1, "jmp": 1, "w": 2, "halt": 0}
"""Number of operands of each instruction."""
Write = Callable[[int, int], None]


class Script:
    """A stored script, with its thread while it runs."""

    def __init__(self, text: str, write: Write) -> None:
        words = text.lower().split()
        self._program: list[tuple[str, list[str]]] = []
        while words:
            name = words.pop(0)
            count = ARGUMENTS[name]
            self._program.append((name, words[:count]))
            del words[:count]
        self._labels = {a[0]: i for i, (name, a) in enumerate(self._program) if name == "tag"}
        self._write = write
        self._halt = threading.Event()
        self._thread: threading.Thread | None = None
        self.parameters = [0] * PARAMETERS

    @property
    def status(self) -> int:
        return RUNNING if self._thread and self._thread.is_alive() else HALTED

    def update(self, parameters: list[int]) -> None:
        self.parameters[: len(parameters)] = parameters

    def run(self, parameters: list[int]) -> None:
        self.update(parameters)
        if self.status is RUNNING:
            return
        self._halt.clear()
        self._thread = threading.Thread(target=self._execute, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        self._halt.set()
        if self._thread:
            self._thread.join()

    def _execute(self) -> None:
        counter, flag = 0, 0
        while not self._halt.is_set():
            name, arguments = self._program[counter]
            counter += 1
            if name == "mils":
                self._halt.wait(int(arguments[0]) / 1000)
            elif name == "dcr":
                index = int(arguments[0].removeprefix("p"))
                self.parameters[index] -= 1
                flag = self.parameters[index]
            elif name == "jmp" or (name == "jp" and flag >= 0):
                counter = self._labels[arguments[0]]
            elif name == "w":
                self._write(int(arguments[0]), int(arguments[1]))
            elif name == "halt":
                return
