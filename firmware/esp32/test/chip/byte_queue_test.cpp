// The ring of bytes before a line that takes few at a time.
#include "byte_queue.hpp"

#include <vector>

#include "check.hpp"

using wheelwire::ByteQueue;

namespace {

using Bytes = std::vector<uint8_t>;

/// All that waits, in its order; nothing waits afterwards.
template <size_t capacity>
Bytes drained(ByteQueue<capacity>& queue) {
  Bytes bytes;
  while (queue.front_size() > 0) {
    bytes.insert(bytes.end(), queue.front(), queue.front() + queue.front_size());
    queue.drop(queue.front_size());
  }
  return bytes;
}

}  // namespace

TEST(what_does_not_fit_into_a_queue_is_refused_as_a_whole) {
  // From each place of the ring on.
  for (size_t begin = 0; begin < 8; ++begin) {
    ByteQueue<8> queue;
    const uint8_t before[8]{};
    CHECK(queue.put(before, begin));
    CHECK(drained(queue).size() == begin);
    const uint8_t first[] = {1, 2, 3, 4, 5};
    const uint8_t second[] = {6, 7, 8, 9};
    CHECK(queue.put(first, 5));
    CHECK(!queue.put(second, 4));
    CHECK(queue.put(second, 3));
    CHECK(!queue.put(second, 1));
    CHECK(drained(queue) == Bytes({1, 2, 3, 4, 5, 6, 7, 8}));
    CHECK(queue.put(second, 4) && drained(queue) == Bytes({6, 7, 8, 9}));
  }
}

TEST(a_queue_that_is_emptied_in_parts_keeps_the_order) {
  ByteQueue<8> queue;
  Bytes expected;
  Bytes taken;
  for (uint8_t i = 0; i < 100; ++i) {
    const uint8_t pair[] = {i, static_cast<uint8_t>(i + 100)};
    CHECK(queue.put(pair, 2));
    expected.insert(expected.end(), pair, pair + 2);
    for (int drop = 0; drop < (i % 3 == 0 ? 1 : 2) && queue.front_size() > 0; ++drop) {
      taken.push_back(*queue.front());
      queue.drop(1);
    }
    if (i % 3 == 2 && queue.front_size() > 0) {
      taken.push_back(*queue.front());
      queue.drop(1);
    }
  }
  const Bytes rest = drained(queue);
  taken.insert(taken.end(), rest.begin(), rest.end());
  CHECK(taken == expected);
}
