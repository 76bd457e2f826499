#include "board_keeper.hpp"

#include "built_in_boards.hpp"
#include "check.hpp"
#include "memory_store.hpp"
#include "parameters.hpp"
#include "twin_store.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

/// The built-in board with another pin for the left IN1.
BoardDescription variant(int8_t in1) {
  BoardDescription board = kBoardOfEsp32;
  board.left_in1 = in1;
  return board;
}

struct Packed {
  explicit Packed(const BoardDescription& board) { write_board(board, bytes); }
  uint8_t bytes[BoardDescription::kSize];
};

/// A store whose power is cut at a write: from then on nothing is written.
class CutStore final : public ParameterStore {
 public:
  explicit CutStore(MemoryStore& store) : store_(store) {}
  int writes_left = 1000;

  size_t load(uint8_t* out, size_t capacity) override { return store_.load(out, capacity); }
  bool save(const uint8_t* data, size_t size) override {
    return writes_left-- > 0 && store_.save(data, size);
  }
  bool erase() override { return writes_left-- > 0 && store_.erase(); }

 private:
  MemoryStore& store_;
};

/// A device that starts with what the store holds.
struct Start {
  explicit Start(ParameterStore& store, const BoardDescription* built_in = &kBoardOfEsp32)
      : keeper(store, Chip::kEsp32, built_in) {
    keeper.start();
  }
  RefusalCode confirm() { return keeper.confirm(keeper.fingerprint()); }
  BoardKeeper keeper;
};

struct TwoSlots {
  MemoryStore first, second;
  CutStore cut{first};
  TwinStore store{cut, second};

  /// Whatever lies in it.
  static void damage(MemoryStore& slot) {
    if (!slot.block.empty()) slot.block.back() ^= 1;
  }
};

/// Writes a board, and asks for the restart that tries it.
void write_and_restart(ParameterStore& store, const BoardDescription& board) {
  Start start(store);
  start.keeper.write(Packed(board).bytes);
  start.keeper.request_trial();
}

}  // namespace

TEST(keeper_without_a_stored_board_has_the_images) {
  MemoryStore store;
  const Start start(store);
  CHECK(start.keeper.state() == BoardState::kBuiltIn && start.keeper.board() == kBoardOfEsp32);
  CHECK(Start(store, nullptr).keeper.state() == BoardState::kNone);
}

TEST(keeper_tries_a_written_board_and_keeps_it_when_confirmed) {
  MemoryStore store;
  Start first(store);
  CHECK(first.keeper.write(Packed(variant(21)).bytes) == RefusalCode::kNone);
  CHECK(first.keeper.state() == BoardState::kBuiltIn);  // Until the next start.
  CHECK(first.keeper.request_trial() == RefusalCode::kNone);

  Start second(store);
  CHECK(second.keeper.on_trial() && second.keeper.board().left_in1 == 21);
  CHECK(second.keeper.write(Packed(variant(22)).bytes) == RefusalCode::kBoardOnTrial);
  CHECK(second.keeper.confirm(fingerprint(variant(22))) == RefusalCode::kBoardRefused);
  CHECK(second.confirm() == RefusalCode::kNone);
  CHECK(second.keeper.state() == BoardState::kStored);
  CHECK(second.confirm() == RefusalCode::kNoBoardOnTrial);
  CHECK(Start(store).keeper.state() == BoardState::kStored);
  CHECK(Start(store).keeper.board().left_in1 == 21);
}

TEST(keeper_tries_no_board_without_a_restart_in_the_session_that_wrote_it) {
  MemoryStore store;
  Start(store).keeper.write(Packed(variant(21)).bytes);
  CHECK(Start(store).keeper.state() == BoardState::kBuiltIn);  // It lost its power instead.

  Start first(store);
  first.keeper.write(Packed(variant(21)).bytes);
  CHECK(first.keeper.has_candidate());
  first.keeper.drop_candidate();
  CHECK(!first.keeper.has_candidate() && first.keeper.request_trial() == RefusalCode::kNone);
  CHECK(Start(store).keeper.state() == BoardState::kBuiltIn);
}

TEST(keeper_confirms_the_images_board_by_its_fingerprint) {
  MemoryStore store;
  Start first(store);
  CHECK(!first.keeper.is_confirmed());
  CHECK(first.keeper.confirm(fingerprint(variant(21))) == RefusalCode::kBoardRefused);
  CHECK(Start(store).keeper.state() == BoardState::kBuiltIn);
  CHECK(first.confirm() == RefusalCode::kNone);
  CHECK(!first.keeper.is_confirmed());  // Its pins are started by the next start.
  CHECK(first.confirm() == RefusalCode::kNone);

  const Start second(store, nullptr);
  CHECK(second.keeper.state() == BoardState::kStored && second.keeper.is_confirmed());
  CHECK(second.keeper.fingerprint() == fingerprint(kBoardOfEsp32));
}

TEST(keeper_cannot_confirm_what_it_cannot_save) {
  MemoryStore store;
  store.failing = true;
  Start start(store);
  CHECK(start.confirm() == RefusalCode::kStoreFailed);
  store.failing = false;
  CHECK(Start(store).keeper.state() == BoardState::kBuiltIn);
}

TEST(keeper_of_a_simulated_robot_has_its_board_confirmed) {
  MemoryStore store;
  BoardKeeper keeper(store, Chip::kEsp32, &kBoardOfEsp32, BoardKeeper::BuiltIn::kConfirmed);
  keeper.start();
  CHECK(keeper.state() == BoardState::kStored && keeper.is_confirmed());
}

TEST(keeper_returns_to_the_previous_board_without_a_confirmation) {
  MemoryStore store;
  write_and_restart(store, variant(21));
  {
    const Start trial(store);
    CHECK(trial.keeper.on_trial());
    CHECK(!trial.keeper.is_overdue(kStoreTrialUs - 1) && trial.keeper.is_overdue(kStoreTrialUs));
  }
  const Start after(store);
  CHECK(after.keeper.state() == BoardState::kBuiltIn && after.keeper.board() == kBoardOfEsp32);
  CHECK(Start(store).keeper.state() == BoardState::kBuiltIn);
}

TEST(keeper_refuses_what_cannot_be_used) {
  MemoryStore store;
  Start start(store);
  CHECK(start.keeper.write(Packed(kBoardOfEsp32s3).bytes) == RefusalCode::kBoardRefused);
  CHECK(start.keeper.write(Packed(variant(34)).bytes) == RefusalCode::kBoardRefused);
  Packed damaged(variant(21));
  damaged.bytes[20] ^= 1;
  CHECK(start.keeper.write(damaged.bytes) == RefusalCode::kBoardRefused);
  CHECK(Start(store).keeper.state() == BoardState::kBuiltIn);
}

TEST(keeper_of_a_damaged_block_drives_nothing) {
  MemoryStore store;
  Start(store).keeper.write(Packed(variant(21)).bytes);
  uint8_t block[BoardStore::Block::kSize];
  const size_t size = store.load(block, sizeof block);
  CHECK(size == sizeof block);
  for (size_t i = 0; i < size; ++i) {
    block[i] ^= 4;
    MemoryStore damaged;
    damaged.save(block, size);
    CHECK(Start(damaged).keeper.state() == BoardState::kNone);
    block[i] ^= 4;
  }
  MemoryStore longer;
  uint8_t more[BoardStore::Block::kSize + 1]{};
  longer.save(more, sizeof more);
  CHECK(Start(longer).keeper.state() == BoardState::kNone);
}

TEST(keeper_none_of_whose_slots_is_whole_has_no_board) {
  for (const bool only_one_was_saved : {true, false}) {
    MemoryStore slots[2];
    TwinStore store(slots[0], slots[1]);
    Start start(store);
    CHECK(start.keeper.write(Packed(variant(21)).bytes) == RefusalCode::kNone);
    if (!only_one_was_saved) CHECK(start.keeper.request_trial() == RefusalCode::kNone);
    CHECK(slots[1].block.empty() == only_one_was_saved);
    for (MemoryStore& slot : slots) {
      if (!slot.block.empty()) slot.block.back() ^= 1;
    }
    CHECK(Start(store).keeper.state() == BoardState::kNone);
  }
}

TEST(keeper_of_a_damaged_block_has_no_board_until_one_is_confirmed) {
  TwoSlots slots;
  CHECK(Start(slots.store).confirm() == RefusalCode::kNone);
  TwoSlots::damage(slots.first);
  TwoSlots::damage(slots.second);
  {
    Start start(slots.store);
    CHECK(start.keeper.state() == BoardState::kNone);
    CHECK(start.keeper.write(Packed(variant(21)).bytes) == RefusalCode::kNone);
  }
  CHECK(Start(slots.store).keeper.state() == BoardState::kNone);
  write_and_restart(slots.store, variant(21));
  CHECK(Start(slots.store).keeper.on_trial());  // And loses its power.
  CHECK(Start(slots.store).keeper.state() == BoardState::kNone);
  write_and_restart(slots.store, variant(21));
  CHECK(Start(slots.store).confirm() == RefusalCode::kNone);
  CHECK(Start(slots.store).keeper.state() == BoardState::kStored);
}

TEST(keeper_has_the_confirmed_board_though_the_newest_block_is_damaged) {
  for (const bool has_former : {false, true}) {
    TwoSlots slots;
    if (has_former) {
      write_and_restart(slots.store, variant(22));
      CHECK(Start(slots.store).confirm() == RefusalCode::kNone);
    }
    write_and_restart(slots.store, variant(21));
    CHECK(Start(slots.store).confirm() == RefusalCode::kNone);
    for (MemoryStore* const slot : {&slots.first, &slots.second}) {
      const std::vector<uint8_t> whole = slot->block;
      TwoSlots::damage(*slot);
      const Start start(slots.store);
      CHECK(start.keeper.state() == BoardState::kStored && start.keeper.board().left_in1 == 21);
      slot->block = whole;
    }
  }
}

TEST(keeper_drives_on_a_confirmed_board_once_both_slots_hold_it) {
  TwoSlots slots;
  write_and_restart(slots.store, variant(21));
  // The first slot has the trial, the second one the confirmation; then the power goes.
  slots.cut.writes_left = 1;
  CHECK(Start(slots.store).confirm() == RefusalCode::kStoreFailed);
  CHECK(Start(slots.store).keeper.state() == BoardState::kNone);  // The flash still refuses.
  slots.cut.writes_left = 1;
  CHECK(Start(slots.store).keeper.state() == BoardState::kStored);
  TwoSlots::damage(slots.second);
  CHECK(Start(slots.store).keeper.state() == BoardState::kStored);
}

/// From the first write of a board to the last, whatever write the power is cut at: the next starts
/// have the previous board or the new one, and never stay on trial.
TEST(keeper_survives_a_power_cut_at_every_write) {
  for (const bool confirms : {false, true}) {
    for (int cut = 0; cut < 8; ++cut) {
      MemoryStore memory;
      CutStore store(memory);
      store.writes_left = cut;
      {
        write_and_restart(store, variant(21));
      }
      {
        Start start(store);
        if (confirms && start.keeper.on_trial()) start.confirm();
      }
      // The power is back.
      const Start next(memory);
      CHECK(next.keeper.state() != BoardState::kNone);
      const Start last(memory);
      CHECK(!last.keeper.on_trial());
      const bool is_previous =
          last.keeper.state() == BoardState::kBuiltIn && last.keeper.board() == kBoardOfEsp32;
      const bool is_new =
          last.keeper.state() == BoardState::kStored && last.keeper.board().left_in1 == 21;
      CHECK(is_previous != is_new);
      // Confirmed means saved, from the write on that confirms.
      CHECK(is_new == (confirms && cut >= 4));
    }
  }
}

TEST(keeper_makes_the_boards_numbers_the_defaults) {
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
