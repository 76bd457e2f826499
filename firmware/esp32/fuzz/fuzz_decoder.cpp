// The decoder with any bytes. The input is what arrives on the line.
#include <vector>

#include "framing.hpp"
#include "require.hpp"

using namespace wheelwire;

namespace {

uint32_t chunks_judged(const ReceiveCounters& counters) {
  return counters.frames + counters.bad_crc + counters.bad_cobs + counters.unknown_id +
         counters.wrong_length;
}

/// A good frame has its message's size on the line, and can be decoded again once encoded again.
void check_frame(const Frame& frame, const std::vector<uint8_t>& chunk) {
  const int size = body_size(frame.id);
  REQUIRE(size >= 0);
  const std::vector<uint8_t> body(frame.body, frame.body + size);
  REQUIRE(chunk.size() == frame_size(body.size()) - 2);
  uint8_t again[kMaxFrame];
  const size_t again_size = encode_frame(frame.id, 0, body.data(), body.size(), again);
  FrameDecoder decoder(body_size);
  Frame copy{};
  int frames = 0;
  for (size_t i = 0; i < again_size; ++i) frames += decoder.feed(again[i], copy);
  REQUIRE(frames == 1 && copy.id == frame.id);
  REQUIRE(std::vector<uint8_t>(copy.body, copy.body + size) == body);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  FrameDecoder decoder(body_size);
  std::vector<uint8_t> chunk;
  uint32_t chunks = 0;
  uint32_t frames = 0;
  for (size_t i = 0; i < size; ++i) {
    Frame frame{};
    const bool complete = decoder.feed(data[i], frame);
    if (complete) {
      REQUIRE(data[i] == 0);
      check_frame(frame, chunk);
      ++frames;
    }
    if (data[i] != 0) {
      chunk.push_back(data[i]);
      continue;
    }
    chunks += !chunk.empty();
    chunk.clear();
    REQUIRE(chunks_judged(decoder.counters()) == chunks);
  }
  REQUIRE(decoder.counters().frames == frames);
  return 0;
}
