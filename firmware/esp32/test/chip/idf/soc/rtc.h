// Stand-in for ESP-IDF's header of this name.
#pragma once

#define RTC_CLK_CAL_FRACT 19
