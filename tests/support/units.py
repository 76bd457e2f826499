"""The units of systemd and containers that the project has, and a process under their conditions.

What `confined` emulates: command, working folder, the environment that systemd gives (no shell's),
a read-only root but for the folders that a unit makes writable, user and groups without rights, no
capability and no new one. What nothing emulates: real-time and memory limits, permissions of
devices, a restart by systemd or Docker, and programs that are not here: pigpiod, `ros2 launch`
itself, Docker's image.
"""

from __future__ import annotations

import grp
import re
import shlex
from dataclasses import dataclass
from typing import Any

import yaml

from .confined import NOBODY, World
from .pages import PAGES, ROOT

_BLOCK = re.compile(r"^```ini\n(.*?)^```$", re.MULTILINE | re.DOTALL)
DOCKER = ROOT / "ros_node" / "docker"
COMPOSE = DOCKER / "docker-compose.pi.yml"
EMULATED = {
    *("ExecStart", "User", "Group", "SupplementaryGroups", "WorkingDirectory", "Environment"),
    *("RuntimeDirectory", "StateDirectory", "ProtectSystem", "NoNewPrivileges"),
    *("KillSignal", "KillMode", "TimeoutStopSec"),
}
NOT_EMULATED = {
    *("LimitRTPRIO", "LimitMEMLOCK", "UMask", "Restart", "RestartSec", "RuntimeDirectoryPreserve"),
}
"""Entries of units whose effect no process of a test has."""


@dataclass(frozen=True)
class Unit:
    """A unit.

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
        """What systemd gives a service of the system, and the entries Environment."""
        given = {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin", "LANG": "C.UTF-8"}
        if "User" in self.service:
            user = self.service["User"]
            given |= {"USER": user, "LOGNAME": user, "HOME": f"/home/{user}", "SHELL": "/bin/sh"}
        if "RuntimeDirectory" in self.service:
            given["RUNTIME_DIRECTORY"] = f"/run/{self.service['RuntimeDirectory']}"
        return given | _assigned(shlex.split(self.service.get("Environment", "")))

    def world(self) -> World:
        """A world with its user, its groups and its folders."""
        others = self.service.get("SupplementaryGroups", "").split()
        groups = [group_id(name) for name in (self.service.get("Group", ""), *others)]
        world = World(groups=groups)
        for folder in self.writable:
            world.add_folder(folder)
        return world


def documented_units() -> list[Unit]:
    """All of them."""
    texts = [
        (str(page), text)
        for page in PAGES
        for text in _BLOCK.findall((ROOT / page).read_text("utf-8"))
    ]
    files = sorted((ROOT / "ros_node").rglob("*.service"))
    texts += [(str(file.relative_to(ROOT)), file.read_text("utf-8")) for file in files]
    return [Unit(page, _service(text)) for page, text in texts if "[Service]" in text]


def _service(text: str) -> dict[str, str]:
    """The entries of [Service]; those that a unit may repeat are joined."""
    entries: dict[str, str] = {}
    for line in text.partition("[Service]")[2].partition("\n[")[0].splitlines():
        key, _, value = line.partition("=")
        if value and not line.startswith("#") and key == "Environment" and key in entries:
            entries[key] += f" {value}"
        elif not line.startswith("#") and line:
            entries[key] = value
    return entries


def group_id(name: str) -> int:
    """The number of a group; nobody's if this computer does not have it."""
    try:
        return grp.getgrnam(name).gr_gid
    except KeyError:
        return NOBODY


def _assigned(entries: list[str]) -> dict[str, str]:
    return {name: value for name, _, value in (one.partition("=") for one in entries)}


# --- containers ---------------------------------------------------------------------------------


def services(**environment: str) -> dict[str, Any]:
    """The compose file's services, with the environment's values where it asks for them."""
    text = COMPOSE.read_text()
    text = re.sub(r"\$\{(\w+):-([^}]*)\}", lambda m: environment.get(m[1]) or m[2], text)
    assert "${" not in text, "another form of interpolation"
    return dict(yaml.safe_load(text)["services"])


@dataclass(frozen=True)
class Image:
    """What the Dockerfile says of a process.

    Attributes:
        folder: The working folder.
        environment: Its variables.
        entrypoint: Begins each command.
        files: From a path in the image to one below ros_node/docker.
    """

    folder: str
    environment: dict[str, str]
    entrypoint: list[str]
    files: dict[str, str]


def image() -> Image:
    """The image of the compose file's services."""
    text = (DOCKER / "Dockerfile").read_text()
    copied = re.findall(r"^COPY (?:--chmod=\S+ )?ros_node/docker/(\S+) (\S+)$", text, re.MULTILINE)
    entrypoint = re.search(r'^ENTRYPOINT \["(.+)"\]$', text, re.MULTILINE)
    assert entrypoint
    return Image(
        re.findall(r"^WORKDIR (\S+)$", text, re.MULTILINE)[-1],
        {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"}
        | _assigned(re.findall(r"^ENV (\S+=\S+)$", text, re.MULTILINE)),
        [entrypoint[1]],
        {inside: file for file, inside in copied},
    )
