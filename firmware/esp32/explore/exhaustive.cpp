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

/// Each message with the values of each of its variants.
std::vector<Operation> messages() {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  using enum ParameterId;
  const struct {
    Kind kind;
    std::vector<decltype(Operation::values)> variants;
  } all[] = {
      {"hello"_op, {{0, 1}, {0, 0}, {1, 1}, {0, 1, 1}, {0, 1, 0, 1}}},
      {"ping"_op, {{0}, {0, 2}}},
      {"velocity"_op,
       {{0, 0.1, 0.1, 1e6, 1, 0},
        {0, 0, 0, 1e6, 1, 0},
        {0, kNan, 0.1, 1e6, 1, 0},
        {0, 0.1, 0.1, -1, 1, 0},
        {0, 0.1, 0.1, 1e6, 0, 0},
        {0, 0.1, 0.1, 1e6, 1, 2}}},
      {"duty"_op, {{0, 0.3, 0.3, 1e6, 1, 0}, {0, 0, 0, 1e6, 1, 0}}},
      {"stop"_op, {{0, 0, 1}, {0, 1, 1}, {0, 3, 1}, {0, 9, 1, 2}}},
      {"estop"_op, {{0}}},
      {"clear_estop"_op, {{0, 1}, {0, 1, 2}, {0, 0}}},
      {"clear_fault"_op, {{0, 1}}},
      {"stream_rate"_op, {{0, 100}, {0, 60000}}},
      {"get"_op, {{0, 1}, {0, 0}}},
      {"set"_op,
       {{0, id(kWheelRadius), 0.04, 1},
        {0, id(kWheelRadius), 0.033f, 1},
        {0, id(kWheelRadius), 7, 1},
        {0, id(kWheelRadius), kNan, 1},
        {0, id(kMaxDuty), 0.5, 1},
        {0, id(kControlRateHz), 500.5, 1},
        {0, id(kEstopInputEnabled), 0, 1},
        {0, id(kStreamRateHz), 5000, 1},
        {0, 200, 1, 1}}},
      {"save"_op, {{0, 0}, {0, 8}, {0, 200}}},
      {"reset_parameters"_op, {{0}}},
      {"list"_op, {{0, 0}, {0, 200}}},
      {"link_counters"_op, {{0}}},
      {"control_counters"_op, {{0}}},
      {"trial"_op, {{0, 1, 1}, {0, 1, kNan}, {0, 2, 1}, {0, 2, 99}, {0, 3}, {0, 4}, {0, 0}}},
      {"group"_op, {{0, 1}, {0, 7}}},
      {"contradictions"_op, {{0}}},
      {"hold_get"_op, {{0}}},
      {"restart"_op, {{0}}},
      {"configuration_get"_op, {{0}}},
      {"configure"_op, {{0, kLateBoard, 0}, {0, kLateBoard, 0, 1}}},
      {"confirm"_op, {{0, 0}, {0, 1}}},
      {"box_get"_op, {{0, 0}}},
      {"box_read"_op, {{0, 1, 0}}},
      {"ledger"_op, {{0}}},
      {"unsaved"_op, {{0}}},
      {"memory"_op, {{0}}},
      {"sensor_stream"_op, {{0, 100}}},
      {"peripheral_get"_op, {{0, 0}}},
      {"configure"_op, {{0, -1, 1}, {0, -1, 1, 4}}},
      {"repeat"_op, {{0, 0}, {0, 1}}},
  };
  std::vector<Operation> messages;
  for (const auto& [kind, variants] : all)
    for (const auto& values : variants) messages.push_back({kind, values});
  return messages;
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
