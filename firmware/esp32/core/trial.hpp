// A trial of parameters: the previous values, and the time until which others replace them.
#pragma once

#include "parameters.hpp"

namespace wheelwire {

constexpr float kShortestTrialS = 0.2f;
constexpr float kLongestTrialS = 60.0f;

class Trial {
 public:
  explicit Trial(const Parameters& parameters) : former_(parameters) {}

  bool runs() const { return state_ == State::kRuns; }
  bool is_due(uint64_t now_us) const { return runs() && now_us >= deadline_us_; }

  void begin(const Parameters& parameters, uint64_t deadline_us) {
    former_ = parameters;
    state_ = State::kRuns;
    deadline_us_ = deadline_us;
  }
  void renew(uint64_t deadline_us) { deadline_us_ = deadline_us; }
  /// The host may not know yet. Until it does, it can neither drive nor change anything.
  void expire() { state_ = State::kExpired; }
  void end() { state_ = State::kNone; }
  /// The values that were active before it began.
  const Parameters& former() const { return former_; }

  /// Why a parameter cannot change, and nothing can drive: the host believes in other values.
  RefusalCode refusal() const {
    return state_ == State::kExpired ? RefusalCode::kNoTrial : RefusalCode::kNone;
  }
  /// Why no trial can begin, and why settings that outlast a session cannot change.
  RefusalCode lasting_refusal() const { return runs() ? RefusalCode::kOnTrial : refusal(); }

 private:
  enum class State : uint8_t { kNone, kRuns, kExpired };

  Parameters former_;
  uint64_t deadline_us_ = 0;
  State state_ = State::kNone;
};

}  // namespace wheelwire
