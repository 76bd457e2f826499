#include "framing.hpp"

#include <algorithm>
#include <random>
#include <span>
#include <vector>

#include "check.hpp"
#include "frames.hpp"
#include "vectors.hpp"

using namespace wheelwire;

namespace {

bool same(const ReceiveCounters& a, const ReceiveCounters& b) {
  return a.frames == b.frames && a.bad_crc == b.bad_crc && a.bad_cobs == b.bad_cobs &&
         a.unknown_id == b.unknown_id && a.wrong_length == b.wrong_length &&
         a.seq_lost == b.seq_lost && a.repeated == b.repeated;
}

/// Feeds all bytes, `part` at once; returns how many good frames came out, the last in `last`.
int feed_in_parts(FrameDecoder& decoder, std::span<const uint8_t> bytes, size_t part, Frame& last) {
  int frames = 0;
  for (size_t at = 0; at < bytes.size(); at += part) {
    const size_t end = std::min(at + part, bytes.size());
    for (size_t begin = at; begin < end;) {
      bool complete;
      begin += decoder.feed(bytes.data() + begin, end - begin, last, complete);
      frames += complete;
    }
  }
  return frames;
}

/// As above, byte by byte.
int feed(FrameDecoder& decoder, vectors::Bytes bytes, Frame& last) {
  return feed_in_parts(decoder, {bytes.begin(), bytes.end()}, 1, last);
}

}  // namespace

TEST(every_vector_is_encoded_byte_for_byte) {
  vectors::for_each_frame(
      [](const char* name, const auto& message, uint16_t seq, vectors::Bytes expected) {
        const std::vector<uint8_t> frame = test::frame_of(message, seq);
        const bool equal = std::ranges::equal(frame, expected);
        if (!equal) std::printf("%s\n", name);
        CHECK(equal);
        CHECK(frame.size() == frame_size(message.kSize));
      });
}

TEST(every_vector_is_decoded_to_its_fields) {
  vectors::for_each_frame(
      [](const char* name, const auto& message, uint16_t, vectors::Bytes bytes) {
        using Message = std::decay_t<decltype(message)>;
        FrameDecoder decoder(body_size);
        Frame frame{};
        CHECK(feed(decoder, bytes, frame) == 1);
        const bool equal = frame.id == Message::kId && Message::decode(frame.body) == message;
        if (!equal) std::printf("%s\n", name);
        CHECK(equal);
      });
}

TEST(every_stream_vector_is_counted_as_specified) {
  for (const vectors::Stream& stream : vectors::kStreams) {
    for (const size_t part : {size_t{1}, size_t{2}, size_t{7}, size_t{64}, size_t{10'000}}) {
      FrameDecoder decoder(body_size);
      Frame frame{};
      const int frames =
          feed_in_parts(decoder, {stream.bytes.begin(), stream.bytes.end()}, part, frame);
      const bool equal = same(decoder.counters(), stream.counters);
      if (!equal) std::printf("%s, %zu at once\n", stream.name, part);
      CHECK(equal);
      CHECK(static_cast<uint32_t>(frames) == stream.counters.frames);
    }
  }
}

TEST(noise_never_passes_as_a_frame) {
  std::mt19937 random(7);
  FrameDecoder decoder(body_size);
  Frame frame{};
  for (int i = 0; i < 3'000'000; ++i) {
    // Zeros are frequent and bytes small, so that many chunks are valid COBS of a frame's length.
    const auto word = static_cast<uint32_t>(random());
    decoder.feed(word % 20 == 0 ? 0 : static_cast<uint8_t>(1 + (word >> 8) % 9), frame);
  }
  CHECK(decoder.counters().frames == 0);
  CHECK(decoder.counters().bad_cobs > 1000);
  CHECK(decoder.counters().bad_crc > 1000);
}
