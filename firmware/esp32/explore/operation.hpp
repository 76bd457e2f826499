// A scenario as data: what hosts, hands and the power do to the robot, one operation after the
// other. It can be printed, read back as text and shortened.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace wheelwire::explore {

enum class Kind : uint8_t {
  // Time.
  kRun,
  kService,
  // Messages.
  kOpen,
  kHello,
  kPing,
  kVelocity,
  kDuty,
  kHold,
  kStop,
  kEstop,
  kClearEstop,
  kClearFault,
  kStreamRate,
  kGet,
  kSet,
  kSave,
  kResetParameters,
  kList,
  kLinkCounters,
  kControlCounters,
  kTrial,
  kGroup,
  kContradictions,
  kHoldGet,
  kRestart,
  kConfigurationGet,
  kConfigure,
  kConfirm,
  kBoxGet,
  kBoxRead,
  kLedger,
  kUnsaved,
  kMemory,
  kSensorStream,
  kPeripheralGet,
  kRepeat,
  // The line.
  kNoise,
  kImpair,
  kBaud,
  // The robot and what is done to it.
  kContact,
  kSensor,
  kReset,
  kPowerCut,
  kStoreFails,
  kStoreUnreadable,
  kDamage,
  kDriverFails,
  kBootTime,
  kLate,
  kClock,
  kWire,
  kSupply,
  kBattery,
  kSlope,
  kFree,
  kLoad,
  kPush,
  kBlocked,
  kMotor,
  kEncoder,
  kLostEdges,
  kGaps,
  kSwaps,
  kCounts,
  kCount,  // Not one.
};

constexpr size_t kArguments = 6;

struct Operation {
  Kind kind = Kind::kRun;
  std::array<double, kArguments> values{};
};

/// The name of a kind and of what it takes; an empty name ends the arguments.
struct KindSpec {
  Kind kind;
  const char* name;
  std::array<const char*, kArguments> arguments;
};

const KindSpec& spec_of(Kind kind);

/// As `velocity host=0 left=0.2 right=0.2`, without a line's end.
std::string to_text(const Operation& operation);

struct Scenario {
  uint64_t seed = 0;      ///< Of the simulator: boot ids, edges of the encoders.
  uint64_t excepted = 0;  ///< Rules that are not looked at, as bits.
  std::vector<Operation> operations;
};

std::string to_text(const Scenario& scenario);

/// Reads what to_text() wrote; `#` begins a comment. Returns what is wrong, empty if nothing is.
std::string parse(std::string_view text, Scenario& out);

}  // namespace wheelwire::explore
