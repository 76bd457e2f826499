// The whole device in virtual time: the firmware's core on the simulated board.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "board.hpp"
#include "box_image.hpp"
#include "configuration.hpp"
#include "device.hpp"
#include "random.hpp"
#include "sensor_server.hpp"

namespace wheelwire::sim {

/// What tests measure. Times are on the device's clock, since its last reset [us].
struct Record {
  bool drive_on = false;          ///< A bridge has EN high and its inputs unequal.
  uint64_t drive_changes = 0;     ///< Since the simulator was created.
  uint64_t drive_removed_us = 0;  ///< When drive_on last ended.
  uint64_t deadline_us = 0;       ///< Deadline of the last setpoint that had one.
  bool stands_still = true;       ///< Both wheels.
  uint64_t standstill_us = 0;     ///< When they last stopped, to within a control period.
};

class Simulator {
 public:
  /// Powers the device on at time 0. The same seed and the same calls give the same run.
  explicit Simulator(uint64_t seed);

  /// Runs the device and the world for `duration`.
  void advance(Nanoseconds duration);
  /// The next event without the host: a control step, or the arrival of the last byte on a wire.
  Nanoseconds next_event() const;
  /// Lets the firmware read and answer what has arrived, as its UART event does between steps.
  void service_link();
  /// Resets the device: a new boot id, and outputs off for boot_time_us.
  void reset(ResetReason reason);

  /// Changes the default of a parameter from the next reset on; false if the value is not allowed.
  bool preset(int parameter, float value);
  /// Delays the next control step by this much.
  void delay_control(uint64_t us) { next_step_us_ += us; }
  /// A motor or encoder peripheral does not start. After a repair it starts at the next reset.
  void set_driver_failed(bool failed);
  bool driver_failed() const { return driver_failed_; }
  /// Whether flash holds a core dump. As on the chip, the firmware checks when it starts.
  void set_core_dump(bool present);
  bool core_dump() const { return (identity_.capabilities & capability::kCoreDump) != 0; }

  /// Takes effect at the next reset. Before, the id is drawn from the seed.
  void set_board_id(uint64_t board_id) { identity_.board_id = board_id; }

  /// Active value; the parameter must exist. 0 while the chip boots.
  float parameter(ParameterId id) const { return device_ ? device_->parameter(id) : 0.0f; }
  /// The velocity that the wheel is driven at now, by its slew limit; 0 if it follows none.
  int32_t commanded_umps(Side side) const {
    if (!device_) return 0;
    return side == kLeft ? device_->commanded().left : device_->commanded().right;
  }
  /// Since the simulator was created.
  uint64_t control_steps() const { return control_steps_; }

  /// The newest black box: one that a fault or an e-stop ended, in memory or in flash. If there is
  /// none, the last second or two.
  std::vector<uint32_t> box_image();

  /// DAMAGED while the chip boots.
  ConfigurationState configuration_state() const {
    return configuration_ ? configuration_->state() : ConfigurationState::kDamaged;
  }
  uint32_t configuration_fingerprint() const {
    return configuration_ ? configuration_->fingerprint() : 0;
  }

  ResetReason reset_reason() const { return identity_.reset_reason; }
  uint32_t boot_id() const { return identity_.boot_id; }
  SupervisorState state() const { return device_ ? device_->state() : SupervisorState::kBoot; }
  uint32_t faults() const { return device_ ? device_->faults() : 0; }
  const Record& record() const { return record_; }

  SimulatedBoard board;
  uint64_t boot_time_us = 50'000;  ///< From reset to the first control step.
  bool boot_text = false;          ///< The ROM prints at each reset.
  /// A fresh chip: on the image's unconfirmed board. From the next reset on.
  bool board_unwritten = false;

 private:
  /// The next control step, or the end of the boot.
  Nanoseconds next_step() const;
  /// False if a brownout has reset the device before `end`.
  bool run_until(Nanoseconds end);
  void brown_out();
  void boot();
  void control_step();
  void observe();

  Random random_;
  Identity identity_;
  ParameterSpec specs_[kParameterCount];
  ParameterSpec boot_specs_[kParameterCount];         // With the defaults that the board gives.
  std::optional<ActiveConfiguration> configuration_;  // None while the chip boots, as the device.
  std::optional<SensorServer> sensors_;
  RecorderMemory recorder_memory_{};
  std::optional<RecorderKeeper> recorder_;
  std::optional<Device> device_;
  uint64_t next_step_us_ = 0;
  uint64_t control_steps_ = 0;
  bool driver_failed_ = false;
  Record record_;
};

}  // namespace wheelwire::sim
