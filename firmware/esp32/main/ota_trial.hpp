// Firmware that was installed over the link, on trial: image_trial.hpp says when it has passed.
#pragma once

#include "device.hpp"

namespace wheelwire {

class OtaTrial {
 public:
  void start();
  /// Call after each control step, from the control task: nothing can drive while it writes flash,
  /// which it does at rest only.
  void step(const Device& device, uint64_t now_us);

 private:
  bool on_trial_ = false;  ///< Never for firmware that was flashed by cable.
};

}  // namespace wheelwire
