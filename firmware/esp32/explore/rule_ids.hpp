// The rules of docs/safety.md by their codes.
#pragma once

#include <cstdint>
#include <string>

namespace wheelwire::explore {

enum class Rule : uint8_t {
  kDriveOnlyInDriving = 1,
  kContactStops,
  kDeadlineStops,
  kConfirmedBoardOnly,
  kSessionAndClockFirst,
  kWheelFaultInTime,
  kSoundRobotDrivesOn,
  kLatchEndsByClear,
  kEstopSurvivesPowerLoss,
  kClearDoesNotRestart,
  kSlewWithinLimit,
  kRequestOnce,
  kTicksConserved,
  kFlashOldOrNew,
  kTrialEndsWithItsSession,
  kContradictionsNeverDrive,
  kAnswersAsSpecified,
  kNoHardSwitch,
  kWithinLimits,
  kStopAtOnce,
  kStateByItsTable,
  kRollingIsReported,
  kStopsAsAsked,
  kContactInputOfItsBoard,
  kLateStepIsAFault,
  kBoardStaysWhileEstopped,
  kFlashOnlyAtRest,
  kNotAgainstABumper,
  kExternalStops,
  kLostIsNotEmpty,
  kStartDoesNotDrive,
  kReleaseDoesNotRestart,
  kStopHolds,
  kNotTooFast,
  kValuesChangeAtRest,
  kHoldIsNamed,
};

/// Something is wrong; `text` says what. Empty: nothing is.
struct Finding {
  Rule rule = Rule::kAnswersAsSpecified;
  std::string text;
};

}  // namespace wheelwire::explore
