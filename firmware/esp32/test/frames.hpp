// A message as the bytes of its frame.
#pragma once

#include <vector>

#include "framing.hpp"
#include "protocol.hpp"

namespace wheelwire::test {

template <typename Message>
std::vector<uint8_t> frame_of(const Message& message, uint16_t seq) {
  uint8_t body[Message::kSize];
  message.encode(body);
  std::vector<uint8_t> frame(kMaxFrame);
  frame.resize(encode_frame(Message::kId, seq, body, sizeof body, frame.data()));
  return frame;
}

}  // namespace wheelwire::test
