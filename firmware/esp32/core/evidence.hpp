// How long something was seen that should not be, across stops: what a stop ended could otherwise
// go on for ever in short bursts.
#pragma once

#include <stdint.h>

namespace wheelwire {

/// A stopwatch that leaks: while nothing is seen it runs back at a tenth of its pace. Only
/// counter-evidence ends it at once, or a clear.
class Evidence {
 public:
  /// It was seen for this long. Returns how long in all.
  uint32_t add(uint32_t us) {
    calm_us_ = 0;
    return us_ += us;
  }
  /// Nothing was seen, or could be seen.
  void leak(uint32_t us) {
    if (us_ != 0) lose(us / 10);
  }
  /// The opposite was seen, which ends it once that has lasted for `needed_us`. Before that it
  /// leaks: what is seen now and then is seen again.
  void refute(uint32_t us, uint32_t needed_us) {
    if (us_ != 0) weigh(us, needed_us);
  }
  void end() { us_ = calm_us_ = 0; }
  void shorten_to(uint32_t us) {
    if (us_ > us) us_ = us;
  }

  uint32_t us() const { return us_; }
  bool is_none() const { return us_ == 0; }

 private:
  // Out of line: there is mostly nothing to lose, and most control steps ask.
  [[gnu::noinline]] void lose(uint32_t us) { us_ -= us_ < us ? us_ : us; }
  [[gnu::noinline]] void weigh(uint32_t us, uint32_t needed_us) {
    calm_us_ += us;
    if (calm_us_ < needed_us)
      lose(us / 10);
    else
      end();
  }

  uint32_t us_ = 0;
  uint32_t calm_us_ = 0;  // For how long the opposite was seen since then.
};

}  // namespace wheelwire
