"""What every payload has around its body: `id u8, seq u16` before it, `crc u32` behind."""

from __future__ import annotations

HEADER_SIZE = 3
CRC_SIZE = 4
MIN_PAYLOAD = HEADER_SIZE + CRC_SIZE
