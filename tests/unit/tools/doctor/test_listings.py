"""Problems as people listed them in public threads, each laid over a healthy computer."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from wheelwire.tools.doctor import Machine, examine
from wheelwire.tools.doctor.machine import Node

# --- computers made up of a few lines of YAML ----------------------------------------------------


_NODE = re.compile(
    r"c(?P<mode>[r-][w-].[r-][w-].[r-][w-].) \d+ root (?P<group>\w+) (?P<numbers>.*)"
)


def load(file: Path) -> dict[str, Any]:
    """A computer's description, or a listing's."""
    return yaml.safe_load(file.read_text("utf-8"))  # type: ignore[no-any-return]


def laid_over(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """A description with the changes of a listing: adapters replaced, all else added."""
    made = {**base, **change}
    for key in ("files", "environment", "commands", "missing", "links"):
        made[key] = {**base.get(key, {}), **change.get(key, {})}
    made["processes"] = [*base.get("processes", ()), *change.get("processes", ())]
    # A daemon runs once.
    made["processes"] = list({Path(p["args"][0]).name: p for p in made["processes"]}.values())
    return made


def make(root: Path, description: Mapping[str, Any], robot: str = "") -> Machine:
    """Write a computer's files below `root`; returns the computer."""
    user = description["user"]
    write(root, "/etc/passwd", f"root:x:0:0::/root:/bin/sh\n{user['name']}:x:{user['uid']}:1000::")
    for path, text in description.get("files", {}).items():
        if text is not None:
            write(root, path, text)
    rows = [line.split(":") for line in (root / "etc/group").read_text("utf-8").splitlines()]
    groups = {row[0]: int(row[2]) for row in rows}
    held = [groups[name] for name in user["groups"]]
    status = f"Uid:\t{user['uid']}\t0\t0\t0\nGroups:\t{' '.join(map(str, held))}\n"
    write(root, "/proc/self/status", status)
    nodes: dict[Path, Node] = {}
    for adapter in description.get("adapters", ()):
        _write_adapter(root, adapter)
        if node := _node(adapter, groups, held):
            nodes[root / "dev" / adapter["port"]] = node
    for link, target in description.get("links", {}).items():
        nodes[root / link.lstrip("/")] = nodes.get(root / "dev" / target, Node(0, False, True))
    for process in description["processes"]:
        _write_process(root, process)
    missing, commands = description.get("missing", {}), description.get("commands", {})
    return Machine(
        root=root,
        environment=description.get("environment", {}),
        robot=robot,
        architecture=description["architecture"],
        bits=description["bits"],
        run=lambda command: commands.get(command[0], ""),
        import_error=lambda module: missing.get(module, ""),
        node=nodes.get,
    )


def write(root: Path, path: str, text: str) -> None:
    """A file of the computer."""
    file = root / path.lstrip("/")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, "utf-8")


def _node(adapter: Mapping[str, Any], groups: dict[str, int], held: list[int]) -> Node | None:
    """A device file as `ls -l` shows it."""
    shown = adapter.get("node", "crw-rw---- 1 root dialout 188, 0")
    if shown is None or "port" not in adapter:
        return None
    match = _NODE.match(shown)
    assert match, shown
    mode, group = match["mode"], groups.get(match["group"], 10)
    by_group = mode[3:5] == "rw"
    return Node(group, by_group, mode[6:8] == "rw" or (by_group and group in held))


def _write_adapter(root: Path, adapter: Mapping[str, Any]) -> None:
    socket, port = adapter["socket"], adapter.get("port")
    folder = f"/sys/devices/usb1/{socket}"
    vendor, product = adapter["id"].split(":")
    write(root, f"{folder}/idVendor", vendor)
    write(root, f"{folder}/idProduct", product)
    write(root, f"{folder}/power/control", adapter.get("control", "on"))
    for name in ("serial", "manufacturer", "product"):
        if name in adapter:
            write(root, f"{folder}/{name}", adapter[name])
    _link(root / "sys/bus/usb/devices" / socket, root / folder.lstrip("/"))
    interface = f"{folder}/{socket}:1.0"
    write(root, f"{interface}/bInterfaceNumber", "00")
    if "protocol" in adapter:
        write(root, f"{interface}/bInterfaceProtocol", adapter["protocol"])
    if port is None:
        return
    device = interface if port.startswith("ttyACM") else f"{interface}/{port}"
    tty = f"{device}/tty/{port}"
    number = ("166:" if port.startswith("ttyACM") else "188:") + port[-1]
    write(root, f"{tty}/dev", number)
    write(root, f"/run/udev/data/c{number}", "\n".join(adapter.get("udev", ())))
    _link(root / tty.lstrip("/") / "device", root / device.lstrip("/"))
    _link(root / "sys/class/tty" / port, root / tty.lstrip("/"))
    if "latency_timer" in adapter:
        write(root, f"{device}/latency_timer", str(adapter["latency_timer"]))
        _link(root / "sys/bus/usb-serial/devices" / port, root / device.lstrip("/"))


def _write_process(root: Path, process: Mapping[str, Any]) -> None:
    folder = f"/proc/{process['pid']}"
    write(root, f"{folder}/cmdline", "\0".join(process["args"]) + "\0")
    pairs = [f"{name}={value}" for name, value in process.get("environment", {}).items()]
    write(root, f"{folder}/environ", "\0".join(pairs))
    (root / folder.lstrip("/") / "fd").mkdir()
    for number, opened in enumerate(process.get("opens", ())):
        (root / folder.lstrip("/") / "fd" / str(number)).symlink_to(opened)


def _link(link: Path, target: Path) -> None:
    link.parent.mkdir(parents=True, exist_ok=True)
    link.symlink_to(target)


HERE = Path(__file__).parent
LISTINGS = sorted((HERE / "listings").glob("*.yaml"))
HEALTHY = sorted((HERE / "healthy").glob("*.yaml"))


@pytest.mark.parametrize("file", LISTINGS, ids=lambda file: file.stem)
def test_the_problem_of_a_listing_is_named_and_nothing_else(file: Path, tmp_path: Path) -> None:
    listing = load(file)
    computer = laid_over(load(HERE / "healthy" / f"{listing['machine']}.yaml"), listing)
    found = [finding.name for finding in examine(make(tmp_path, computer))]
    assert found == listing["expected"]


@pytest.mark.parametrize("file", HEALTHY, ids=lambda file: file.stem)
def test_nothing_is_wrong_with_a_healthy_computer(file: Path, tmp_path: Path) -> None:
    assert list(examine(make(tmp_path, load(file)))) == []


def test_each_listing_has_its_source() -> None:
    assert len(LISTINGS) >= 30
    assert len(HEALTHY) == 3
    for file in LISTINGS:
        listing = load(file)
        assert listing["source"].startswith("https://")
        assert listing["seen"].strip()
