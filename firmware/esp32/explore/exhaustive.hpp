// The small spaces, visited as a whole: states x messages x contact x board x trial x store.
#pragma once

#include "operation.hpp"

namespace wheelwire::explore {

using Operations = std::vector<Operation>;

// The robot stands still until the firmware starts: short, because each combination begins so.
constexpr double kBootTime = 2e3;
constexpr double kBoot = 12e3;
constexpr double kRestart = 85e3;

/// The device with this board, and an open session.
inline std::vector<Operations> boards() {
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

inline std::vector<Operations> trials() {
  return {
      {}, {make("trial"_op, {0, 1, 60})}, {make("trial"_op, {0, 1, 0.2}), make("run"_op, {202e3})}};
}

inline std::vector<Operations> states() {
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
inline std::vector<Operations> circumstances() {
  return {{},
          {make("contact"_op, {1})},
          {make("contact"_op, {1}), make("run"_op, {2e3}), make("contact"_op, {0})},
          {make("store_fails"_op, {0, 1}), make("store_fails"_op, {1, 1})}};
}

/// What follows: a message, read between two steps or in one; and a change of values on trial, that
/// KEEP judges.
inline std::vector<Operations> endings() {
  const Operation service = make("service"_op);
  std::vector<Operations> all{
      {make("set"_op, {0, code_of(kStreamRateHz), 5000, 1}), service, make("trial"_op, {0, 3})}};
  for (Kind kind = 0; kind < std::size(kKinds); ++kind)
    for (const Arguments& values : kKinds[kind].variants)
      for (const Operation& read : {service, make("run"_op, {2e3})})
        all.push_back({{.kind = kind, .values = values}, read});
  return all;
}

/// What a short scenario does, for each combination that can be reached.
inline std::vector<Operations> all_combinations() {
  // What a clear, or a refusal, must not have left behind shows in a setpoint after it.
  const Operations after = {make("velocity"_op, {0, 0.1, 0.1, 100e3, 1, 0}), make("run"_op, {3e3})};
  std::vector<Operations> all{{make("boot_time"_op, {kBootTime})}};
  for (const std::vector<Operations>& choices :
       {boards(), trials(), states(), circumstances(), endings(), {after}}) {
    std::vector<Operations> longer;
    for (const Operations& begun : all) {
      for (const Operations& choice : choices) {
        Operations& operations = longer.emplace_back(begun);
        operations.insert(operations.end(), choice.begin(), choice.end());
      }
    }
    all = std::move(longer);
  }
  return all;
}

}  // namespace wheelwire::explore
