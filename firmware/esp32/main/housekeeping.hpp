// Work that can wait: the status LED, the battery and analogue inputs, the free memory. Lowest
// priority, under the task watchdog, so that a core on which no task runs any more is noticed, too.
#pragma once

#include "adc.hpp"
#include "message_server.hpp"
#include "shared_state.hpp"

namespace wheelwire {

class Housekeeping final : public PlatformMessages {
 public:
  Housekeeping(Battery& battery, AnalogInputs& analog, SharedState& state)
      : battery_(battery), analog_(analog), state_(state) {}

  /// Creates the task, which alone uses the ADC from here on.
  void start(bool has_battery, int led_pin);

  /// Called by the control task: answers with what was measured last.
  void serve(MessageServer& server, const Frame& frame, uint16_t request_id) override;

 private:
  [[noreturn]] static void run(void* self);
  void run_once();

  Battery& battery_;
  AnalogInputs& analog_;
  SharedState& state_;
  bool has_battery_ = false;
  int led_pin_ = -1;
  uint32_t cycles_ = 0;
};

}  // namespace wheelwire
