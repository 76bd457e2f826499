#include "session.hpp"

namespace wheelwire {

void Session::open(uint32_t nonce, uint32_t boot_id) {
  open_ = true;
  nonce_ = nonce;
  id_ = nonce ^ boot_id;
  clock_synchronised_ = false;
  newest_command_ = 0;
  answer_count_ = 0;
  newest_request_ = 0;
}

bool Session::take_command(uint32_t command_seq) {
  if (command_seq <= newest_command_) return false;
  newest_command_ = command_seq;
  return true;
}

Session::Request Session::classify(uint16_t request_id, const Answer*& answer) const {
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

Answer& Session::record(uint16_t request_id) {
  newest_request_ = request_id;
  Answer& answer = answers_[answer_count_ % kAnswers];
  ++answer_count_;
  answer.request_id = request_id;
  return answer;
}

}  // namespace wheelwire
