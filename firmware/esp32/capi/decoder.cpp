// The C interface of the core's decoder.
#include <stdlib.h>
#include <string.h>

#include <array>
#include <new>

#include "framing.hpp"
#include "wheelwire_core.h"

using wheelwire::Frame;
using wheelwire::FrameDecoder;

namespace {

/// Body size of each id. A table, since a switch would be mispredicted at every frame.
constexpr auto kBodySizes = [] {
  std::array<int, 256> sizes{};
  for (size_t id = 0; id < 256; ++id) sizes[id] = wheelwire::body_size(static_cast<uint8_t>(id));
  return sizes;
}();

int body_size(uint8_t id) { return kBodySizes[id]; }

/// Calls `take(frame, size)` with each good frame and the size of its body.
template <typename Take>
void decode(FrameDecoder& frames, const uint8_t* data, size_t size, Take take) {
  while (size > 0) {
    Frame frame;
    bool complete;
    const size_t taken = frames.feed(data, size, frame, complete);
    data += taken;
    size -= taken;
    if (complete) take(frame, static_cast<size_t>(body_size(frame.id)));
  }
}

}  // namespace

struct wheelwire_decoder {
  uint8_t* bodies;
  wheelwire_run* runs;
  FrameDecoder frames{body_size};
  wheelwire_counters total{};
};

static_assert(wheelwire::kMaxBody <= WHEELWIRE_SPARE_ROOM);

wheelwire_decoder* wheelwire_decoder_create(uint8_t* bodies, wheelwire_run* runs) {
  void* const memory = malloc(sizeof(wheelwire_decoder));
  if (memory == nullptr) return nullptr;
  return new (memory) wheelwire_decoder{.bodies = bodies, .runs = runs};
}

void wheelwire_decoder_destroy(wheelwire_decoder* decoder) { free(decoder); }

size_t wheelwire_decoder_feed(wheelwire_decoder* decoder, const uint8_t* data, size_t size) {
  uint8_t* bodies = decoder->bodies;
  wheelwire_run* const runs = decoder->runs;
  const wheelwire::ReceiveCounters before = decoder->frames.counters();
  size_t count = 0;
  decode(decoder->frames, data, size, [&](const Frame& frame, size_t body) {
    if (count == 0 || runs[count - 1].id != frame.id) runs[count++] = {.id = frame.id, .frames = 0};
    ++runs[count - 1].frames;
    memcpy(bodies, frame.body, body);
    bodies += body;
  });
  const wheelwire::ReceiveCounters& now = decoder->frames.counters();
  wheelwire_counters& total = decoder->total;
  total.frames += now.frames - before.frames;
  total.bad_crc += now.bad_crc - before.bad_crc;
  total.bad_cobs += now.bad_cobs - before.bad_cobs;
  total.unknown_id += now.unknown_id - before.unknown_id;
  total.wrong_length += now.wrong_length - before.wrong_length;
  // May fall, when missing frames arrive late.
  total.seq_lost += static_cast<uint64_t>(static_cast<int32_t>(now.seq_lost - before.seq_lost));
  total.repeated += now.repeated - before.repeated;
  return count;
}

void wheelwire_decoder_restart_sequence(wheelwire_decoder* decoder) {
  decoder->frames.restart_sequence();
}

void wheelwire_decoder_restart(wheelwire_decoder* decoder) { decoder->frames.restart(); }

void wheelwire_decoder_counters(const wheelwire_decoder* decoder, wheelwire_counters* counters) {
  *counters = decoder->total;
}

size_t wheelwire_decode_capture(const uint8_t* data, size_t size, uint8_t id, uint8_t* bodies) {
  FrameDecoder frames(body_size);
  size_t count = 0;
  decode(frames, data, size, [&](const Frame& frame, size_t body) {
    if (frame.id == id) memcpy(bodies + body * count++, frame.body, body);
  });
  return count;
}
