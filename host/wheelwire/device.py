"""Who is at either end of the link."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from wheelwire_protocol.codes import Board, Capability, ResetReason
from wheelwire_protocol.schema import PROTOCOL_VERSION, schema_hash
from wheelwire_protocol.types import DeviceHello

from .errors import Release


@dataclass(frozen=True)
class DeviceInfo:
    """What a device says of itself.

    Attributes:
        release: Its firmware's version, protocol version and schema hash.
        git_hash: First 8 hex digits of the firmware's commit; empty when unknown.
        board: What the firmware runs on.
        board_id: The chip's MAC address, as 12 hex digits.
        boot_id: Random at each reset.
        reset_reason: Why it last started.
        capabilities: What it can do, and what it holds for its host.
    """

    release: Release
    git_hash: str
    board: Board
    board_id: str
    boot_id: int
    reset_reason: ResetReason
    capabilities: Capability

    @property
    def has_core_dump(self) -> bool:
        """Whether its flash held the core dump of a crash when it last started."""
        return Capability.CORE_DUMP in self.capabilities

    @classmethod
    def from_hello(cls, hello: DeviceHello) -> DeviceInfo:
        """Read a hello of our own schema.

        Raises:
            ValueError: It has a code that means nothing.
        """
        return cls(
            release=device_release(hello),
            git_hash=f"{hello.git_hash:08x}" if hello.git_hash else "",
            board=Board(hello.board),
            board_id=f"{hello.board_id:012x}",
            boot_id=hello.boot_id,
            reset_reason=ResetReason(hello.reset_reason),
            capabilities=Capability(hello.capabilities),
        )


class BootHistory:
    """Which boot ids a device had, so that a late frame of a former one is no news of a reset."""

    def __init__(self) -> None:
        self.resets = 0
        self._boots: deque[int] = deque(maxlen=8)

    def enter(self, boot_id: int) -> None:
        """A session with this boot was opened."""
        if self.is_new(boot_id):
            self.resets += bool(self._boots)
            self._boots.append(boot_id)

    def is_new(self, boot_id: int) -> bool:
        """True for a boot not heard of yet."""
        return boot_id not in self._boots


def device_release(hello: DeviceHello) -> Release:
    """The device's side of a comparison; readable in every protocol version."""
    firmware = f"{hello.version_major}.{hello.version_minor}.{hello.version_patch}"
    return Release(hello.protocol_version, hello.schema_hash, firmware)


def host_release() -> Release:
    """This library's side of a comparison."""
    return Release(PROTOCOL_VERSION, schema_hash(), library_version())


def library_version() -> str:
    """The version of the installed distribution; `unknown` in an uninstalled checkout."""
    from importlib import metadata  # here, for it is slow to import

    try:
        return metadata.version("wheelwire")
    except metadata.PackageNotFoundError:
        return "unknown"
