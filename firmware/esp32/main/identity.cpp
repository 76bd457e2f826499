#include "identity.hpp"

#include "bootloader_random.h"
#include "esp_mac.h"
#include "esp_random.h"
#include "esp_system.h"
#include "sdkconfig.h"

namespace wheelwire {
namespace {

#if CONFIG_IDF_TARGET_ESP32
constexpr Chip kBoard = Chip::kEsp32;
#elif CONFIG_IDF_TARGET_ESP32S3
constexpr Chip kBoard = Chip::kEsp32s3;
#elif CONFIG_IDF_TARGET_ESP32C6
constexpr Chip kBoard = Chip::kEsp32c6;
#endif

/// With the radio off the generator needs this entropy source.
uint32_t draw_boot_id() {
  bootloader_random_enable();
  const uint32_t boot_id = esp_random();
  bootloader_random_disable();
  return boot_id;
}

uint64_t read_board_id() {
  uint8_t mac[6] = {};
  esp_read_mac(mac, ESP_MAC_EFUSE_FACTORY);
  uint64_t id = 0;
  for (const uint8_t byte : mac) id = id << 8 | byte;
  return id;
}

ResetReason reset_reason() {
  switch (esp_reset_reason()) {
    case ESP_RST_POWERON:
      return ResetReason::kPowerOn;
    case ESP_RST_EXT:
    case ESP_RST_USB:
    case ESP_RST_JTAG:
      return ResetReason::kExternal;
    case ESP_RST_SW:
      return ResetReason::kSoftware;
    case ESP_RST_PANIC:
    case ESP_RST_CPU_LOCKUP:
      return ResetReason::kPanic;
    case ESP_RST_TASK_WDT:
      return ResetReason::kTaskWatchdog;
    case ESP_RST_INT_WDT:
    case ESP_RST_WDT:  // A watchdog whose own interrupt was not served.
      return ResetReason::kInterruptWatchdog;
    case ESP_RST_BROWNOUT:
    case ESP_RST_PWR_GLITCH:
      return ResetReason::kBrownout;
    default:
      return ResetReason::kUnknown;
  }
}

}  // namespace

Identity make_identity(uint32_t capabilities) {
  return {
      .boot_id = draw_boot_id(),
      .reset_reason = reset_reason(),
      .board = kBoard,
      .board_id = read_board_id(),
      .capabilities = capabilities,
      .version_major = WHEELWIRE_VERSION_MAJOR,
      .version_minor = WHEELWIRE_VERSION_MINOR,
      .version_patch = WHEELWIRE_VERSION_PATCH,
      .git_hash = WHEELWIRE_GIT_HASH,
  };
}

}  // namespace wheelwire
