#include "twin_store.hpp"

#include "check.hpp"
#include "crc32.hpp"
#include "memory_store.hpp"
#include "protocol.hpp"

using namespace wheelwire;

namespace {

using Block = std::vector<uint8_t>;

const Block kOld{1, 2, 3};
const Block kNew{4, 5};

/// A slot whose saves can go wrong without a word.
class BadSlot final : public ParameterStore {
 public:
  size_t load(uint8_t* out, size_t capacity) override { return memory.load(out, capacity); }
  bool save(const uint8_t* data, size_t size) override {
    ++saves;
    if (lost > 0) {
      --lost;
      memory.block.clear();
      return true;
    }
    return memory.save(data, size);
  }
  bool erase() override {
    return erasures == nullptr || (*erasures)-- > 0 ? memory.erase() : false;
  }
  uint32_t faults() override { return found; }

  MemoryStore memory;
  int lost = 0;  ///< So many saves are taken, and lost.
  int saves = 0;
  int* erasures = nullptr;  ///< So many more before the power fails.
  uint32_t found = 0;
};

struct Bench {
  BadSlot slots[2];
  TwinStore store{slots[0], slots[1]};

  bool save(const Block& block) { return store.save(block.data(), block.size()); }
  Block load() {
    // Another one reads: after a restart nothing is known.
    TwinStore restarted{slots[0], slots[1]};
    uint8_t bytes[TwinStore::kCapacity];
    const size_t size = restarted.load(bytes, sizeof bytes);
    faults = restarted.faults();
    return {bytes, bytes + size};
  }
  uint32_t faults = 0;
};

}  // namespace

TEST(the_last_block_is_in_force_and_the_one_before_is_left_alone) {
  Bench bench;
  CHECK(bench.load().empty() && bench.faults == 0);
  for (uint8_t i = 1; i < 20; ++i) {
    const Block before[2] = {bench.slots[0].memory.block, bench.slots[1].memory.block};
    CHECK(bench.save({i, i}));
    CHECK(bench.load() == Block({i, i}));
    const bool first_kept = bench.slots[0].memory.block == before[0];
    const bool second_kept = bench.slots[1].memory.block == before[1];
    CHECK(first_kept != second_kept);
    CHECK(bench.slots[first_kept ? 1 : 0].memory.block != before[first_kept ? 1 : 0]);
  }
}

TEST(a_save_that_is_torn_at_any_byte_leaves_the_old_block) {
  Bench bench;
  CHECK(bench.save(kOld) && bench.save(kNew));
  // The newest is in the second slot.
  const Block whole = bench.slots[1].memory.block;
  for (size_t size = 0; size < whole.size(); ++size) {
    bench.slots[1].memory.block.assign(whole.begin(), whole.begin() + static_cast<long>(size));
    CHECK(bench.load() == kOld && bench.faults == 0);
  }
  for (size_t i = 0; i < whole.size(); ++i) {
    bench.slots[1].memory.block = whole;
    bench.slots[1].memory.block[i] ^= 0x10;
    CHECK(bench.load() == kOld && bench.faults == 0);
    CHECK(bench.save(kNew) && bench.load() == kNew);
  }
}

TEST(a_save_that_was_lost_without_a_word_is_repeated) {
  Bench bench;
  CHECK(bench.save(kOld));
  bench.slots[1].lost = 1;
  CHECK(bench.save(kNew));
  CHECK(bench.slots[1].saves == 2 && bench.load() == kNew);
}

TEST(a_slot_that_keeps_nothing_is_told) {
  Bench bench;
  CHECK(bench.save(kOld));
  bench.slots[1].lost = 99;
  CHECK(!bench.save(kNew));
  CHECK(bench.load() == kOld);
}

TEST(an_erasure_that_is_cut_leaves_the_block_in_force) {
  for (int newest = 0; newest < 2; ++newest) {
    Bench bench;
    CHECK(bench.save({9}) && bench.save(kOld));
    if (newest == 0) CHECK(bench.save(kNew));
    const Block in_force = newest == 0 ? kNew : kOld;
    int left = 1;
    for (BadSlot& slot : bench.slots) slot.erasures = &left;
    CHECK(!bench.store.erase());
    CHECK(bench.load() == in_force);
    left = 2;
    CHECK(bench.store.erase() && bench.load().empty());
  }
}

TEST(two_damaged_slots_are_a_fault_and_two_empty_ones_are_not) {
  Bench bench;
  CHECK(bench.save(kOld) && bench.save(kNew));
  for (BadSlot& slot : bench.slots) slot.memory.block[0] ^= 1;
  CHECK(bench.load().empty() && bench.faults == fault::kStoreUnreadable);
  CHECK(bench.store.erase());
  CHECK(bench.load().empty() && bench.faults == 0);
}

TEST(a_slot_that_cannot_be_read_counts_only_where_the_other_is_no_good) {
  for (const int unread : {0, 1}) {
    Bench bench;
    CHECK(bench.save(kOld) && bench.save(kNew));
    bench.slots[unread].memory.block.clear();
    bench.slots[unread].found = fault::kStoreUnreadable;
    CHECK(bench.load() == (unread == 0 ? kNew : kOld) && bench.faults == 0);
    bench.slots[1 - unread].memory.block.clear();
    CHECK(bench.load().empty() && bench.faults == fault::kStoreUnreadable);
  }
}

TEST(what_is_wrong_with_one_slot_stands_beside_the_damage_of_the_other) {
  for (const int newer : {0, 1}) {
    Bench bench;
    CHECK(bench.save(kOld) && bench.save(kNew));
    bench.slots[newer].memory.block.clear();
    bench.slots[newer].found = fault::kStoreNewer;
    bench.slots[1 - newer].memory.block.back() ^= 1;
    CHECK(bench.load().empty() && bench.faults == (fault::kStoreNewer | fault::kStoreUnreadable));
  }
}

TEST(the_number_may_wrap) {
  Bench bench;
  CHECK(bench.save(kOld));
  // Numbers only grow by saves: from -2 on, as four bytes before the checksum.
  uint8_t at_the_end[] = {1, 2, 3, 0xfe, 0xff, 0xff, 0xff};
  Block bytes(at_the_end, at_the_end + sizeof at_the_end);
  const uint32_t sum = crc32(bytes.data(), bytes.size());
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<uint8_t>(sum >> 8 * i));
  bench.slots[0].memory.block = bytes;
  for (uint8_t i = 10; i < 16; ++i) {
    CHECK(bench.save({i}));
    CHECK(bench.load() == Block({i}));
  }
}

TEST(what_is_too_long_is_refused) {
  Bench bench;
  CHECK(!bench.save(Block(TwinStore::kCapacity + 1)));
  CHECK(bench.save(Block(TwinStore::kCapacity, 7)));
  CHECK(bench.load() == Block(TwinStore::kCapacity, 7));
}

TEST(a_damaged_slot_is_told_of_whatever_is_in_the_other_one) {
  for (const int damaged : {0, 1}) {
    for (const bool is_other_damaged : {false, true}) {
      Bench bench;
      CHECK(bench.save(kOld) && bench.save(kNew));
      Block& block = bench.slots[damaged].memory.block;
      block.back() ^= 1;
      Block& other = bench.slots[1 - damaged].memory.block;
      if (is_other_damaged) {
        other.back() ^= 1;
      } else {
        other.clear();  // never saved
      }
      CHECK(bench.load().empty() && bench.faults == fault::kStoreUnreadable);
      // The next save ends that.
      CHECK(bench.save(kNew) && bench.load() == kNew && bench.faults == 0);
    }
  }
}
