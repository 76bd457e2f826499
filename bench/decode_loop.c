/* The loop that one writes in C to decode a capture of one message, for capture.py to compare with:
   memchr from delimiter to delimiter, COBS in place, the CRC eight bytes a step, the body
   copied. */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { kHeader = 3, kCrc = 4, kMaxPayload = 254 };

static const uint32_t kResidue = 0x2144df1c;
static uint32_t table[8][256];

void prepare(void) {
  for (uint32_t i = 0; i < 256; ++i) {
    uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ (value & 1 ? 0xedb88320u : 0);
    table[0][i] = value;
  }
  for (int step = 1; step < 8; ++step) {
    for (int i = 0; i < 256; ++i) {
      const uint32_t before = table[step - 1][i];
      table[step][i] = before >> 8 ^ table[0][before & 0xff];
    }
  }
}

static uint32_t crc32(const uint8_t* data, size_t size) {
  uint32_t crc = ~0u;
  for (; size >= 8; data += 8, size -= 8) {
    uint32_t low, high;
    memcpy(&low, data, 4);
    memcpy(&high, data + 4, 4);
    low ^= crc;
    crc = table[7][low & 0xff] ^ table[6][low >> 8 & 0xff] ^ table[5][low >> 16 & 0xff] ^
          table[4][low >> 24] ^ table[3][high & 0xff] ^ table[2][high >> 8 & 0xff] ^
          table[1][high >> 16 & 0xff] ^ table[0][high >> 24];
  }
  while (size-- > 0) crc = crc >> 8 ^ table[0][(crc ^ *data++) & 0xff];
  return ~crc;
}

/* Writes the bodies of all good frames of message `id`, whose payloads have `size` bytes, to `out`.
   Returns how many there were. */
size_t decode(const uint8_t* data, size_t data_size, uint8_t id, size_t size, uint8_t* out) {
  const uint8_t* const end = data + data_size;
  const size_t body_size = size - kHeader - kCrc;
  size_t frames = 0;
  const uint8_t* delimiter;
  for (; (delimiter = memchr(data, 0, (size_t)(end - data))) != NULL; data = delimiter + 1) {
    uint8_t chunk[1 + kMaxPayload];
    if ((size_t)(delimiter - data) != 1 + size) continue;
    memcpy(chunk, data, 1 + size);
    size_t code = 0;
    while (code < 1 + size) {
      const size_t next = code + chunk[code];
      chunk[code] = 0;
      code = next;
    }
    if (code != 1 + size || chunk[1] != id || crc32(chunk + 1, size) != kResidue) continue;
    memcpy(out + frames++ * body_size, chunk + 1 + kHeader, body_size);
  }
  return frames;
}
