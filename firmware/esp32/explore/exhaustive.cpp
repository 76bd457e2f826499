#include "exhaustive.hpp"

#include <limits>

#include "protocol.hpp"

namespace wheelwire::explore {

namespace {

using Operations = std::vector<Operation>;

Operation make(Kind kind, std::initializer_list<double> values = {}) {
  Operation operation{.kind = kind};
  size_t i = 0;
  for (const double value : values) operation.values[i++] = value;
  return operation;
}

double id(ParameterId parameter) { return static_cast<double>(parameter); }

// The robot stands still until the firmware starts: short, because each combination begins so.
constexpr double kBootTime = 2e3;
constexpr double kBoot = 12e3;
constexpr double kRestart = 85e3;
constexpr double kLateBoard = 3;  // Any but the image's own.

/// The device with this board, and an open session.
std::vector<Operations> boards() {
  const Operation boot = make(Kind::kRun, {kBoot});
  const Operation open = make(Kind::kOpen, {0});
  const Operation restart = make(Kind::kRestart, {0});
  const Operation restarting = make(Kind::kRun, {kRestart});
  return {
      {boot, open},
      {make(Kind::kWire, {-1, 1, 1}), boot, open},
      {boot, open, make(Kind::kConfigure, {0, kLateBoard, 0}), restart, restarting, open},
      {boot, open, make(Kind::kConfigure, {0, -1, 2}), restart, restarting, open},
      {make(Kind::kStoreUnreadable, {double{fault::kStoreUnreadable}, 1}), boot, open},
      {make(Kind::kStoreUnreadable, {double{fault::kStoreUnreadable}, 0}), boot, open},
      {make(Kind::kStoreUnreadable, {double{fault::kStoreFull}, 2}), boot, open},
  };
}

std::vector<Operations> trials() {
  return {{},
          {make(Kind::kTrial, {0, 1, 60})},
          {make(Kind::kTrial, {0, 1, 0.2}), make(Kind::kRun, {202e3})}};
}

std::vector<Operations> states() {
  const Operation drive = make(Kind::kVelocity, {0, 0.1, 0.1, 5e6, 1, 0});
  const Operation moment = make(Kind::kRun, {2e3});
  return {
      {},
      {drive, moment},
      {make(Kind::kVelocity, {0, 0.1, 0.1, 20e3, 1, 0}), make(Kind::kRun, {50e3})},
      {make(Kind::kEstop, {0}), moment},
      {drive, moment, make(Kind::kLate, {30e3}), make(Kind::kRun, {40e3})},
      {make(Kind::kDriverFails, {1}), moment},
      {drive, moment, make(Kind::kLate, {30e3}), make(Kind::kRun, {40e3}), make(Kind::kEstop, {0}),
       moment},
      {make(Kind::kEstop, {0}), moment, make(Kind::kClearEstop, {0, 1}), moment},
      {make(Kind::kRestart, {0}), make(Kind::kService)},
      {make(Kind::kConfigure, {0, kLateBoard, 0}), moment},
      {make(Kind::kHello, {0, 1}), moment},
      {make(Kind::kHello, {1, 1}), moment},
  };
}

/// What else may be so when the message comes: the contact open, seen by the firmware or not; a
/// store that fails.
std::vector<Operations> circumstances() {
  return {{},
          {make(Kind::kContact, {1})},
          {make(Kind::kContact, {1}), make(Kind::kRun, {2e3}), make(Kind::kContact, {0})},
          {make(Kind::kStoreFails, {0, 1}), make(Kind::kStoreFails, {1, 1})}};
}

std::vector<Operation> messages() {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  return {
      make(Kind::kHello, {0, 1}),
      make(Kind::kHello, {0, 0}),
      make(Kind::kHello, {1, 1}),
      make(Kind::kHello, {0, 1, 1}),
      make(Kind::kHello, {0, 1, 0, 1}),
      make(Kind::kPing, {0}),
      make(Kind::kPing, {0, 2}),
      make(Kind::kVelocity, {0, 0.1, 0.1, 1e6, 1, 0}),
      make(Kind::kVelocity, {0, 0, 0, 1e6, 1, 0}),
      make(Kind::kVelocity, {0, kNan, 0.1, 1e6, 1, 0}),
      make(Kind::kVelocity, {0, 0.1, 0.1, -1, 1, 0}),
      make(Kind::kVelocity, {0, 0.1, 0.1, 1e6, 0, 0}),
      make(Kind::kVelocity, {0, 0.1, 0.1, 1e6, 1, 2}),
      make(Kind::kDuty, {0, 0.3, 0.3, 1e6, 1, 0}),
      make(Kind::kDuty, {0, 0, 0, 1e6, 1, 0}),
      make(Kind::kStop, {0, 0, 1}),
      make(Kind::kStop, {0, 1, 1}),
      make(Kind::kStop, {0, 3, 1}),
      make(Kind::kStop, {0, 9, 1, 2}),
      make(Kind::kEstop, {0}),
      make(Kind::kClearEstop, {0, 1}),
      make(Kind::kClearEstop, {0, 1, 2}),
      make(Kind::kClearEstop, {0, 0}),
      make(Kind::kClearFault, {0, 1}),
      make(Kind::kStreamRate, {0, 100}),
      make(Kind::kStreamRate, {0, 60000}),
      make(Kind::kGet, {0, 1}),
      make(Kind::kGet, {0, 0}),
      make(Kind::kSet, {0, id(ParameterId::kWheelRadius), 0.04, 1}),
      make(Kind::kSet, {0, id(ParameterId::kWheelRadius), 0.033f, 1}),
      make(Kind::kSet, {0, id(ParameterId::kWheelRadius), 7, 1}),
      make(Kind::kSet, {0, id(ParameterId::kWheelRadius), kNan, 1}),
      make(Kind::kSet, {0, id(ParameterId::kMaxDuty), 0.5, 1}),
      make(Kind::kSet, {0, id(ParameterId::kControlRateHz), 500.5, 1}),
      make(Kind::kSet, {0, id(ParameterId::kEstopInputEnabled), 0, 1}),
      make(Kind::kSet, {0, id(ParameterId::kStreamRateHz), 5000, 1}),
      make(Kind::kSet, {0, 200, 1, 1}),
      make(Kind::kSave, {0, 0}),
      make(Kind::kSave, {0, 8}),
      make(Kind::kSave, {0, 200}),
      make(Kind::kResetParameters, {0}),
      make(Kind::kList, {0, 0}),
      make(Kind::kList, {0, 200}),
      make(Kind::kLinkCounters, {0}),
      make(Kind::kControlCounters, {0}),
      make(Kind::kTrial, {0, 1, 1}),
      make(Kind::kTrial, {0, 1, kNan}),
      make(Kind::kTrial, {0, 2, 1}),
      make(Kind::kTrial, {0, 2, 99}),
      make(Kind::kTrial, {0, 3}),
      make(Kind::kTrial, {0, 4}),
      make(Kind::kTrial, {0, 0}),
      make(Kind::kGroup, {0, 1}),
      make(Kind::kGroup, {0, 7}),
      make(Kind::kContradictions, {0}),
      make(Kind::kHoldGet, {0}),
      make(Kind::kRestart, {0}),
      make(Kind::kConfigurationGet, {0}),
      make(Kind::kConfigure, {0, kLateBoard, 0}),
      make(Kind::kConfigure, {0, kLateBoard, 0, 1}),
      make(Kind::kConfirm, {0, 0}),
      make(Kind::kConfirm, {0, 1}),
      make(Kind::kBoxGet, {0, 0}),
      make(Kind::kBoxRead, {0, 1, 0}),
      make(Kind::kLedger, {0}),
      make(Kind::kUnsaved, {0}),
      make(Kind::kMemory, {0}),
      make(Kind::kSensorStream, {0, 100}),
      make(Kind::kPeripheralGet, {0, 0}),
      make(Kind::kConfigure, {0, -1, 1}),
      make(Kind::kConfigure, {0, -1, 1, 4}),
      make(Kind::kRepeat, {0, 0}),
      make(Kind::kRepeat, {0, 1}),
  };
}

void append(Scenario& scenario, const Operations& operations) {
  scenario.operations.insert(scenario.operations.end(), operations.begin(), operations.end());
}

}  // namespace

std::vector<Scenario> all_combinations() {
  // What a clear, or a refusal, must not have left behind shows in a setpoint after it.
  const Operations after = {make(Kind::kVelocity, {0, 0.1, 0.1, 100e3, 1, 0}),
                            make(Kind::kRun, {3e3})};
  const Operation boot_time = make(Kind::kBootTime, {kBootTime});
  std::vector<Scenario> scenarios;
  for (const Operations& board : boards()) {
    for (const Operations& trial : trials()) {
      for (const Operations& state : states()) {
        for (const Operations& circumstance : circumstances()) {
          for (const Operation& message : messages()) {
            for (const Operation& read : {make(Kind::kService), make(Kind::kRun, {2e3})}) {
              Scenario scenario{.seed = 1, .operations = {boot_time}};
              append(scenario, board);
              append(scenario, trial);
              append(scenario, state);
              append(scenario, circumstance);
              append(scenario, {message, read});
              append(scenario, after);
              scenarios.push_back(std::move(scenario));
            }
          }
          // A change of values on trial, that KEEP judges.
          Scenario scenario{.seed = 1, .operations = {boot_time}};
          append(scenario, board);
          append(scenario, trial);
          append(scenario, state);
          append(scenario, circumstance);
          append(scenario, {make(Kind::kSet, {0, id(ParameterId::kStreamRateHz), 5000, 1}),
                            make(Kind::kService), make(Kind::kTrial, {0, 3})});
          append(scenario, after);
          scenarios.push_back(std::move(scenario));
        }
      }
    }
  }
  return scenarios;
}

}  // namespace wheelwire::explore
