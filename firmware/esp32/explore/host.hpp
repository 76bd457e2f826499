// A host of the robot: what it knows, and the frames that it sends.
#pragma once

#include <cstdint>
#include <vector>

#include "framing.hpp"
#include "wire_decoder.hpp"

namespace wheelwire::explore {

using Bytes = std::vector<uint8_t>;

class Host {
 public:
  explicit Host(uint32_t nonce) : nonce_(nonce) {}

  uint32_t session_id() const { return session_id_; }
  uint32_t nonce() const { return nonce_; }
  /// From now on it says hello with another nonce.
  void renew_nonce() { nonce_ = nonce_ * 2654435761U + 1; }

  /// The number of its next request; `ahead` 1 is the next one, 0 the last one again.
  uint16_t request_id(int ahead) {
    const auto id = static_cast<uint16_t>(request_id_ + ahead);
    if (ahead > 0) request_id_ = id;
    return id;
  }
  uint32_t command_seq(int ahead) {
    const auto seq = command_seq_ + static_cast<uint32_t>(ahead);
    if (ahead > 0) command_seq_ = seq;
    return seq;
  }

  template <typename Message>
  Bytes frame(const Message& message) {
    Bytes body(Message::kSize);
    message.encode(body.data());
    return frame(Message::kId, body);
  }
  Bytes frame(uint8_t id, const Bytes& body) {
    sent_.push_back({id, body});
    if (sent_.size() > kKept) sent_.erase(sent_.begin());
    return frame_of(sent_.back());
  }
  /// Repeats the message before the last `back` ones; empty if there is none.
  Bytes repeated(size_t back) {
    return back < sent_.size() ? frame_of(sent_[sent_.size() - 1 - back]) : Bytes{};
  }

  /// Reads what the device sends.
  void receive(const Seen& seen) {
    if (seen.id != DeviceHello::kId) return;
    const auto hello = seen.as<DeviceHello>();
    if (hello.nonce != nonce_ || hello.refusal != RefusalCode::kNone) return;
    if ((nonce_ ^ hello.boot_id) == session_id_) return;
    session_id_ = nonce_ ^ hello.boot_id;
    request_id_ = 0;
    command_seq_ = 0;
  }

 private:
  static constexpr size_t kKept = 8;

  Bytes frame_of(const Seen& sent) {
    Bytes frame(kMaxFrame);
    frame.resize(encode_frame(sent.id, seq_++, sent.body.data(), sent.body.size(), frame.data()));
    return frame;
  }

  uint32_t nonce_;
  uint32_t session_id_ = 0;
  uint16_t request_id_ = 0;
  uint32_t command_seq_ = 0;
  uint16_t seq_ = 0;
  std::vector<Seen> sent_;
};

}  // namespace wheelwire::explore
