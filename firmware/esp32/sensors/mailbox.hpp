// The newest value from one task to another. Neither waits: the writer has a slot of its own, so
// has the reader, and what was posted waits in a third one, which both exchange for theirs.
#pragma once

#include <stdint.h>

namespace wheelwire {

/// One task posts, one takes. Where a C++ library is missing there is no <atomic>; the compiler's
/// own functions are the same.
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
