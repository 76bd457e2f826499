#include "store.hpp"

#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <string>

#include "check.hpp"
#include "file.hpp"
#include "protocol.hpp"

using namespace wheelwire::sim;

namespace {

constexpr uint8_t kBlock[] = {1, 2, 3};

/// The size of what it holds.
size_t loaded(Store& store) {
  uint8_t out[8] = {};
  return store.load(out, sizeof out);
}

void keeps_what_is_saved(Store& store) {
  uint8_t out[8] = {};
  CHECK(store.load(out, sizeof out) == 0);
  CHECK(store.save(kBlock, sizeof kBlock));
  CHECK(store.load(out, sizeof out) == 3 && out[0] == 1 && out[2] == 3);
  CHECK(store.load(out, 1) == 3);
  store.failing = true;
  CHECK(!store.save(kBlock, 1));
  CHECK(store.load(out, sizeof out) == 3);
  store.failing = false;
  CHECK(store.format() && store.load(out, sizeof out) == 3);  // It can be opened.
}

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
    store.keep_in(std::make_unique<File>(path));
    const size_t size = loaded(store);
    faults = store.faults();
    return size;
  }
};

// By hand: a header of 4 bytes, then each slot with its size of 2 bytes, in 1024 bytes.
constexpr size_t kSlotAt[] = {4, 4 + 1024};
constexpr size_t kFileSize = 4 + 2 * 1024;

}  // namespace

TEST(store_in_memory) {
  Store store;
  keeps_what_is_saved(store);
}

TEST(store_in_a_file) {
  const Folder folder;
  const std::string path = folder.path;
  Store store;
  store.keep_in(std::make_unique<File>(path));
  keeps_what_is_saved(store);
  CHECK(store.save(kBlock, sizeof kBlock));
  Store another;
  another.keep_in(std::make_unique<File>(path));
  CHECK(loaded(another) == 3);
  another.damage(Damage::kBoth);
  CHECK(::access(path.c_str(), F_OK) != 0);
}

TEST(a_file_has_two_slots_that_hold_the_same) {
  const Folder folder;
  {
    Store store;
    store.keep_in(std::make_unique<File>(folder.path));
    CHECK(store.save(kBlock, sizeof kBlock));
  }
  const std::string whole = folder.read();
  CHECK(whole.size() == kFileSize);
  uint32_t faults = 0;
  CHECK(folder.load(faults) == 3 && faults == 0);
  const auto damaged = [](std::string file, std::initializer_list<int> slots) {
    for (const int slot : slots) file[kSlotAt[slot] + 2] ^= 0x40;
    return file;
  };
  for (const int slot : {0, 1}) {
    folder.write(damaged(whole, {slot}));
    CHECK(folder.load(faults) == 3 && faults == 0);
    Store store;
    store.keep_in(std::make_unique<File>(folder.path));
    CHECK(loaded(store) == 3 && store.has_lost_copy() && store.is_incomplete());
    CHECK(store.repair() && folder.read() == whole);
  }
  const std::string too_large = std::string(whole).replace(kSlotAt[0], 2, "\xff\xff");
  for (const std::string& file : {
           damaged(whole, {0, 1}),
           damaged(too_large, {1}),
           whole.substr(0, 20),
           whole.substr(0, 4),
           "x" + whole,
       }) {
    folder.write(file);
    CHECK(folder.load(faults) == 0 && faults == wheelwire::fault::kStoreUnreadable);
  }
  Store store;
  store.keep_in(std::make_unique<File>(folder.path));
  CHECK(store.save(kBlock, sizeof kBlock) && folder.load(faults) == 3 && faults == 0);
}

TEST(a_save_ends_what_made_a_store_unreadable) {
  const Folder folder;
  Store in_file;
  in_file.keep_in(std::make_unique<File>(folder.path));
  Store in_memory;
  for (Store* const store : {&in_memory, &in_file}) {
    CHECK(store->save(kBlock, sizeof kBlock));
    store->unreadable = wheelwire::fault::kStoreNewer;
    CHECK(loaded(*store) == 0 && store->faults() == wheelwire::fault::kStoreNewer);
    store->failing = true;
    CHECK(!store->save(kBlock, 1) && store->faults() == wheelwire::fault::kStoreNewer);
    store->failing = false;
    CHECK(store->save(kBlock, 1) && store->faults() == 0);
    CHECK(loaded(*store) == 1 && store->faults() == 0);
  }
}

TEST(store_in_a_file_that_cannot_be_written) {
  Store store;
  store.keep_in(std::make_unique<File>("/nonexistent/parameters"));
  CHECK(!store.save(kBlock, sizeof kBlock));
  CHECK(loaded(store) == 0);
}

TEST(stores_in_a_partition_that_cannot_be_opened_are_formatted_together) {
  Partition flash;
  Store parameters;
  Store board;
  parameters.lie_in(flash);
  board.lie_in(flash);
  CHECK(board.save(kBlock, sizeof kBlock));
  flash.faults = 256;
  CHECK(loaded(board) == 0 && board.faults() == 256);
  CHECK(!parameters.save(kBlock, sizeof kBlock));
  CHECK(parameters.format());
  CHECK(loaded(board) == 0 && board.faults() == 0);
  CHECK(board.save(kBlock, sizeof kBlock));
}
