// Who is talking, and what was answered: the state that makes repeats and late frames harmless.
#pragma once

#include "framing.hpp"

namespace wheelwire {

/// An answer that may have to be given again.
struct Answer {
  uint16_t request_id;
  uint8_t id;
  uint8_t size;
  uint8_t body[kMaxBody];
};

class Session {
 public:
  enum class Request : uint8_t { kNew, kRepeat, kOld };

  void open(uint32_t nonce, uint32_t boot_id);
  void close() { open_ = false; }

  bool is_open() const { return open_; }
  bool is_open_with(uint32_t nonce) const { return open_ && nonce == nonce_; }
  bool names(uint32_t session_id) const { return open_ && session_id == id_; }
  /// 0 while none is open.
  uint32_t id() const { return id_; }

  bool clock_synchronised() const { return clock_synchronised_; }
  void note_ping() { clock_synchronised_ = true; }

  /// True for a command newer than all before it in this session; it is then the newest.
  bool take_command(uint32_t command_seq);

  /// kRepeat: the answer was given before and is in `answer`. kOld: not to be answered.
  Request classify(uint16_t request_id, const Answer*& answer) const;
  /// The place to record the answer to a new request.
  Answer& record(uint16_t request_id);

 private:
  static constexpr size_t kAnswers = 4;

  bool open_ = false;
  uint32_t nonce_ = 0;
  uint32_t id_ = 0;
  bool clock_synchronised_ = false;
  uint32_t newest_command_ = 0;
  Answer answers_[kAnswers];
  size_t answer_count_ = 0;  // since the session was opened
  uint16_t newest_request_ = 0;
};

}  // namespace wheelwire
