#include "partition_flash.hpp"

#include "check.hpp"
#include "esp_task_wdt.h"
#include "recorder_keeper.hpp"
#include "task_watchdog.hpp"

using namespace wheelwire;

namespace {

constexpr uint32_t kSize = RecorderKeeper::kFlashSize;

bool starts(const FakePartition& partition) {
  fake_partition = partition;
  return PartitionFlash{}.start(kSize);
}

}  // namespace

TEST(only_a_partition_that_has_room_and_can_be_written_is_used) {
  CHECK(starts(blank_partition("recorder", kSize)));
  CHECK(!starts({}));
  FakePartition other = blank_partition("recorder", kSize);
  other.label = "coredump";
  CHECK(!starts(other));
  CHECK(!starts(blank_partition("recorder", kSize - kFlashSector)));
  FakePartition readonly = blank_partition("recorder", kSize);
  readonly.entry.readonly = true;
  CHECK(!starts(readonly));
  FakePartition coarse = blank_partition("recorder", kSize);
  coarse.entry.erase_size = 65536;
  CHECK(!starts(coarse));
}

TEST(what_was_written_is_read_back_until_its_sector_is_erased_and_what_fails_is_reported) {
  CHECK(starts(blank_partition("recorder", kSize)));
  PartitionFlash flash;
  CHECK(flash.start(kSize));
  const uint8_t data[] = {1, 2, 3};
  uint8_t found[3] = {};
  CHECK(flash.write(kSize - 3, data, sizeof data) && flash.write(0, data, sizeof data));
  CHECK(flash.erase(0));
  CHECK(flash.read(kSize - 3, found, sizeof found) && found[0] == 1 && found[2] == 3);
  CHECK(flash.read(0, found, sizeof found) && found[0] == 0xff);
  CHECK(fake_partition.erasures == 1);
  uint8_t byte = 0;
  CHECK(!flash.read(kSize, &byte, 1) && !flash.write(kSize, &byte, 1) && !flash.erase(kSize));
  fake_partition.result = ESP_FAIL;
  CHECK(!flash.read(0, &byte, 1) && !flash.write(0, &byte, 1) && !flash.erase(0));
}

TEST(the_task_watchdog_waits_for_each_operation) {
  fake_partition = blank_partition("recorder", kSize);
  PartitionFlash flash;
  CHECK(flash.start(kSize) && start_task_watchdog());
  const uint32_t usual_ms = fake_task_watchdog.timeout_ms;
  int waited = 0;
  fake_partition.on_call = [&](bool) { waited += fake_task_watchdog.timeout_ms > 400 ? 1 : 0; };
  uint8_t byte = 0;
  CHECK(flash.read(0, &byte, 1) && flash.write(0, &byte, 1) && flash.erase(0));
  CHECK(waited == 3 && fake_task_watchdog.timeout_ms == usual_ms);
  fake_partition = {};
}
