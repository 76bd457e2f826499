// Stand-in for ESP-IDF's header of this name.
#pragma once

#include "driver/uart.h"

#define UART_LL_GET_HW(port) (&fake_uart)

inline uint32_t uart_ll_get_intr_ena_status(const FakeUart* uart) { return uart->enabled; }
