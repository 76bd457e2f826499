"""What surrounds the body of every payload: `id u8, seq u16` before it, `crc u32` after it."""

from __future__ import annotations

HEADER_SIZE = 3
CRC_SIZE = 4
MIN_PAYLOAD = HEADER_SIZE + CRC_SIZE
