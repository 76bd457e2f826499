// Stand-in for ESP-IDF's header of this name.
#pragma once

#include "driver/uart.h"

enum uart_select_notif_t { UART_SELECT_READ_NOTIF };

inline void uart_set_select_notif_callback(uart_port_t, void (*)(uart_port_t, uart_select_notif_t,
                                                                 BaseType_t*)) {}
