#include "twin_store.hpp"

#include "check.hpp"
#include "protocol.hpp"
#include "slots.hpp"
#include "wire.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

using Block = std::vector<uint8_t>;

const Block kOld{1, 2, 3};
const Block kNew{4, 5};

/// What a start finds, which knows nothing of the one before.
struct Found {
  Block block;
  uint32_t faults;
  bool has_lost_copy;
  bool is_incomplete;
};

struct Slots {
  FakeSlot slots[2];

  Block& operator[](int slot) { return slots[slot].memory.block; }
  bool save(const Block& block) {
    return TwinStore(slots[0], slots[1]).save(block.data(), block.size());
  }
  Found start() {
    TwinStore store(slots[0], slots[1]);
    return start(store);
  }
  static Found start(TwinStore& store) {
    uint8_t bytes[TwinStore::kCapacity];
    const size_t size = store.load(bytes, sizeof bytes);
    return {{bytes, bytes + size}, store.faults(), store.has_lost_copy(), store.is_incomplete()};
  }
  bool repair() {
    TwinStore store(slots[0], slots[1]);
    start(store);
    return store.repair();
  }
  void cut_after(int& writes) {
    for (FakeSlot& slot : slots) slot.left = &writes;
  }
};

}  // namespace

TEST(a_save_is_done_once_both_slots_hold_it) {
  Slots slots;
  CHECK(slots.start().block.empty() && slots.start().faults == 0);
  for (uint8_t i = 1; i < 20; ++i) {
    CHECK(slots.save({i, i}));
    CHECK(slots[0] == slots[1]);
    const Found found = slots.start();
    CHECK(found.block == Block({i, i}) && !found.has_lost_copy && !found.is_incomplete);
  }
}

TEST(a_slot_with_any_damaged_bit_is_reported_and_repaired) {
  Slots slots;
  CHECK(slots.save(kOld) && slots.save(kNew));
  const Block whole = slots[0];
  for (const int slot : {0, 1}) {
    for (size_t bit = 0; bit < whole.size() * 8; ++bit) {
      slots[slot][bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
      const Found found = slots.start();
      CHECK(found.block == kNew && found.faults == 0 && found.has_lost_copy && found.is_incomplete);
      CHECK(slots.repair() && slots[slot] == whole);
      CHECK(!slots.start().has_lost_copy && !slots.start().is_incomplete);
    }
    for (size_t size = 0; size < whole.size(); ++size) {
      slots[slot].resize(size);
      CHECK(slots.start().block == kNew && slots.start().has_lost_copy && slots.repair());
    }
  }
}

TEST(a_repair_that_fails_is_still_to_be_done) {
  Slots slots;
  CHECK(slots.save(kNew));
  slots[1].clear();
  int writes = 0;
  slots.cut_after(writes);
  CHECK(!slots.repair() && slots.start().is_incomplete);
  writes = 1;
  CHECK(slots.repair() && !slots.start().is_incomplete && slots[0] == slots[1]);
}

TEST(two_damaged_slots_are_a_fault_until_the_next_save) {
  for (const bool both_damaged : {true, false}) {
    Slots slots;
    CHECK(slots.save(kOld));
    slots[0][0] ^= 1;
    if (both_damaged) slots[1].back() ^= 1;
    if (!both_damaged) slots[1].clear();
    CHECK(slots.start().block.empty() && slots.start().faults == fault::kStoreUnreadable);
    CHECK(slots.save(kNew) && slots.start().block == kNew && slots.start().faults == 0);
  }
}

TEST(a_power_cut_at_any_write_leaves_the_old_block_or_the_new_one) {
  for (const bool loses : {false, true}) {
    for (int writes = 0; writes < 3; ++writes) {
      Slots slots;
      CHECK(slots.save(kOld));
      for (FakeSlot& slot : slots.slots) slot.loses = loses;
      int left = writes;
      slots.cut_after(left);
      CHECK(slots.save(kNew) == (writes == 2));
      slots.cut_after(left = 99);
      const Found found = slots.start();
      CHECK(found.faults == 0 && found.block == (writes == 0 ? kOld : kNew));
      CHECK(slots.repair() && slots[0] == slots[1] && slots.start().block == found.block);
    }
  }
}

TEST(a_save_that_was_lost_without_a_word_is_repeated) {
  for (const bool keeps_old : {false, true}) {
    Slots slots;
    CHECK(slots.save({8, 9}));  // as long as the new one
    slots.slots[1].lost = 1;
    slots.slots[1].keeps_old = keeps_old;
    slots.slots[1].saves = 0;
    CHECK(slots.save(kNew));
    CHECK(slots.slots[1].saves == 2 && slots.start().block == kNew);
    CHECK(!slots.start().is_incomplete);
  }
}

TEST(a_slot_that_keeps_nothing_is_reported) {
  Slots slots;
  CHECK(slots.save(kOld));
  slots.slots[1].lost = 99;
  CHECK(!slots.save(kNew));
  CHECK(slots.start().block == kOld && slots.start().is_incomplete);
}

TEST(a_slot_that_cannot_be_read_counts_only_where_the_other_is_no_good) {
  for (const int unread : {0, 1}) {
    Slots slots;
    CHECK(slots.save(kOld));
    slots[unread].clear();
    slots.slots[unread].found = fault::kStoreNewer;
    CHECK(slots.start().block == kOld && slots.start().faults == 0);
    slots[1 - unread].back() ^= 1;
    CHECK(slots.start().faults == (fault::kStoreNewer | fault::kStoreUnreadable));
  }
}

TEST(the_number_may_wrap) {
  Slots slots;
  CHECK(slots.save(kOld));
  // The number comes four bytes before the checksum.
  slots[0] = slots[1] = sealed({slots[0].begin(), slots[0].end() - 8}, UINT32_MAX - 1);
  for (uint8_t i = 10; i < 16; ++i) {
    int writes = 1;
    slots.cut_after(writes);
    CHECK(!slots.save({i}));
    CHECK(slots.start().block == Block({i}) && slots.start().is_incomplete);
    slots.cut_after(writes = 99);
    CHECK(slots.repair());
  }
}

TEST(what_is_too_long_is_refused) {
  Slots slots;
  CHECK(!slots.save(Block(TwinStore::kCapacity + 1)) && !slots.save({}));
  CHECK(slots.save(Block(TwinStore::kCapacity, 7)));
  CHECK(slots.start().block == Block(TwinStore::kCapacity, 7));
  slots[0].resize(TwinStore::kCapacity + TwinStore::kTail + 1);
  CHECK(slots.start().has_lost_copy);
}

TEST(what_earlier_firmware_wrote_is_named) {
  Slots slots;
  slots[0] = sealed(kOld, 1);
  CHECK(slots.start().block.empty() && slots.start().faults == fault::kStoreOutdated);
  slots[1] = sealed(kNew, 1);
  CHECK(slots.start().faults == fault::kStoreOutdated);
  CHECK(slots.save(kNew) && slots.start().block == kNew && slots.start().faults == 0);
}

TEST(a_configuration_that_is_gone_is_damaged_where_another_block_is_left) {
  Slots configuration, other, latches;
  // With the configuration's store or the other one, as after a start.
  const auto with = [&](bool of_configuration, auto use) {
    TwinStore first(configuration.slots[0], configuration.slots[1]);
    TwinStore second(other.slots[0], other.slots[1]);
    TwinStore third(latches.slots[0], latches.slots[1]);
    first.record(second, third);
    return use(of_configuration ? first : second);
  };
  const auto start = [&](bool of_configuration) {
    return with(of_configuration, [](TwinStore& store) { return Slots::start(store); });
  };
  const auto save = [&](const Block& block, bool of_configuration) {
    return with(of_configuration,
                [&](TwinStore& store) { return store.save(block.data(), block.size()); });
  };
  CHECK(save(kOld, true) && save(kNew, false));
  configuration[0] = configuration[1] = {};
  CHECK(start(true).faults == fault::kStoreUnreadable);
  CHECK(start(false).block == kNew && start(false).faults == 0);
  // Saving another block leaves it damaged; saving a configuration ends it, and knows of the rest.
  CHECK(save(kOld, false) && start(true).faults == fault::kStoreUnreadable);
  CHECK(save(kNew, true) && start(true).faults == 0);
  other[0] = other[1] = {};
  CHECK(start(false).faults == fault::kStoreUnreadable);
}
