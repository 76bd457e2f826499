// The newest value from one task to another. Neither waits: writer and reader each have their own
// slot, and the posted value waits in a third slot, which they exchange for their own.
#pragma once

#include <stdint.h>

namespace wheelwire {

/// One task posts, one takes. Some targets have no C++ library and so no <atomic>; the compiler's
/// built-in functions do the same.
template <typename Value>
class Mailbox {
 public:
  /// Replaces one that was not taken.
  void post(const Value& value) {
    slots_[writing_] = value;
    writing_ = __atomic_exchange_n(&waiting_, writing_ | kNew, __ATOMIC_ACQ_REL) & ~kNew;
  }
  /// False if nothing was posted since the last call.
  bool take(Value& out) {
    if ((__atomic_load_n(&waiting_, __ATOMIC_RELAXED) & kNew) == 0) return false;
    reading_ = __atomic_exchange_n(&waiting_, reading_, __ATOMIC_ACQ_REL) & ~kNew;
    out = slots_[reading_];
    return true;
  }

 private:
  static constexpr uint32_t kNew = 4;

  Value slots_[3]{};
  uint32_t writing_ = 0;
  uint32_t reading_ = 1;
  uint32_t waiting_ = 2;
};

}  // namespace wheelwire
