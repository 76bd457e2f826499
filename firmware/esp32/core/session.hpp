// The session with a host: what makes repeated and late messages harmless.
#pragma once

#include "framing.hpp"
#include "protocol.hpp"

namespace wheelwire {

/// The longest answer that a session stores.
constexpr size_t kMaxAnswer = LinkCounters::kSize;

/// An answer, kept for a repeat of its request.
struct Answer {
  uint16_t request_id;
  uint8_t id;
  uint8_t size;
  uint8_t body[kMaxAnswer];
};

class Session {
 public:
  enum class Request : uint8_t { kNew, kRepeat, kOld };

  void open(uint32_t nonce, uint32_t boot_id) {
    open_ = true;
    nonce_ = nonce;
    id_ = nonce ^ boot_id;
    clock_synchronised_ = false;
    newest_command_ = 0;
    answer_count_ = 0;
    newest_request_ = 0;
  }
  void close() { open_ = false; }

  bool is_open() const { return open_; }
  bool is_open_with(uint32_t nonce) const { return open_ && nonce == nonce_; }
  bool matches(uint32_t session_id) const { return open_ && session_id == id_; }
  /// 0 while none is open.
  uint32_t id() const { return id_; }

  bool clock_synchronised() const { return clock_synchronised_; }
  void note_ping() { clock_synchronised_ = true; }

  /// True if the command is newer than all before it in this session; it then is the newest.
  bool take_command(uint32_t command_seq) {
    if (command_seq <= newest_command_) return false;
    newest_command_ = command_seq;
    return true;
  }
  /// Whether no number is left, and the command does not repeat the one that was the last.
  bool is_spent(uint32_t command_seq) const {
    return newest_command_ == UINT32_MAX && command_seq != UINT32_MAX;
  }

  /// kRepeat: already answered, with `answer`. kOld: its answer is gone; it must not be answered.
  Request classify(uint16_t request_id, const Answer*& answer) const {
    // First: one of the answers may be as old as a round of all ids.
    if (static_cast<int16_t>(request_id - newest_request_) > 0) return Request::kNew;
    const uint32_t kept = answer_count_ < kAnswers ? answer_count_ : kAnswers;
    for (uint32_t i = 0; i < kept; ++i) {
      if (answers_[i].request_id == request_id) {
        answer = &answers_[i];
        return Request::kRepeat;
      }
    }
    return Request::kOld;
  }
  /// A request was answered whose answer is not kept: a repeat of it is new, and all before it old.
  void pass(uint16_t request_id) { newest_request_ = static_cast<uint16_t>(request_id - 1); }
  /// Makes room for the answer to a new request, in place of the oldest one.
  Answer& record(uint16_t request_id) {
    newest_request_ = request_id;
    Answer& answer = answers_[answer_count_ % kAnswers];
    ++answer_count_;
    answer.request_id = request_id;
    return answer;
  }

 private:
  static constexpr uint32_t kAnswers = 4;

  bool open_ = false;
  uint32_t nonce_ = 0;
  uint32_t id_ = 0;
  bool clock_synchronised_ = false;
  uint32_t newest_command_ = 0;
  Answer answers_[kAnswers];
  uint32_t answer_count_ = 0;  // since the session was opened
  uint16_t newest_request_ = 0;
};

}  // namespace wheelwire
