#include "store.hpp"

#include <unistd.h>

#include <cstdlib>
#include <string>

#include "check.hpp"

using wheelwire::sim::Partition;
using wheelwire::sim::Store;
using wheelwire::sim::StoreWatch;

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
  bool allow_write(const Store&) override {
    ++asked;
    return false;
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
