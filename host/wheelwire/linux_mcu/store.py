"""The file of saved parameters: replaced as a whole, and converted if an earlier release wrote it.

Earlier releases wrote JSON; the core reads and writes a format of its own.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

from wheelwire_protocol.codes import Chip
from wheelwire_protocol.native import Core, Identity, NativeMissingError
from wheelwire_protocol.parameters import PARAMETER_BY_NAME
from wheelwire_protocol.types import ParameterSave, ParameterSet

from ..errors import ConfigurationError, DriverUnavailable, WheelwireError
from ..link.requests import Answer, RequestMessage
from ..link.session import Phase, Session
from ..parameters import checked_value

PERIOD_US = 1000
ANSWER_TIMEOUT_US = 10_000_000


def write_whole(path: Path, content: bytes) -> None:
    """Replace the content of `path`: after a crash the old content or the new one is there."""
    # In the same folder: only within one file system is a rename atomic.
    new = path.with_name(path.name + ".new")
    with new.open("wb") as file:
        file.write(content)
        file.flush()
        # Without it a power cut may leave the new name with nothing behind it.
        os.fsync(file.fileno())
    new.replace(path)


def converted_store(path: Path) -> Path:
    """Convert the content of `path` if necessary; returns the absolute path.

    Raises:
        ConfigurationError: The file cannot be read or written, or is JSON of something else.
        DriverUnavailable: The core's library is missing.
    """
    path = path.absolute()
    try:
        content = path.read_bytes() if path.exists() else b""
    except OSError as error:
        raise _unusable(path, error) from error
    # The core's own format begins with other bytes, "WWP1".
    if content.lstrip()[:1] in (b"{", b"["):
        block = _block(_parse(path, content))
        try:
            write_whole(path, block)
        except OSError as error:
            raise _unusable(path, error) from error
    return path


def _unusable(path: Path, error: OSError) -> ConfigurationError:
    return ConfigurationError(
        f"{path}: {error.strerror}: correct the path of the store or its permissions"
    )


def _parse(path: Path, content: bytes) -> dict[str, float]:
    try:
        return {name: checked_value(name, value) for name, value in json.loads(content).items()}
    except AttributeError as error:
        # JSON, but no object: it has no items().
        raise ConfigurationError(
            f"{path}: not a JSON object of parameters; correct the file or delete it"
        ) from error
    except (ValueError, TypeError, WheelwireError) as error:
        raise ConfigurationError(f"{path}: {error}; correct the file or delete it") from error


def _block(values: dict[str, float]) -> bytes:
    """The core's format: a temporary core is asked over a session to save these values."""
    saved: list[bytes] = []

    def save(block: bytes) -> bool:
        saved.append(block)
        return True

    try:
        # All parameters are saved: those that are not named get a Linux computer's defaults.
        core = Core(Identity(boot_id=1, board=Chip.LINUX), b"", save)
    except NativeMissingError as error:
        raise DriverUnavailable(str(error)) from error
    host = CoreHost(core)
    for name, value in values.items():
        host.ask(ParameterSet(0, 0, PARAMETER_BY_NAME[name].id, value))
    host.ask(ParameterSave(0, 0, 0))
    return saved[-1]


class CoreHost:
    """A session with a core in this process, in virtual time."""

    def __init__(self, core: Core) -> None:
        self._core = core
        self._now_us = 0
        # Any nonce will do: nobody else is on this line.
        self._session = Session(lambda: 1)
        core.start(0, 0, 0)
        self._session.connect(0)
        while self._session.phase is not Phase.OPEN:
            self._turn()

    def ask(self, message: RequestMessage) -> None:
        """Send a request and wait for its answer."""
        answers: list[Answer | WheelwireError] = []
        self._session.request(message, answers.append, self._now_us)
        while not answers:
            self._turn()
        if isinstance(answers[0], WheelwireError):
            raise answers[0]

    def _turn(self) -> None:
        if self._now_us > ANSWER_TIMEOUT_US:
            raise DriverUnavailable(
                "the core does not answer, as if its library were of another release: reinstall "
                "wheelwire"
            )
        self._now_us += PERIOD_US
        self._session.advance(self._now_us)
        self._core.feed(self._session.take_output())
        self._core.step(self._now_us, 0, 0)
        self._session.receive(self._core.take(), self._now_us)
