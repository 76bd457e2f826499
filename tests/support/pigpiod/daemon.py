"""The daemon's socket: requests of 16 bytes and an extension, answers of 16 bytes."""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Callable
from contextlib import suppress

from support.bare_robot import BareRobot, clock_us
from support.pigpiod.pins import BAD_FILTER, PinBank
from support.pigpiod.reports import Notification, Sampler
from support.pigpiod.scripts import PARAMETERS, Script
from wheelwire.board import Configuration

REQUEST = struct.Struct("<IIII")
ANSWER = struct.Struct("<IIIi")
UNKNOWN_COMMAND = -88
BAD_SCRIPT_ID = -48
NO_SCRIPT_ROOM = -57
BAD_HANDLE = -25
SCRIPTS = 32
LONGEST_FILTER_US = 300_000

MODES, PUD, READ, WRITE, PWM, PRS, PFS = 0, 2, 3, 4, 5, 6, 7
BR1, NB, NC, PFG, PRRG = 10, 19, 21, 23, 24
PROC, PROCD, PROCR, PROCP = 38, 39, 40, 45
HP, FG, NOIB, PROCU = 86, 97, 99, 117

Handler = Callable[[int, int, bytes], int]


class Daemon:
    """Moves the robot behind its pins as they say, and reports its encoders' levels.

    Args:
        bank: The pins.
        board: What is connected to them.
    """

    def __init__(self, bank: PinBank, board: Configuration) -> None:
        self.bank = bank
        self.robot = BareRobot(board)
        self._writer = ""
        """Who writes pins: a client, or a script inside the daemon."""
        self._encoder_bits = sum(1 << gpio for gpio in self.robot.encoders)
        self._sampler = Sampler(bank.levels)
        self._scripts: dict[int, Script] = {}
        self._notifications: dict[int, Notification] = {}
        self._connections: list[socket.socket] = []
        self._listener: socket.socket | None = None
        self._lock = threading.Lock()
        self._handlers: dict[int, Handler] = {
            MODES: lambda gpio, *_: bank.set_mode(gpio),
            PUD: lambda gpio, pull, _: bank.set_pull(gpio, pull),
            READ: lambda gpio, *_: int(bank.level(gpio)),
            WRITE: lambda gpio, level, _: bank.write(gpio, level),
            PWM: lambda gpio, duty, _: bank.set_dma_duty(gpio, duty),
            PRS: lambda gpio, full, _: bank.set_dma_range(gpio, full),
            PFS: lambda gpio, hz, _: bank.set_dma_frequency(gpio, hz),
            PFG: lambda gpio, *_: bank.pwm_frequency(gpio),
            PRRG: lambda gpio, *_: bank.real_range(gpio),
            BR1: lambda *_: bank.levels,
            HP: lambda gpio, hz, ext: bank.hardware_pwm(gpio, hz, *struct.unpack("<I", ext)),
            FG: lambda _, steady, __: 0 if steady <= LONGEST_FILTER_US else BAD_FILTER,
            NB: self._on_bits,
            NC: lambda *_: 0,
            PROC: self._on_store,
            PROCD: self._on_delete,
            PROCR: self._on_run,
            PROCU: self._on_update,
        }

    def advance(self) -> None:
        """What happens each millisecond."""
        now_us = clock_us()
        self.apply_pins()
        samples = self._sampler.sample(self.robot.advance())
        encoders = self._encoder_bits
        self.bank.levels = self.bank.levels & ~encoders | self._sampler.levels & encoders
        with self._lock:
            for notification in self._notifications.values():
                if notification.bits and samples.size:
                    notification.add(samples, now_us)
                notification.flush(now_us)

    def apply_pins(self) -> None:
        """Apply the outputs' levels to the stages as soon as they change."""
        self.robot.set_pins(self.bank.enable, self._writer)

    def listen(self, port: int) -> int:
        """Accept clients; returns the port, found when 0 is asked for."""
        self._listener = socket.create_server(("127.0.0.1", port))
        threading.Thread(target=self._accept, args=(self._listener,), daemon=True).start()
        return int(self._listener.getsockname()[1])

    def refuse(self) -> None:
        """Close all connections and accept no new ones, as when the network fails."""
        if self._listener:
            self._listener.shutdown(socket.SHUT_RDWR)
            self._listener.close()
        with self._lock:
            for connection in self._connections:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)

    def _accept(self, listener: socket.socket) -> None:
        with suppress(OSError):
            while True:
                connection, _ = listener.accept()
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                with self._lock:
                    self._connections.append(connection)
                threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        opened: list[int] = []
        with suppress(OSError, EOFError):
            while True:
                command, p1, p2, size = REQUEST.unpack(_receive(connection, REQUEST.size))
                extension = _receive(connection, size)
                if command == NOIB:
                    opened.append(self._open_notification(connection))
                    connection.sendall(ANSWER.pack(command, p1, p2, opened[-1]))
                elif command == PROCP:
                    connection.sendall(self._script_status(p1, p2))
                else:
                    result = self._do(command, p1, p2, extension)
                    connection.sendall(ANSWER.pack(command, p1, p2, result))
        with self._lock:
            for handle in opened:
                del self._notifications[handle]
            self._connections.remove(connection)
        connection.close()

    def _do(self, command: int, p1: int, p2: int, extension: bytes) -> int:
        handler = self._handlers.get(command)
        if handler is None:
            return UNKNOWN_COMMAND
        self._writer = "client"
        result = handler(p1, p2, extension)
        self.apply_pins()
        return result

    # --- notifications -------------------------------------------------------------------------

    def _open_notification(self, connection: socket.socket) -> int:
        with self._lock:
            handle = next(h for h in range(32) if h not in self._notifications)
            self._notifications[handle] = Notification(connection)
            return handle

    def _on_bits(self, handle: int, bits: int, _: bytes) -> int:
        if handle not in self._notifications:
            return BAD_HANDLE
        self._notifications[handle].bits = bits
        return 0

    # --- scripts -------------------------------------------------------------------------------

    def _on_store(self, _: int, __: int, text: bytes) -> int:
        with self._lock:
            free = [i for i in range(SCRIPTS) if i not in self._scripts]
            if not free:
                return NO_SCRIPT_ROOM
            self._scripts[free[0]] = Script(text.decode(), self._write_from_script)
            return free[0]

    def _write_from_script(self, gpio: int, level: int) -> None:
        self._writer = "script"
        self.bank.write(gpio, level)
        self.apply_pins()

    def _on_run(self, script: int, _: int, parameters: bytes) -> int:
        return self._with_script(script, lambda known: known.run(_words(parameters)))

    def _on_update(self, script: int, _: int, parameters: bytes) -> int:
        return self._with_script(script, lambda known: known.update(_words(parameters)))

    def _with_script(self, script: int, act: Callable[[Script], None]) -> int:
        if script not in self._scripts:
            return BAD_SCRIPT_ID
        act(self._scripts[script])
        return 0

    def _on_delete(self, script: int, _: int, __: bytes) -> int:
        result = self._with_script(script, Script.stop)
        self._scripts.pop(script, None)
        return result

    def _script_status(self, script: int, p2: int) -> bytes:
        found = self._scripts.get(script)
        if found is None:
            return ANSWER.pack(PROCP, script, p2, BAD_SCRIPT_ID)
        words = struct.pack(f"<{PARAMETERS + 1}i", found.status, *found.parameters)
        return ANSWER.pack(PROCP, script, p2, len(words)) + words


def _words(data: bytes) -> list[int]:
    return list(struct.unpack(f"<{len(data) // 4}i", data))


def _receive(connection: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size:
        part = connection.recv(size - len(data))
        if not part:
            raise EOFError
        data += part
    return data
