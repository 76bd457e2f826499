// The firmware's decoder for other languages, so that theirs can be held to it.
#include <algorithm>

#include "framing.hpp"

/// Decodes `size` bytes of a line that was silent before. `out` has room for as many; the id and
/// body of each good frame are written to it, one behind the other, and their total is returned.
/// `counters`: as ReceiveCounters, in its order.
extern "C" __attribute__((visibility("default"))) size_t wheelwire_decode(
    const uint8_t* data, size_t size, uint8_t* out, wheelwire::ReceiveCounters* counters) {
  wheelwire::FrameDecoder decoder(wheelwire::body_size);
  wheelwire::Frame frame;
  uint8_t* end = out;
  for (size_t i = 0; i < size; ++i) {
    if (!decoder.feed(data[i], frame)) continue;
    *end++ = frame.id;
    end = std::copy_n(frame.body, wheelwire::body_size(frame.id), end);
  }
  *counters = decoder.counters();
  return static_cast<size_t>(end - out);
}
