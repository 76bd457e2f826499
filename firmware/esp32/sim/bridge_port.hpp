// The pins of a simulated bridge, as the core sets them.
#pragma once

#include <algorithm>

#include "bridge.hpp"
#include "hal.hpp"

namespace wheelwire::sim {

class Bridge final : public BridgePort {
 public:
  void set_inputs(bool in1, bool in2) override {
    pins_.in1 = in1;
    pins_.in2 = in2;
  }
  void set_enable(uint16_t duty_q15) override {
    pins_.enable = std::min(1.0, duty_q15 / static_cast<double>(INT16_MAX));
  }
  const BridgePins& pins() const { return pins_; }

 private:
  BridgePins pins_;
};

}  // namespace wheelwire::sim
