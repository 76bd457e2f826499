// Both quadrature encoders in the pulse counter (PCNT), x4, without an interrupt.
#pragma once

#include "board_rules.hpp"
#include "driver/pulse_cnt.h"
#include "hal.hpp"

namespace wheelwire {

class Encoders final : public EncoderPort {
 public:
  /// Pulses shorter than `glitch_ns` are ignored; 0 ignores none.
  bool start(const BoardDescription& board, uint32_t glitch_ns);

  EncoderCounts latch() override;

 private:
  pcnt_unit_handle_t left_ = nullptr;
  pcnt_unit_handle_t right_ = nullptr;
};

}  // namespace wheelwire
