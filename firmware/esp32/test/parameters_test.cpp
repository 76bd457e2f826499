#include "parameters.hpp"

#include <cmath>
#include <vector>

#include "check.hpp"
#include "memory_store.hpp"
#include "twin_store.hpp"

using namespace wheelwire;
using enum ParameterId;

namespace {

/// In which a wheel radius of 50 mm is saved, not the default of 33.
MemoryStore saved_store() {
  MemoryStore store;
  Parameters saved;
  saved.set(kWheelRadius, 0.05f);
  CHECK(saved.save(store));
  return store;
}

}  // namespace

TEST(values_out_of_bounds_are_refused_and_change_nothing) {
  Parameters parameters;
  CHECK(parameters.set(kWheelRadius, 2.0f) == RefusalCode::kOutOfRange);
  CHECK(parameters.set(kWheelRadius, NAN) == RefusalCode::kNotFinite);
  CHECK(parameters.set(kWheelRadius, INFINITY) == RefusalCode::kNotFinite);
  CHECK(parameters.set(kCountsPerRevolution, 360.5f) == RefusalCode::kNotIntegral);
  CHECK(parameters.set(static_cast<ParameterId>(0), 1) == RefusalCode::kUnknownParameter);
  CHECK(parameters.set(static_cast<ParameterId>(255), 1) == RefusalCode::kUnknownParameter);
  CHECK(parameters.get(kWheelRadius) == 0.033f);
}

TEST(what_a_start_would_load_otherwise_is_unsaved) {
  const auto bit_of = [](ParameterId id) { return uint64_t{1} << (static_cast<size_t>(id) - 1); };
  MemoryStore store;
  Parameters active;
  CHECK(active.unsaved(store) == 0);  // an empty store is a start with the defaults
  active.set(kWheelRadius, 0.05f);
  active.set(kTtlMaxS, 0.5f);
  CHECK(active.unsaved(store) == (bit_of(kWheelRadius) | bit_of(kTtlMaxS)));
  CHECK(active.save_one(store, kTtlMaxS));
  CHECK(active.unsaved(store) == bit_of(kWheelRadius));
  CHECK(active.save(store));
  CHECK(active.unsaved(store) == 0);
  active.set_defaults();
  CHECK(active.unsaved(store) == (bit_of(kWheelRadius) | bit_of(kTtlMaxS)));
  store.block.pop_back();  // A start takes the defaults if it cannot read what was saved.
  CHECK(active.unsaved(store) == 0);
}

TEST(one_value_is_not_saved_over_a_block_that_cannot_be_read) {
  MemoryStore first;
  MemoryStore second;
  TwinStore store(first, second);
  Parameters active;
  CHECK(active.save(store));
  first.block.back() ^= 1;
  second.block.clear();
  const std::vector<uint8_t> damaged = first.block;
  CHECK(!active.save_one(store, kTtlMaxS));
  CHECK(first.block == damaged && second.block.empty());
}

TEST(a_block_of_another_size_or_kind_or_with_a_bad_value_is_damaged_and_changes_nothing) {
  MemoryStore store = saved_store();
  const std::vector<uint8_t> good = store.block;
  const auto check_damaged = [&store](const std::vector<uint8_t>& block) {
    store.block = block;
    Parameters loaded;
    CHECK(loaded.load(store) == Parameters::Load::kDamaged);
    CHECK(loaded.get(kWheelRadius) == 0.033f);
  };
  for (size_t size = 1; size < good.size(); ++size)
    check_damaged({good.begin(), good.begin() + static_cast<ptrdiff_t>(size)});
  check_damaged(std::vector<uint8_t>(5000, 0x5a));
  std::vector<uint8_t> of_another_kind = good;
  of_another_kind[0] ^= 1;
  check_damaged(of_another_kind);
  // The last parameter's value is NaN: behind it is the entry with the board's fingerprint.
  std::vector<uint8_t> with_a_bad_value = good;
  for (size_t i = 6; i <= 9; ++i) with_a_bad_value[good.size() - i] = 0xff;
  check_damaged(with_a_bad_value);
}

TEST(an_empty_store_and_a_block_without_values_leave_the_defaults) {
  MemoryStore none = saved_store();
  CHECK(Parameters::save_none(none));
  for (MemoryStore store : {MemoryStore(), none}) {
    Parameters parameters;
    CHECK(parameters.load(store) == Parameters::Load::kEmpty);
    CHECK(parameters.get(kWheelRadius) == 0.033f);
  }
}

TEST(a_board_has_defaults_of_its_own_within_the_bounds) {
  ParameterSpec specs[kParameterCount];
  platform_specs(Chip::kLinux, specs);
  Parameters parameters(specs);
  for (const ParameterSpec* const some :
       std::initializer_list<const ParameterSpec*>{kParameters, specs})
    for (size_t i = 0; i < kParameterCount; ++i)
      CHECK(parameters.set(some[i].id, some[i].default_value) == RefusalCode::kNone);
  CHECK(parameters.get(kControlRateHz) == 100.0f);
  CHECK(parameters.get(kEstopInputEnabled) == 0.0f);
  CHECK(parameters.get(kWheelRadius) == 0.033f);

  parameters.set(kControlRateHz, 500.0f);
  parameters.set_defaults();
  CHECK(parameters.get(kControlRateHz) == 100.0f);

  platform_specs(Chip::kEsp32, specs);
  CHECK(Parameters(specs).get(kControlRateHz) == 1000.0f);
}

TEST(a_block_of_a_later_release_is_read_without_what_is_unknown_here) {
  MemoryStore store = saved_store();
  ++store.block[4];
  // Its id is 200, its value 1.0.
  store.block.insert(store.block.end(), {200, 0, 0, 128, 63});
  Parameters loaded;
  CHECK(loaded.load(store) == Parameters::Load::kLoaded);
  CHECK(loaded.get(kWheelRadius) == 0.05f);
}

TEST(an_estop_input_that_was_switched_off_is_on_again_on_another_board) {
  MemoryStore store;
  Parameters saved(kParameters, 0x1234);
  saved.set(kEstopInputEnabled, 0);
  saved.set(kWheelRadius, 0.05f);
  CHECK(saved.save(store));
  Parameters same(kParameters, 0x1234);
  CHECK(same.load(store) == Parameters::Load::kLoaded && !same.is_on(kEstopInputEnabled));
  Parameters other(kParameters, 0x1235);
  CHECK(other.load(store) == Parameters::Load::kLoaded && other.is_on(kEstopInputEnabled));
  CHECK(other.get(kWheelRadius) == 0.05f);
}

TEST(bounds_are_inclusive) {
  Parameters parameters;
  for (const ParameterSpec& spec : kParameters) {
    CHECK(parameters.set(spec.id, spec.minimum) == RefusalCode::kNone);
    CHECK(parameters.set(spec.id, spec.maximum) == RefusalCode::kNone);
    CHECK(parameters.set(spec.id, spec.minimum - 1) == RefusalCode::kOutOfRange);
    CHECK(parameters.set(spec.id, spec.maximum * 1.5f + 1) == RefusalCode::kOutOfRange);
  }
}
