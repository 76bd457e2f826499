// A simple estimator, for comparison: from one tick to another, both chosen when a tick arrives.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <deque>

namespace wheelwire::sim {

class TickToTick {
 public:
  void update(int32_t change, uint64_t t_us, uint32_t window_us) {
    if (change == 0) {
      if (!marks_.empty() && t_us > newest_.t_us) bound(static_cast<double>(t_us - newest_.t_us));
      return;
    }
    newest_ = {newest_.ticks + change, t_us};
    while (marks_.size() > 1) {
      const uint64_t age_us = t_us - marks_[1].t_us;
      const bool whole_cycle = std::abs(newest_.ticks - marks_[1].ticks) >= 4;
      if (age_us < window_us || (!whole_cycle && age_us < 4 * window_us)) break;
      marks_.pop_front();
    }
    if (!marks_.empty() && t_us > marks_[0].t_us) {
      ticks_per_s_ = static_cast<double>(newest_.ticks - marks_[0].ticks) * 1e6 /
                     static_cast<double>(t_us - marks_[0].t_us);
    }
    if (marks_.empty() || t_us - marks_.back().t_us >= window_us / 16) marks_.push_back(newest_);
  }

  double ticks_per_s() const { return ticks_per_s_; }

 private:
  struct Tick {
    int64_t ticks = 0;
    uint64_t t_us = 0;
  };

  void bound(double silence_us) {
    const double limit = 1.5e6 / silence_us;
    if (ticks_per_s_ > limit) ticks_per_s_ = limit;
    if (ticks_per_s_ < -limit) ticks_per_s_ = -limit;
  }

  std::deque<Tick> marks_;
  Tick newest_;
  double ticks_per_s_ = 0.0;
};

}  // namespace wheelwire::sim
