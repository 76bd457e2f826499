#include "nvs_store.hpp"

#include "check.hpp"
#include "nvs_flash.h"
#include "protocol.hpp"

using namespace wheelwire;

namespace {

const std::vector<uint8_t> kSaved{1, 2, 3};

NvsStore started_store(const char* key = "parameters") {
  NvsStore store{key};
  store.start();
  return store;
}

/// The size of what it holds, at most 8 bytes.
size_t loaded(NvsStore& store) {
  uint8_t block[8];
  return store.load(block, sizeof block);
}

uint32_t fault_at_start(esp_err_t found) {
  fake_nvs = {.init_result = found, .read_result = ESP_OK, .blob = kSaved};
  return started_store().faults();
}

}  // namespace

TEST(a_saved_block_is_read_back) {
  fake_nvs = {};
  NvsStore store = started_store();
  CHECK(loaded(store) == 0);
  CHECK(store.save(kSaved.data(), kSaved.size()));
  uint8_t block[8];
  CHECK(store.load(block, sizeof block) == 3 && block[2] == 3);
  CHECK(store.faults() == 0);
  CHECK(store.format() && loaded(store) == 3);  // It can be opened.
  CHECK(fake_nvs.erasures == 0);
}

TEST(storage_that_cannot_be_opened_is_told_apart_left_alone_and_not_written) {
  CHECK(fault_at_start(ESP_OK) == 0);
  CHECK(fault_at_start(ESP_ERR_NVS_NO_FREE_PAGES) == fault::kStoreFull);
  CHECK(fault_at_start(ESP_ERR_NVS_NEW_VERSION_FOUND) == fault::kStoreNewer);
  CHECK(fault_at_start(ESP_ERR_NVS_PART_NOT_FOUND) == fault::kStoreUnreadable);
  CHECK(fault_at_start(ESP_FAIL) == fault::kStoreUnreadable);
  NvsStore store = started_store();
  CHECK(loaded(store) == 0);
  CHECK(!store.save(kSaved.data(), 1));
  CHECK(fake_nvs.erasures == 0 && fake_nvs.blob == kSaved);
}

TEST(a_block_that_cannot_be_read_is_a_fault) {
  fake_nvs = {.init_result = ESP_OK, .read_result = ESP_FAIL, .blob = kSaved};
  NvsStore store = started_store();
  CHECK(loaded(store) == 0);
  CHECK(store.faults() == fault::kStoreUnreadable);
  CHECK(store.format() && fake_nvs.erasures == 0);  // The other blocks are left alone.
}

TEST(one_format_is_enough_for_two_blocks) {
  fake_nvs = {.init_result = ESP_ERR_NVS_NEW_VERSION_FOUND, .read_result = ESP_OK, .blob = kSaved};
  NvsStore first = started_store("parameters.0"), second = started_store("latch.0");
  CHECK(!second.save(kSaved.data(), kSaved.size()));
  CHECK(first.format());
  CHECK(second.save(kSaved.data(), kSaved.size()) && fake_nvs.blob == kSaved);
  CHECK(second.format());
  CHECK(fake_nvs.erasures == 1 && first.faults() == 0 && second.faults() == 0);
}

TEST(a_block_that_is_too_long_is_the_cores_to_judge) {
  fake_nvs = {.init_result = ESP_OK, .read_result = ESP_OK, .blob = std::vector<uint8_t>(9)};
  NvsStore store = started_store();
  CHECK(loaded(store) == 9);
  CHECK(store.faults() == 0);
}
