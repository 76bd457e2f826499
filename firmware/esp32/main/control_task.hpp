// The task that runs the robot: control steps on a timer, the link as bytes arrive.
#pragma once

#include "dead_man.hpp"
#include "device.hpp"
#include "esp_timer.h"
#include "line.hpp"
#include "ota_trial.hpp"
#include "recorder_keeper.hpp"
#include "shared_state.hpp"

namespace wheelwire {

class ControlTask {
 public:
  /// `recorder`: nullptr where the flash has no partition for one.
  ControlTask(Device& device, Line& line, DeadMan& dead_man, SharedState& state,
              RecorderKeeper* recorder)
      : device_(device), line_(line), dead_man_(dead_man), state_(state), recorder_(recorder) {}

  /// Creates the task. From here on it owns device, line, recorder and every port that the device
  /// uses.
  void start();

 private:
  static void run(void* self);
  static void on_timer(void* task);

  bool prepare();
  bool start_robot();
  void start_recorder();
  void serve();
  TickType_t until_late_step() const;
  void step();
  bool follow_period();
  void watch_drive();

  Device& device_;
  Line& line_;
  DeadMan& dead_man_;
  SharedState& state_;
  RecorderKeeper* recorder_;
  OtaTrial trial_;
  esp_timer_handle_t timer_ = nullptr;
  uint32_t period_us_ = 0;
  uint64_t stepped_us_ = 0;  ///< When the last step began.
  bool drove_ = false;
};

}  // namespace wheelwire
