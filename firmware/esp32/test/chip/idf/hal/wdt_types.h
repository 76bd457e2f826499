// Stand-in for ESP-IDF's header of this name.
#pragma once

enum wdt_stage_t { WDT_STAGE0, WDT_STAGE1, WDT_STAGE2, WDT_STAGE3 };
enum wdt_stage_action_t {
  WDT_STAGE_ACTION_OFF,
  WDT_STAGE_ACTION_INT,
  WDT_STAGE_ACTION_RESET_CPU,
  WDT_STAGE_ACTION_RESET_SYSTEM,
  WDT_STAGE_ACTION_RESET_RTC,
};
