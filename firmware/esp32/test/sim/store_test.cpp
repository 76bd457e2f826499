#include "store.hpp"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <string>

#include "check.hpp"
#include "protocol.hpp"

using wheelwire::sim::Partition;
using wheelwire::sim::Store;
using wheelwire::sim::StoreWatch;
using wheelwire::sim::WriteFate;

namespace {

constexpr uint8_t kBlock[] = {1, 2, 3};

void keeps_what_is_saved(Store& store) {
  uint8_t out[8] = {};
  CHECK(store.load(out, sizeof out) == 0);
  CHECK(store.save(kBlock, sizeof kBlock));
  CHECK(store.load(out, sizeof out) == 3 && out[0] == 1 && out[2] == 3);
  CHECK(store.load(out, 1) == 3);
  store.failing = true;
  CHECK(!store.save(kBlock, 1) && !store.erase());
  CHECK(store.load(out, sizeof out) == 3);
  store.failing = false;
  CHECK(store.erase() && store.load(out, sizeof out) == 0);
  CHECK(store.erase());
}

}  // namespace

TEST(store_in_memory) {
  Store store;
  keeps_what_is_saved(store);
}

namespace {

/// A folder with a file for a store, both gone at the end.
struct Folder {
  char name[64] = "/tmp/wheelwire-store-XXXXXX";
  std::string path;

  Folder() {
    CHECK(::mkdtemp(name) != nullptr);
    path = std::string(name) + "/parameters";
  }
  ~Folder() {
    ::unlink(path.c_str());
    CHECK(::rmdir(name) == 0);  // Nothing else is left behind.
  }
  std::string read() const {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  void write(const std::string& content) const { std::ofstream(path, std::ios::binary) << content; }
  /// What a program that starts now finds.
  size_t load(uint32_t& faults) const {
    Store store;
    store.use_file(path);
    uint8_t out[8] = {};
    const size_t size = store.load(out, sizeof out);
    faults = store.faults();
    return size;
  }
};

// By hand: a header of 4 bytes, then each slot with its size of 2 bytes, in 512 bytes.
constexpr size_t kSlotAt[] = {4, 4 + 512};
constexpr size_t kFileSize = 4 + 2 * 512;

}  // namespace

TEST(store_in_a_file) {
  const Folder folder;
  const std::string path = folder.path;
  Store store;
  store.use_file(path);
  keeps_what_is_saved(store);
  CHECK(store.save(kBlock, sizeof kBlock));
  Store another;
  another.use_file(path);
  uint8_t out[8] = {};
  CHECK(another.load(out, sizeof out) == 3);
  CHECK(another.erase());
  CHECK(::access(path.c_str(), F_OK) != 0);
}

TEST(a_file_has_two_slots_of_which_the_newest_whole_one_is_in_force) {
  const Folder folder;
  const uint8_t second[] = {4, 5};
  {
    Store store;
    store.use_file(folder.path);
    CHECK(store.save(kBlock, sizeof kBlock));
  }
  const std::string one = folder.read();
  {
    Store store;
    store.use_file(folder.path);
    CHECK(store.save(second, sizeof second));
  }
  const std::string both = folder.read();
  CHECK(one.size() == kFileSize && both.size() == kFileSize);
  uint32_t faults = 0;
  CHECK(folder.load(faults) == 2 && faults == 0);
  const auto damaged = [](std::string file, std::initializer_list<int> slots) {
    for (const int slot : slots) file[kSlotAt[slot] + 2] ^= 0x40;
    return file;
  };
  folder.write(damaged(both, {1}));
  CHECK(folder.load(faults) == 3 && faults == 0);
  folder.write(damaged(both, {0}));
  CHECK(folder.load(faults) == 2 && faults == 0);
  const std::string too_large = std::string(one).replace(kSlotAt[0], 2, "\xff\xff");
  for (const std::string& file : {
           damaged(both, {0, 1}),
           damaged(one, {0}),  // The only slot that was ever saved.
           too_large,
           one.substr(0, 20),
           one.substr(0, 4),
           "x" + both,
       }) {
    folder.write(file);
    CHECK(folder.load(faults) == 0 && faults == wheelwire::fault::kStoreUnreadable);
  }
  Store store;
  store.use_file(folder.path);
  CHECK(store.save(kBlock, sizeof kBlock) && folder.load(faults) == 3 && faults == 0);
}

TEST(a_file_of_an_earlier_release_holds_one_block) {
  const Folder folder;
  folder.write({1, 2, 3});
  uint32_t faults = 0;
  CHECK(folder.load(faults) == 3 && faults == 0);
  Store store;
  store.use_file(folder.path);
  CHECK(store.save(kBlock, 2) && folder.read().size() == kFileSize);
  CHECK(folder.load(faults) == 2 && faults == 0);
}

TEST(erasing_ends_what_made_a_store_unreadable) {
  const Folder folder;
  Store in_file;
  in_file.use_file(folder.path);
  Store in_memory;
  for (Store* const store : {&in_memory, &in_file}) {
    uint8_t out[8] = {};
    CHECK(store->save(kBlock, sizeof kBlock));
    store->unreadable = wheelwire::fault::kStoreNewer;
    CHECK(store->load(out, sizeof out) == 0 && store->faults() == wheelwire::fault::kStoreNewer);
    store->failing = true;
    CHECK(!store->erase() && store->faults() == wheelwire::fault::kStoreNewer);
    store->failing = false;
    CHECK(store->erase() && store->faults() == 0);
    CHECK(store->load(out, sizeof out) == 0 && store->faults() == 0);
  }
}

TEST(store_in_a_file_that_cannot_be_written) {
  Store store;
  store.use_file("/nonexistent/parameters");
  CHECK(!store.save(kBlock, sizeof kBlock));
  uint8_t out[8] = {};
  CHECK(store.load(out, sizeof out) == 0);
}

TEST(stores_in_a_partition_that_cannot_be_opened_are_erased_together) {
  Partition flash;
  Store parameters;
  Store board;
  parameters.lie_in(flash);
  board.lie_in(flash);
  CHECK(board.save(kBlock, sizeof kBlock));
  flash.faults = 256;
  uint8_t out[8] = {};
  CHECK(board.load(out, sizeof out) == 0 && board.faults() == 256);
  CHECK(!parameters.save(kBlock, sizeof kBlock));
  CHECK(parameters.erase());
  CHECK(board.load(out, sizeof out) == 0 && board.faults() == 0);
  CHECK(board.save(kBlock, sizeof kBlock));
}

namespace {

struct Deny final : StoreWatch {
  int asked = 0;
  WriteFate fate_of_write(const Store&) override {
    ++asked;
    return WriteFate::kUntouched;
  }
};

/// The power goes in the middle of a write, and comes back with nothing lost but what was there.
struct Cut final : StoreWatch {
  explicit Cut(int writes) : writes_left(writes) {}
  int writes_left;
  WriteFate fate_of_write(const Store&) override {
    if (writes_left < 0) return WriteFate::kUntouched;
    return writes_left-- > 0 ? WriteFate::kDone : WriteFate::kLost;
  }
};

}  // namespace

TEST(a_watch_may_refuse_each_write) {
  Store store;
  CHECK(store.save(kBlock, sizeof kBlock));
  Deny deny;
  store.watch = &deny;
  CHECK(!store.save(kBlock, 1) && !store.erase());
  CHECK(deny.asked == 2);
  uint8_t out[8] = {};
  CHECK(store.load(out, sizeof out) == 3);
}

TEST(a_cut_in_a_write_leaves_the_block_before_or_after_it) {
  const uint8_t first[] = {1};
  const uint8_t second[] = {2, 2};
  const uint8_t third[] = {3, 3, 3};
  uint8_t out[8] = {};
  for (const int writes : {0, 1, 2}) {
    Store store;
    CHECK(store.save(first, sizeof first) && store.save(second, sizeof second));
    Cut cut{writes};
    store.watch = &cut;
    CHECK(store.erase() == (writes == 2));
    CHECK(store.load(out, sizeof out) == (writes == 0 ? 2u : 0u));
  }
  Store store;
  CHECK(store.save(first, sizeof first) && store.save(second, sizeof second));
  Cut cut{0};
  store.watch = &cut;
  CHECK(!store.save(third, sizeof third));
  CHECK(store.load(out, sizeof out) == sizeof second);
}
