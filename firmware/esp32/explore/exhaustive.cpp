#include "exhaustive.hpp"

#include <limits>

#include "protocol.hpp"

namespace wheelwire::explore {

namespace {

using Operations = std::vector<Operation>;

double id(ParameterId parameter) { return static_cast<double>(parameter); }

// The robot stands still until the firmware starts: short, because each combination begins so.
constexpr double kBootTime = 2e3;
constexpr double kBoot = 12e3;
constexpr double kRestart = 85e3;
constexpr double kLateBoard = 3;  // Any but the image's own.

/// The device with this board, and an open session.
std::vector<Operations> boards() {
  const Operation boot = make("run"_op, {kBoot});
  const Operation open = make("open"_op, {0});
  const Operation restart = make("restart"_op, {0});
  const Operation restarting = make("run"_op, {kRestart});
  return {
      {boot, open},
      {make("wire"_op, {-1, 1, 1}), boot, open},
      {boot, open, make("configure"_op, {0, kLateBoard, 0}), restart, restarting, open},
      {boot, open, make("configure"_op, {0, -1, 2}), restart, restarting, open},
      {make("store_unreadable"_op, {double{fault::kStoreUnreadable}, 1}), boot, open},
      {make("store_unreadable"_op, {double{fault::kStoreUnreadable}, 0}), boot, open},
      {make("store_unreadable"_op, {double{fault::kStoreFull}, 2}), boot, open},
  };
}

std::vector<Operations> trials() {
  return {
      {}, {make("trial"_op, {0, 1, 60})}, {make("trial"_op, {0, 1, 0.2}), make("run"_op, {202e3})}};
}

std::vector<Operations> states() {
  const Operation drive = make("velocity"_op, {0, 0.1, 0.1, 5e6, 1, 0});
  const Operation moment = make("run"_op, {2e3});
  return {
      {},
      {drive, moment},
      {make("velocity"_op, {0, 0.1, 0.1, 20e3, 1, 0}), make("run"_op, {50e3})},
      {make("estop"_op, {0}), moment},
      {drive, moment, make("late"_op, {30e3}), make("run"_op, {40e3})},
      {make("driver_fails"_op, {1}), moment},
      {drive, moment, make("late"_op, {30e3}), make("run"_op, {40e3}), make("estop"_op, {0}),
       moment},
      {make("estop"_op, {0}), moment, make("clear_estop"_op, {0, 1}), moment},
      {make("restart"_op, {0}), make("service"_op)},
      {make("configure"_op, {0, kLateBoard, 0}), moment},
      {make("hello"_op, {0, 1}), moment},
      {make("hello"_op, {1, 1}), moment},
  };
}

/// What else may be so when the message comes: the contact open, seen by the firmware or not; a
/// store that fails.
std::vector<Operations> circumstances() {
  return {{},
          {make("contact"_op, {1})},
          {make("contact"_op, {1}), make("run"_op, {2e3}), make("contact"_op, {0})},
          {make("store_fails"_op, {0, 1}), make("store_fails"_op, {1, 1})}};
}

std::vector<Operation> messages() {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  return {
      make("hello"_op, {0, 1}),
      make("hello"_op, {0, 0}),
      make("hello"_op, {1, 1}),
      make("hello"_op, {0, 1, 1}),
      make("hello"_op, {0, 1, 0, 1}),
      make("ping"_op, {0}),
      make("ping"_op, {0, 2}),
      make("velocity"_op, {0, 0.1, 0.1, 1e6, 1, 0}),
      make("velocity"_op, {0, 0, 0, 1e6, 1, 0}),
      make("velocity"_op, {0, kNan, 0.1, 1e6, 1, 0}),
      make("velocity"_op, {0, 0.1, 0.1, -1, 1, 0}),
      make("velocity"_op, {0, 0.1, 0.1, 1e6, 0, 0}),
      make("velocity"_op, {0, 0.1, 0.1, 1e6, 1, 2}),
      make("duty"_op, {0, 0.3, 0.3, 1e6, 1, 0}),
      make("duty"_op, {0, 0, 0, 1e6, 1, 0}),
      make("stop"_op, {0, 0, 1}),
      make("stop"_op, {0, 1, 1}),
      make("stop"_op, {0, 3, 1}),
      make("stop"_op, {0, 9, 1, 2}),
      make("estop"_op, {0}),
      make("clear_estop"_op, {0, 1}),
      make("clear_estop"_op, {0, 1, 2}),
      make("clear_estop"_op, {0, 0}),
      make("clear_fault"_op, {0, 1}),
      make("stream_rate"_op, {0, 100}),
      make("stream_rate"_op, {0, 60000}),
      make("get"_op, {0, 1}),
      make("get"_op, {0, 0}),
      make("set"_op, {0, id(ParameterId::kWheelRadius), 0.04, 1}),
      make("set"_op, {0, id(ParameterId::kWheelRadius), 0.033f, 1}),
      make("set"_op, {0, id(ParameterId::kWheelRadius), 7, 1}),
      make("set"_op, {0, id(ParameterId::kWheelRadius), kNan, 1}),
      make("set"_op, {0, id(ParameterId::kMaxDuty), 0.5, 1}),
      make("set"_op, {0, id(ParameterId::kControlRateHz), 500.5, 1}),
      make("set"_op, {0, id(ParameterId::kEstopInputEnabled), 0, 1}),
      make("set"_op, {0, id(ParameterId::kStreamRateHz), 5000, 1}),
      make("set"_op, {0, 200, 1, 1}),
      make("save"_op, {0, 0}),
      make("save"_op, {0, 8}),
      make("save"_op, {0, 200}),
      make("reset_parameters"_op, {0}),
      make("list"_op, {0, 0}),
      make("list"_op, {0, 200}),
      make("link_counters"_op, {0}),
      make("control_counters"_op, {0}),
      make("trial"_op, {0, 1, 1}),
      make("trial"_op, {0, 1, kNan}),
      make("trial"_op, {0, 2, 1}),
      make("trial"_op, {0, 2, 99}),
      make("trial"_op, {0, 3}),
      make("trial"_op, {0, 4}),
      make("trial"_op, {0, 0}),
      make("group"_op, {0, 1}),
      make("group"_op, {0, 7}),
      make("contradictions"_op, {0}),
      make("hold_get"_op, {0}),
      make("restart"_op, {0}),
      make("configuration_get"_op, {0}),
      make("configure"_op, {0, kLateBoard, 0}),
      make("configure"_op, {0, kLateBoard, 0, 1}),
      make("confirm"_op, {0, 0}),
      make("confirm"_op, {0, 1}),
      make("box_get"_op, {0, 0}),
      make("box_read"_op, {0, 1, 0}),
      make("ledger"_op, {0}),
      make("unsaved"_op, {0}),
      make("memory"_op, {0}),
      make("sensor_stream"_op, {0, 100}),
      make("peripheral_get"_op, {0, 0}),
      make("configure"_op, {0, -1, 1}),
      make("configure"_op, {0, -1, 1, 4}),
      make("repeat"_op, {0, 0}),
      make("repeat"_op, {0, 1}),
  };
}

/// What follows: a message, read between two steps or in one; and a change of values on trial, that
/// KEEP judges.
std::vector<Operations> endings() {
  const Operation service = make("service"_op);
  const double stream_rate = id(ParameterId::kStreamRateHz);
  std::vector<Operations> all{
      {make("set"_op, {0, stream_rate, 5000, 1}), service, make("trial"_op, {0, 3})}};
  for (const Operation& message : messages())
    for (const Operation& read : {service, make("run"_op, {2e3})}) all.push_back({message, read});
  return all;
}

}  // namespace

std::vector<Scenario> all_combinations() {
  // What a clear, or a refusal, must not have left behind shows in a setpoint after it.
  const Operations after = {make("velocity"_op, {0, 0.1, 0.1, 100e3, 1, 0}), make("run"_op, {3e3})};
  std::vector<Scenario> scenarios;
  for (const Operations& board : boards()) {
    for (const Operations& trial : trials()) {
      for (const Operations& state : states()) {
        for (const Operations& circumstance : circumstances()) {
          for (const Operations& ending : endings()) {
            Scenario scenario{.seed = 1, .operations = {make("boot_time"_op, {kBootTime})}};
            for (const Operations& part : {board, trial, state, circumstance, ending, after})
              scenario.operations.insert(scenario.operations.end(), part.begin(), part.end());
            scenarios.push_back(std::move(scenario));
          }
        }
      }
    }
  }
  return scenarios;
}

}  // namespace wheelwire::explore
