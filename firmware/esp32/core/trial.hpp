// A trial of parameters: the previous values, and until when others may replace them.
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
  /// Its host may not know yet, and neither drives nor changes anything before it does.
  void expire() { state_ = State::kExpired; }
  void end() { state_ = State::kNone; }
  /// The values that were active before it began.
  const Parameters& former() const { return former_; }

  /// Why a parameter cannot change, and nothing can drive: the host believes in other values.
  RefusalCode refusal() const {
    return state_ == State::kExpired ? RefusalCode::kNoTrial : RefusalCode::kNone;
  }
  /// Why none can begin, and why what outlasts a session cannot change.
  RefusalCode lasting_refusal() const { return runs() ? RefusalCode::kOnTrial : refusal(); }

 private:
  enum class State : uint8_t { kNone, kRuns, kExpired };

  Parameters former_;
  uint64_t deadline_us_ = 0;
  State state_ = State::kNone;
};

}  // namespace wheelwire
