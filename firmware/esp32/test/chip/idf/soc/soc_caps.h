// Stand-in for ESP-IDF's header of this name, of an ESP32.
#pragma once

#define SOC_MCPWM_GROUPS 2
