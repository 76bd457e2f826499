"""The names of a port: each leads to the device, whichever of them a program was given."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import urlsplit

from ..errors import InvalidArgument

UNIX = "unix:"
_LOCAL = ("localhost", "ip6-localhost", "::1")
_KINDS = {kind.lower(): kind for kind in ("USB", "ACM", "AMA", "S")}
_SERIAL = re.compile(r"(?:/dev/)?tty(usb|acm|ama|s)(\d+)", re.IGNORECASE)


def port_name(port: str) -> str:
    """A port's name that stays right when the program changes its folder; opens nothing.

    Links stay as they are: where they lead may change when the board is plugged in again.

    Raises:
        InvalidArgument: It begins with `~`, and there is no home folder.
    """
    scheme, path = _parts(port)
    if "://" in path or "*" in path or "," in path:
        return port
    try:
        found = Path(path).expanduser()
    except RuntimeError as error:
        raise InvalidArgument(f"{port}: there is no home folder (HOME): write all of it") from error
    if scheme or path.startswith("~") or (not found.is_absolute() and _is_device(found)):
        return f"{scheme}{found.absolute()}"
    return port


def device_of(port: str) -> str:
    """One name for all names of a port, a socket or a Unix socket: what they lead to.

    The names of drivers are their own.
    """
    scheme, path = _parts(port)
    if "://" in path:
        return _url(path)
    if scheme or "/" in path or _is_device(Path(path)):
        try:
            return f"{scheme}{Path(path).resolve()}"
        except OSError:  # a link vanishes meanwhile: it was unplugged
            return port
    return port


def meant_port(port: str) -> str:
    """What may be meant by the name of a port that does not exist: a question, or nothing."""
    if found := re.fullmatch(r"COM(\d+)", port, re.IGNORECASE):
        return (
            f"{port} is a name of Windows; did you mean /dev/ttyUSB0? In WSL the adapter has to be "
            "attached first (`wheelwire help wsl`)"
        )
    if found := _SERIAL.fullmatch(port):
        name = f"/dev/tty{_KINDS[found[1].lower()]}{found[2]}"
        return f"did you mean {name}?" if name != port else ""
    if port and "/" not in port and _is_device(device := Path("/dev", port)):
        return f"did you mean {device}?"
    return ""


def _parts(port: str) -> tuple[str, str]:
    """`unix:`, if it begins so, and the rest."""
    return (UNIX, port.removeprefix(UNIX)) if port.startswith(UNIX) else ("", port)


def _is_device(path: Path) -> bool:
    try:
        return path.is_char_device() or path.is_socket()
    except (OSError, ValueError):
        return False


def _url(url: str) -> str:
    try:
        parts = urlsplit(url)
        host = parts.hostname or ""
        port = f":{parts.port}" if parts.port is not None else ""
    except ValueError:
        return url
    host = "127.0.0.1" if host in _LOCAL else host
    return f"{parts.scheme}://{host}{port}{parts.path.rstrip('/')}"
