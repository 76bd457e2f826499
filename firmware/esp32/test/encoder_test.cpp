#include "encoder.hpp"

#include <random>

#include "check.hpp"

using namespace wheelwire;

namespace {

/// The chip's register: counts by one and returns to 0 at either limit.
struct Register {
  int16_t value = 0;
  void count(int direction) {
    value = static_cast<int16_t>(value + direction);
    if (value == kCounterLimit || value == -kCounterLimit) value = 0;
  }
};

}  // namespace

TEST(total_follows_the_register_over_both_limits) {
  std::mt19937 random(1);
  Register reg;
  TickTotal total;
  int64_t truth = 0;
  for (int step = 0; step < 2000; ++step) {
    const int ticks = std::uniform_int_distribution<int>(0, 16'000)(random);
    const int direction = (step / 100) % 2 == 0 ? 1 : -1;
    for (int i = 0; i < ticks; ++i) reg.count(direction);
    truth += direction * ticks;
    CHECK(total.update(reg.value, false) == direction * ticks);
    CHECK(total.ticks() == static_cast<int32_t>(truth));
  }
}

TEST(totals_that_exchange_their_registers_keep_what_they_counted) {
  TickTotal left(100);
  TickTotal right(-200);
  left.update(110, false);
  right.update(-230, false);
  left.exchange_registers(right);
  CHECK(left.update(-228, false) == 2 && right.update(115, false) == 5);
  CHECK(left.ticks() == 12 && right.ticks() == -25);
}
