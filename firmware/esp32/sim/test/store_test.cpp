#include "store.hpp"

#include <unistd.h>

#include <cstdlib>
#include <string>

#include "check.hpp"

using wheelwire::sim::Store;

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
