// Any block from the parameter store. The input is a byte and the block; if the byte is odd, the
// rest is the block's entries only, and the firmware's own magic number and their count come before
// them, so that the code after those checks is reached.
#include <cmath>
#include <vector>

#include "config.hpp"
#include "memory_store.hpp"
#include "parameters.hpp"
#include "require.hpp"

using namespace wheelwire;

namespace {

constexpr size_t kEntry = sizeof(ParameterId) + sizeof(float);

std::vector<uint8_t> block_of(const uint8_t* data, size_t size) {
  if (size == 0) return {};
  if (data[0] % 2 == 0) return {data + 1, data + size};
  MemoryStore store;
  REQUIRE(Parameters::save_none(store));
  const size_t count = (size - 1) / kEntry;
  store.block.back() = static_cast<uint8_t>(count);
  store.block.insert(store.block.end(), data + 1, data + 1 + count * kEntry);
  return store.block;
}

void check_bounds(const Parameters& parameters) {
  for (const ParameterSpec& spec : kParameters) {
    const float value = parameters.get(spec.id);
    REQUIRE(value >= spec.minimum && value <= spec.maximum);
    REQUIRE(spec.kind == ParameterKind::kReal || value == std::trunc(value));
  }
}

bool same(const Parameters& a, const Parameters& b) {
  for (const ParameterSpec& spec : kParameters) {
    if (a.get(spec.id) != b.get(spec.id)) return false;
  }
  return true;
}

void check_config(const Parameters& parameters) {
  const ControlConfig config = make_config(parameters);
  REQUIRE(config.period_us >= 200 && config.period_us <= 10'000);
  REQUIRE(config.um_per_tick_q10 >= 0 && config.max_velocity_umps > 0);
  REQUIRE(config.velocity_slew_umps > 0 && config.duty_slew_q15 > 0);
  REQUIRE(config.gains.limit_q15 > 0 && config.gains.limit_q15 <= 32767);
  REQUIRE(config.ttl_max_us >= 20'000 && config.ttl_max_us <= 5'000'001);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  MemoryStore store;
  store.block = block_of(data, size);
  Parameters parameters;
  const Parameters::Load result = parameters.load(store);
  check_bounds(parameters);
  if (result != Parameters::Load::kLoaded) REQUIRE(same(parameters, Parameters()));
  check_config(parameters);

  REQUIRE(parameters.save(store));
  Parameters again;
  REQUIRE(again.load(store) == Parameters::Load::kLoaded);
  REQUIRE(same(again, parameters));
  return 0;
}
