// Any block from the parameter store. The input is the block; if its first byte is odd, the rest is
// given the magic number and a correct CRC, so that the code after those checks is reached.
#include <cmath>
#include <vector>

#include "config.hpp"
#include "crc32.hpp"
#include "memory_store.hpp"
#include "parameters.hpp"
#include "require.hpp"

using namespace wheelwire;

namespace {

constexpr uint8_t kMagic[] = {'W', 'W', 'P', '1'};

std::vector<uint8_t> block_of(const uint8_t* data, size_t size) {
  if (size == 0) return {};
  const std::vector<uint8_t> rest(data + 1, data + size);
  if (data[0] % 2 == 0) return rest;
  std::vector<uint8_t> block(kMagic, kMagic + sizeof kMagic);
  block.insert(block.end(), rest.begin(), rest.end());
  const uint32_t crc = crc32(block.data(), block.size());
  for (int shift = 0; shift < 32; shift += 8) block.push_back(static_cast<uint8_t>(crc >> shift));
  return block;
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
