#pragma once

#include "bootloader_random.h"
#include "esp_mac.h"
#include "esp_random.h"
#include "esp_system.h"
#include "image_board.hpp"
#include "message_server.hpp"

namespace wheelwire {

/// With the radio off the generator needs this entropy source.
inline uint32_t draw_boot_id() {
  bootloader_random_enable();
  const uint32_t boot_id = esp_random();
  bootloader_random_disable();
  return boot_id;
}

inline uint64_t read_board_id() {
  uint8_t mac[6] = {};
  esp_read_mac(mac, ESP_MAC_EFUSE_FACTORY);
  uint64_t id = 0;
  for (const uint8_t byte : mac) id = id << 8 | byte;
  return id;
}

inline ResetReason reset_reason() {
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

/// What DeviceHello reports, but for the capabilities. Draws a new boot id: call once.
inline Identity make_identity() {
  return {
      .boot_id = draw_boot_id(),
      .reset_reason = reset_reason(),
      .board = kImageBoard.chip,
      .board_id = read_board_id(),
      .capabilities = 0,
      .version_major = WHEELWIRE_VERSION_MAJOR,
      .version_minor = WHEELWIRE_VERSION_MINOR,
      .version_patch = WHEELWIRE_VERSION_PATCH,
      .git_hash = WHEELWIRE_GIT_HASH,
  };
}

}  // namespace wheelwire
