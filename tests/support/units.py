"""The units of systemd in the documentation, and a process under the conditions of one.

What is emulated: command, working folder, the environment that systemd gives (no HOME of a user
without one, no shell), the folders that the unit makes writable, and a user without rights where
the tests run as root. What is not: capabilities, memory and real-time limits, device permissions,
and the mount namespaces of ProtectSystem and its like.
"""

from __future__ import annotations

import configparser
import os
import re
import shlex
from dataclasses import dataclass

from .pages import PAGES, ROOT

_BLOCK = re.compile(r"^```ini\n(.*?)^```$", re.MULTILINE | re.DOTALL)
NOT_EMULATED = {"LimitRTPRIO", "LimitMEMLOCK", "UMask", "SupplementaryGroups"}
"""Entries of documented units whose effect no process of a test has."""


@dataclass(frozen=True)
class Unit:
    """A documented unit.

    Attributes:
        page: Where it is.
        service: The section [Service].
    """

    page: str
    service: dict[str, str]

    @property
    def command(self) -> list[str]:
        """What it starts; empty for a unit that only adds to a packaged one."""
        return shlex.split(self.service.get("ExecStart", ""))

    @property
    def writable(self) -> list[str]:
        """The folders that systemd makes for it."""
        places = {"RuntimeDirectory": "/run", "StateDirectory": "/var/lib"}
        return [f"{places[key]}/{self.service[key]}" for key in places if key in self.service]

    @property
    def folder(self) -> str:
        """The working folder; systemd's own default is the root."""
        return self.service.get("WorkingDirectory", "/")

    @property
    def environment(self) -> dict[str, str]:
        """What systemd gives a service of the system, beside the entries Environment."""
        given = {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin", "LANG": "C.UTF-8"}
        if "RuntimeDirectory" in self.service:
            given["RUNTIME_DIRECTORY"] = f"/run/{self.service['RuntimeDirectory']}"
        own = (one.partition("=") for one in shlex.split(self.service.get("Environment", "")))
        return given | {name: value for name, _, value in own}


def documented_units() -> list[Unit]:
    """All of them."""
    found = []
    for page in PAGES:
        for text in _BLOCK.findall((ROOT / page).read_text("utf-8")):
            parser = configparser.ConfigParser(strict=False, interpolation=None)
            parser.optionxform = str  # type: ignore[method-assign, assignment]
            parser.read_string(text)
            if parser.has_section("Service"):
                found.append(Unit(page, dict(parser["Service"])))
    return found


def without_rights() -> int | None:
    """A user who may write nowhere, if the tests may become one."""
    return 65534 if os.getuid() == 0 else None
