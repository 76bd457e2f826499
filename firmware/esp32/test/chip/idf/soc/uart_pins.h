// Stand-in for ESP-IDF's header of this name.
#pragma once

constexpr int U0TXD_GPIO_NUM = 1;
constexpr int U0RXD_GPIO_NUM = 3;
