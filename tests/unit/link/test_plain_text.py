"""What a chip or a bridge says in plain text, where a frame is expected, is read and named."""

from __future__ import annotations

import logging
import socket
import threading
from collections.abc import Sequence
from contextlib import suppress
from random import Random

import pytest

from support.cases import each
from support.staged_stops import StagedRobot
from wheelwire.drivers.serial import SerialDriver
from wheelwire.errors import ForeignDevice
from wheelwire.link.plain_text import PlainText
from wheelwire.link.session import Phase

ROM = b"ets Jul 29 2019 12:21:46\r\n\r\nrst:0x%x (%s),boot:0x%x (%s)\r\n"
BROWN_OUT = (
    b"\r\nBrownout detector was triggered\r\n\r\n"
    + ROM % (0xF, b"RTCWDT_BROWN_OUT_RESET", 0x13, b"SPI_FAST_FLASH_BOOT")
    + b"configsip: 0, SPIWP:0xee\r\n"
)
TEXTS = {
    BROWN_OUT: ("brown-out", "stronger supply"),
    b"E BOD: Brownout detector was triggered\r\n": ("brown-out", "stronger supply"),
    ROM % (0xF, b"BROWNOUT_RST", 0x8, b"SPI_FAST_FLASH_BOOT"): ("brown-out", "stronger supply"),
    ROM % (1, b"POWERON_RESET", 3, b"DOWNLOAD_BOOT(UART0/UART1/SDIO_REI_REO_V2)")
    + b"waiting for download\r\n": ("waits for a download", "release BOOT"),
    b"ESP-ROM:esp32s3-20210327\r\nrst:0x1 (POWERON),boot:0x0 (DOWNLOAD(USB/UART0))\r\n": (
        "waits for a download",
        "release BOOT",
    ),
    b"invalid header: 0xffffffff\r\n": ("no firmware", "`wheelwire flash`"),
    b"flash read err, 1000\r\nets_main.c 371\r\n": ("no firmware", "`wheelwire flash`"),
    b"Guru Meditation Error: Core  0 panic'ed (LoadProhibited).\r\n": (
        "crashes as it starts",
        "`wheelwire flash`",
    ),
    b"Port already in use\r\n": ("refuses", "end the program"),
    b"Too many clients connected, try again later\r\n": ("refuses", "end the program"),
    b"ser2net port 3333 device /dev/ttyUSB0 is busy\r\n": ("refuses", "end the program"),
    b"MicroPython v1.22.1 on 2024-01-05\r\n>>> ": ("runs Python", "`wheelwire flash`"),
}


@each("text", TEXTS)
def test_each_text_is_named_with_its_cure(text: bytes) -> None:
    what, cure = TEXTS[text]
    for size in (1, 7, len(text)):
        found = PlainText()
        for begin in range(0, len(text), size):
            found.feed(text[begin : begin + size])
        assert what in found.sentence, (size, found.sentence)
        assert cure in found.sentence
        assert found.quote in text.decode()
        assert found.quote == found.quote.strip() != ""


def test_the_newest_one_counts() -> None:
    found = PlainText()
    assert found.feed(BROWN_OUT)
    assert not found.feed(BROWN_OUT)
    assert found.feed(b"invalid header: 0xffffffff\r\n")
    assert "no firmware" in found.sentence


def test_noise_says_nothing() -> None:
    random, found = Random(1), PlainText()
    for _ in range(2000):
        found.feed(random.randbytes(200))
    assert found.sentence == ""
    assert len(found.quote) <= 80


def said_at(text: bytes, *, hangs_up: bool) -> str:
    """What the driver says of a bridge or a chip that says this again and again."""
    end = threading.Event()

    def serve() -> None:
        while not end.is_set():
            # Nobody has come yet, or the host hangs up.
            with suppress(OSError), server.accept()[0] as connection:
                connection.sendall(text)
                while not hangs_up and not end.wait(0.01):
                    connection.sendall(text)

    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.05)
        thread = threading.Thread(target=serve)
        thread.start()
        try:
            with pytest.raises(ForeignDevice) as raised:
                SerialDriver(f"socket://127.0.0.1:{server.getsockname()[1]}", connect_timeout=0.5)
        finally:
            end.set()
            thread.join()
    return str(raised.value)


GPS = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M\r\n"
HEADER, REFUSAL = b"invalid header: 0xffffffff\r\n", b"Port already in use\r\n"


@pytest.mark.parametrize(
    ("text", "hangs_up", "parts"),
    [
        (BROWN_OUT, False, TEXTS[BROWN_OUT]),
        (HEADER, False, TEXTS[HEADER]),
        (GPS, False, ["no Wheelwire frame"]),
        (REFUSAL, True, ["'Port already in use': the bridge"]),
    ],
    ids=["brown-out", "no firmware", "not ours", "bridge"],
)
def test_opening_the_port_reports_what_was_printed(
    text: bytes, hangs_up: bool, parts: Sequence[str]
) -> None:
    said = said_at(text, hangs_up=hangs_up)
    assert all(part in said for part in parts)
    assert ("another port" in said) == (text == GPS)


def test_text_that_is_not_known_is_quoted() -> None:
    found = PlainText()
    found.feed(b"\x00\x9f$GPGGA,123519,4807.038,N,01131.000,E,1\r\n\x01")
    error = ForeignDevice("/dev/x", [9600], 40, found.quote, found.sentence)
    assert "but the text '$GPGGA,123519,4807.038,N,01131.000,E,1': choose another" in str(error)


def test_a_robot_that_browns_out_again_and_again_while_it_is_used(
    caplog: pytest.LogCaptureFixture,
) -> None:
    robot = StagedRobot()
    robot.open()
    robot.cable = False
    robot.run(2.5)
    assert robot.session.phase is Phase.HELLO
    with caplog.at_level(logging.WARNING, "wheelwire.link"):
        for _ in range(3):
            robot.session.receive(BROWN_OUT, robot.now_us)
            robot.run(0.1)
    assert "brown-out" in str(robot.session.error)
    (record,) = (one for one in caplog.records if "brown-out" in one.getMessage())
    assert "stronger supply" in record.getMessage()
    robot.cable = True
    robot.sim.read()
    robot.wait_open()
    assert robot.session.plain_text.sentence == ""
