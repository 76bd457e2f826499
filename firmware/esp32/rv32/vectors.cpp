// Checks the protocol's vectors on RV32. Names what differs; exits with 1 if anything does.
#include "vectors.hpp"

#include <stdio.h>
#include <string.h>

using namespace wheelwire;

namespace {

int checked = 0;
int failed = 0;

void check(bool passed, const char* name, const char* what) {
  ++checked;
  if (passed) return;
  ++failed;
  printf("%s: %s\n", name, what);
}

bool equal(vectors::Bytes expected, const uint8_t* bytes, size_t size) {
  return static_cast<size_t>(expected.end() - expected.begin()) == size &&
         memcmp(expected.begin(), bytes, size) == 0;
}

template <typename Message>
void check_frame(const char* name, const Message& message, uint16_t seq, vectors::Bytes expected) {
  uint8_t body[Message::kSize];
  message.encode(body);
  uint8_t encoded[kMaxFrame];
  const size_t size = encode_frame(Message::kId, seq, body, sizeof body, encoded);
  check(equal(expected, encoded, size), name, "encoded otherwise");

  FrameDecoder decoder(body_size);
  Frame frame{};
  int frames = 0;
  for (const uint8_t byte : expected) frames += decoder.feed(byte, frame);
  check(frames == 1 && frame.id == Message::kId && Message::decode(frame.body) == message, name,
        "decoded otherwise");
}

void check_stream(const vectors::Stream& stream) {
  FrameDecoder decoder(body_size);
  Frame frame;
  for (const uint8_t byte : stream.bytes) decoder.feed(byte, frame);
  check(memcmp(&decoder.counters(), &stream.counters, sizeof stream.counters) == 0, stream.name,
        "counted otherwise");
}

}  // namespace

int main() {
  vectors::for_each_frame([](const char* name, const auto& message, uint16_t seq,
                             vectors::Bytes frame) { check_frame(name, message, seq, frame); });
  for (const vectors::Stream& stream : vectors::kStreams) check_stream(stream);
  printf("%d checks, %d failed\n", checked, failed);
  return checked == 0 || failed != 0;
}
