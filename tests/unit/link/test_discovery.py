"""Looking for a board among ports that come and go while they are looked at."""

import os
import threading
import time
from pathlib import Path

import pytest

from wheelwire.errors import PortUnavailable
from wheelwire.link import discovery as identify

BOARD_ID = "0123456789ab"


def test_a_port_that_is_unplugged_while_it_is_asked_is_given_up_at_once(tmp_path: Path) -> None:
    controller, port = os.openpty()
    (tmp_path / "tty0").symlink_to(os.ttyname(port))

    def unplug() -> None:
        os.read(controller, 1)  # the hello
        os.close(controller)

    thread = threading.Thread(target=unplug)
    thread.start()
    begin = time.monotonic()
    with pytest.raises(PortUnavailable):
        identify.open_board(str(tmp_path / "tty*"), BOARD_ID, 115_200)
    assert time.monotonic() - begin < identify.IDENTIFY_TIMEOUT_US / 1e6 / 2
    thread.join()
    os.close(port)
