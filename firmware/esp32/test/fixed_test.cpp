#include "fixed.hpp"

#include <limits>

#include "check.hpp"

using namespace wheelwire;

TEST(floats_become_the_nearest_integer) {
  CHECK(to_fixed(0.0f) == 0 && to_fixed(-0.0f) == 0);
  CHECK(to_fixed(0.49999997f) == 0 && to_fixed(-0.49999997f) == 0);
  CHECK(to_fixed(0.5f) == 1 && to_fixed(-0.5f) == -1);
  CHECK(to_fixed(2.5f) == 3 && to_fixed(-2.5f) == -3);
  CHECK(to_fixed(1234.4f) == 1234 && to_fixed(-1234.6f) == -1235);
  CHECK(to_fixed(4194303.5f) == 4194304);
  CHECK(to_fixed(8388609.0f) == 8388609);
  CHECK(to_fixed(std::numeric_limits<float>::denorm_min()) == 0);
}

TEST(floats_beyond_the_integers_saturate) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  CHECK(to_fixed(2147483520.0f) == 2147483520 && to_fixed(-2147483520.0f) == -2147483520);
  CHECK(to_fixed(2147483648.0f) == INT32_MAX && to_fixed(-2147483648.0f) == -INT32_MAX);
  CHECK(to_fixed(kInfinity) == INT32_MAX && to_fixed(-kInfinity) == -INT32_MAX);
  CHECK(to_fixed(std::numeric_limits<float>::quiet_NaN()) == 0);
}
