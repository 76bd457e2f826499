// The pulses at an input, timed by the chip's capture unit: two channels at one pin, one for each
// edge, so that a pulse may be shorter than the interrupt takes.
#pragma once

#include <stdint.h>

#include "echo_pin.hpp"
#include "freertos/FreeRTOS.h"

namespace wheelwire {

/// In ticks of the capture unit; 0: there was none.
struct Pulses {
  uint32_t rises = 0;
  uint32_t falls = 0;
  uint32_t least_period = 0;
  uint32_t most_period = 0;
  uint32_t least_high = 0;
  uint32_t most_high = 0;
  uint32_t most_high_other = 0;  ///< As `most_high`, while the other pin was low.
};

class PulseWatch {
 public:
  /// On the calling core, whose interrupts then time the edges. `pulled_up`: as the pin was.
  bool start(int edge_pin, int level_pin, bool pulled_up);
  bool is_started() const { return resolution_hz_ != 0; }

  uint32_t resolution_hz() const { return resolution_hz_; }
  /// Of the time since the last call.
  Pulses take();
  /// When the last pulse ended, device clock; 0: none yet. Kept through a reset until start().
  static uint64_t last_fall_us();

 private:
  static bool on_rise(mcpwm_cap_channel_handle_t, const mcpwm_capture_event_data_t* edge,
                      void* self);
  static bool on_fall(mcpwm_cap_channel_handle_t, const mcpwm_capture_event_data_t* edge,
                      void* self);
  bool add_channel(const CaptureTimer& timer, bool rises, bool pulled_up);
  static bool is_high(int pin);
  void note_high();

  int edge_pin_ = -1;
  int level_pin_ = -1;
  uint32_t resolution_hz_ = 0;
  portMUX_TYPE lock_ = portMUX_INITIALIZER_UNLOCKED;
  Pulses pulses_;
  uint32_t rise_ticks_ = 0;
  uint32_t fall_ticks_ = 0;
  bool has_rise_ = false;     ///< Since the last take().
  bool awaits_fall_ = false;  ///< Of the last rise.
  bool has_fall_ = false;     ///< One whose rise was not reported yet.
  bool is_other_ = false;     ///< The other pin was low at the last rise.
};

}  // namespace wheelwire
