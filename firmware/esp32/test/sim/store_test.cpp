#include "store.hpp"

#include <unistd.h>

#include <cstdlib>
#include <string>

#include "check.hpp"

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

TEST(store_in_a_file) {
  char folder[] = "/tmp/wheelwire-store-XXXXXX";
  CHECK(::mkdtemp(folder) != nullptr);
  const std::string path = std::string(folder) + "/parameters";
  Store store;
  store.use_file(path);
  keeps_what_is_saved(store);
  CHECK(store.save(kBlock, sizeof kBlock));
  Store another;
  another.use_file(path);
  uint8_t out[8] = {};
  CHECK(another.load(out, sizeof out) == 3);
  CHECK(another.erase());
  CHECK(::rmdir(folder) == 0);  // Nothing is left behind.
}

TEST(store_in_a_file_that_cannot_be_written) {
  Store store;
  store.use_file("/nonexistent/parameters");
  CHECK(!store.save(kBlock, sizeof kBlock));
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
