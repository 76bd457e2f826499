// Firmware that was installed over the link, on trial: image_trial.hpp says when it is kept.
#pragma once

#include "robot.hpp"

namespace wheelwire {

class OtaTrial {
 public:
  void start();
  /// After each control step, from the control task: nothing can drive while flash is written.
  void step(const Robot& robot, uint64_t now_us);

 private:
  bool on_trial_ = false;  ///< Never for firmware that was flashed by cable.
};

}  // namespace wheelwire
