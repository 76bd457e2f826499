#include "configuration.hpp"

#include "built_in_boards.hpp"
#include "parameters.hpp"
#include "sensor_bench.hpp"
#include "slots.hpp"

using namespace wheelwire;
using namespace wheelwire::test;
using enum ConfigurationState;

namespace {

const Configuration kBuiltInOne{.board = kBoardOfEsp32, .peripherals = {}};

/// The built-in board with another pin for the left IN1, and two bumpers.
Configuration variant(int8_t in1) {
  Configuration configuration = kBuiltInOne;
  configuration.board.left_in1 = in1;
  configuration.peripherals = list_of({bumper(Place::kFront), bumper(Place::kRear, 39)});
  return configuration;
}

Configuration other() {
  Configuration configuration = variant(21);
  configuration.board.pwm_frequency_hz = 18'000;
  return configuration;
}

/// A device that starts with what the store holds.
struct Start {
  explicit Start(BlockStore& store, const Configuration* built_in = &kBuiltInOne)
      : active(&store, Chip::kEsp32, built_in) {
    active.start();
  }
  RefusalCode write(const Configuration& configuration) {
    uint8_t board[BoardDescription::kSize];
    configuration.board.encode(board);
    active.stage_board(board);
    for (size_t i = 0; i < configuration.peripherals.count; ++i) {
      uint8_t entry[Peripheral::kSize];
      configuration.peripherals.entries[i].encode(entry);
      active.stage_peripheral(i, entry);
    }
    return active.write(configuration.peripherals.count, configuration.fingerprint());
  }
  RefusalCode confirm() { return active.confirm(active.fingerprint()); }
  bool has(const Configuration& configuration, ConfigurationState state) const {
    return active.state() == state && active.fingerprint() == configuration.fingerprint() &&
           active.board() == configuration.board &&
           active.peripherals().count == configuration.peripherals.count;
  }

  ActiveConfiguration active;
};

/// Writes one, and asks for the restart that tries it.
void write_and_restart(BlockStore& store, const Configuration& configuration) {
  Start start(store);
  CHECK(start.write(configuration) != RefusalCode::kBoardRefused);
  start.active.request_trial();
}

/// And confirms it at that start.
void write_and_confirm(BlockStore& store, const Configuration& configuration) {
  write_and_restart(store, configuration);
  CHECK(Start(store).confirm() == RefusalCode::kNone);
}

}  // namespace

TEST(a_configuration_survives_the_way_to_bytes_and_back_and_has_its_fingerprint) {
  const Configuration wanted = variant(21);
  uint8_t packed[Configuration::kSize];
  CHECK(wanted.encode(packed) == wanted.fingerprint());
  Configuration found;
  CHECK(Configuration::decode(packed, sizeof packed, found));
  CHECK(found.board == wanted.board && found.fingerprint() == wanted.fingerprint());
  for (size_t bit = 0; bit < 8 * sizeof packed; ++bit) {
    packed[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    CHECK(!Configuration::decode(packed, sizeof packed, found));
    packed[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
  }
  CHECK(!Configuration::decode(packed, sizeof packed - 1, found));
  Configuration fewer = variant(21);
  --fewer.peripherals.count;
  CHECK(variant(21).fingerprint() != other().fingerprint());
  CHECK(variant(21).fingerprint() != fewer.fingerprint());
  // What lies behind the last entry does not count.
  Configuration rest = variant(21);
  rest.peripherals.entries[5].pin_a = 4;
  CHECK(rest.fingerprint() == variant(21).fingerprint());
}

TEST(what_was_written_is_tried_and_kept_when_confirmed) {
  MemoryStore store;
  Start first(store);
  CHECK(first.write(variant(21)) == RefusalCode::kNone);
  CHECK(first.active.state() == kBuiltIn);  // Until the next start.
  CHECK(first.active.request_trial() == RefusalCode::kNone);

  Start second(store);
  CHECK(second.has(variant(21), kTrial));
  CHECK(second.active.refusal() == RefusalCode::kBoardOnTrial);
  CHECK(second.write(other()) == RefusalCode::kBoardOnTrial);
  CHECK(second.active.confirm(other().fingerprint()) == RefusalCode::kBoardRefused);
  CHECK(second.confirm() == RefusalCode::kNone);
  CHECK(second.active.state() == kStored && second.active.refusal() == RefusalCode::kNone);
  CHECK(second.confirm() == RefusalCode::kNoBoardOnTrial);
  CHECK(Start(store).has(variant(21), kStored));
}

TEST(nothing_is_tried_without_a_restart_in_the_session_that_wrote_it) {
  MemoryStore store;
  Start(store).write(variant(21));
  CHECK(Start(store).active.state() == kBuiltIn);  // It lost its power instead.

  Start first(store);
  first.write(variant(21));
  CHECK(first.active.has_candidate());
  first.active.drop_candidate();
  CHECK(!first.active.has_candidate() && first.active.request_trial() == RefusalCode::kNone);
  CHECK(Start(store).active.state() == kBuiltIn);
}

TEST(what_another_session_has_set_is_not_written) {
  MemoryStore store;
  Start start(store);
  start.write(variant(21));
  start.active.drop_candidate();
  CHECK(start.active.write(2, variant(21).fingerprint()) == RefusalCode::kBoardRefused);
}

TEST(the_images_configuration_is_active_without_another_and_is_confirmed_by_its_fingerprint) {
  MemoryStore store;
  CHECK(Start(store, nullptr).active.state() == kDamaged);
  Start first(store);
  CHECK(first.has(kBuiltInOne, kBuiltIn) && !first.active.is_confirmed());
  CHECK(first.active.refusal() == RefusalCode::kBoardUnconfirmed);
  CHECK(first.active.confirm(variant(21).fingerprint()) == RefusalCode::kBoardRefused);
  CHECK(Start(store).active.state() == kBuiltIn);
  CHECK(first.confirm() == RefusalCode::kNone);
  CHECK(!first.active.is_confirmed());  // Its pins are started by the next start.
  CHECK(first.confirm() == RefusalCode::kNone);
  CHECK(Start(store, nullptr).has(kBuiltInOne, kStored));
}

TEST(the_previous_configuration_returns_without_a_confirmation) {
  MemoryStore store;
  write_and_restart(store, variant(21));
  {
    const Start trial(store);
    CHECK(trial.active.on_trial());
    CHECK(!trial.active.is_overdue(kConfigurationTrialUs - 1));
    CHECK(trial.active.is_overdue(kConfigurationTrialUs));
  }
  CHECK(Start(store).has(kBuiltInOne, kBuiltIn));
  CHECK(Start(store).has(kBuiltInOne, kBuiltIn));
}

TEST(a_configuration_that_cannot_be_used_is_refused) {
  MemoryStore store;
  Start start(store);
  Configuration of_another_chip = variant(21);
  of_another_chip.board = kBoardOfEsp32s3;
  CHECK(start.write(of_another_chip) == RefusalCode::kBoardRefused);
  CHECK(start.write(variant(34)) == RefusalCode::kBoardRefused);  // An input alone.
  Configuration with_a_pin_twice = variant(21);
  with_a_pin_twice.peripherals.entries[1].pin_a = 36;
  CHECK(start.write(with_a_pin_twice) == RefusalCode::kBoardRefused);
  CHECK(start.write(variant(21)) == RefusalCode::kNone);
  CHECK(start.active.write(1, variant(21).fingerprint()) == RefusalCode::kBoardRefused);
  CHECK(start.active.write(kMostPeripherals + 1, 0) == RefusalCode::kBoardRefused);
  uint8_t entry[Peripheral::kSize]{};
  CHECK(start.active.stage_peripheral(kMostPeripherals, entry) == RefusalCode::kOutOfRange);
}

TEST(one_damaged_slot_leaves_the_confirmed_configuration) {
  for (const bool has_former : {false, true}) {
    for (const int slot : {0, 1}) {
      SlotFlash flash;
      if (has_former) {
        write_and_confirm(flash.configuration(), other());
      }
      write_and_confirm(flash.configuration(), variant(21));
      flash.bytes(StoredBlock::kConfiguration, slot).back() ^= 1;
      CHECK(Start(flash.configuration()).has(variant(21), kStored));
      flash.bytes(StoredBlock::kConfiguration, 1 - slot).back() ^= 1;
      CHECK(Start(flash.configuration()).active.state() == kDamaged);
    }
  }
}

TEST(a_block_of_another_size_or_chip_is_damaged_until_a_configuration_is_confirmed) {
  MemoryStore store;
  store.block = {1, 2, 3};
  Start start(store);
  CHECK(start.active.state() == kDamaged && start.active.faults() == fault::kStoreUnreadable);
  CHECK(start.write(variant(21)) == RefusalCode::kNone);
  CHECK(Start(store).active.state() == kDamaged);
  write_and_restart(store, variant(21));
  CHECK(Start(store).active.on_trial());  // And loses its power.
  CHECK(Start(store).active.state() == kDamaged);
  write_and_confirm(store, variant(21));
  CHECK(Start(store).has(variant(21), kStored));
  ActiveConfiguration other_chip(&store, Chip::kEsp32s3, &kBuiltInOne);
  other_chip.start();
  CHECK(other_chip.state() == kDamaged && other_chip.peripherals().count == 0);
}

TEST(the_boards_numbers_are_the_defaults) {
  ParameterSpec specs[kParameterCount];
  platform_specs(Chip::kEsp32, specs);
  BoardDescription board = kBoardOfEsp32;
  board.pwm_frequency_hz = 18'000;
  board.encoder_filter_ns = 250;
  board.estop = -1;
  apply_board(board, specs);
  const Parameters parameters(specs);
  CHECK(parameters.get(ParameterId::kPwmFrequencyHz) == 18'000);
  CHECK(parameters.get(ParameterId::kGlitchFilterNs) == 250);
  CHECK(!parameters.is_on(ParameterId::kEstopInputEnabled));
}
