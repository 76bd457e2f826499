// What may wait: the status LED and the battery. The lowest priority, under the task watchdog, so
// that a core on which nothing runs any more is noticed too.
#pragma once

#include "battery.hpp"
#include "board_state.hpp"

namespace wheelwire {

class Housekeeping {
 public:
  Housekeeping(Battery& battery, BoardState& state) : battery_(battery), state_(state) {}

  /// Creates the task, to which the battery belongs from here on.
  void start(bool has_battery);

 private:
  [[noreturn]] static void run(void* self);
  void turn();

  Battery& battery_;
  BoardState& state_;
  bool has_battery_ = false;
  uint32_t turn_ = 0;
};

}  // namespace wheelwire
