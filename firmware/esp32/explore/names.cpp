#include "names.hpp"

#include <array>
#include <charconv>

#include "reset_reason.hpp"
#include "shipped_boards.hpp"

namespace wheelwire::explore {

namespace {

template <typename Code, size_t kSize>
std::string look_up(const std::array<const char*, kSize>& names, Code code) {
  const auto index = static_cast<size_t>(code);
  return index < kSize ? names[index] : "code " + std::to_string(index);
}

struct MessageName {
  uint8_t id;
  const char* name;
  uint8_t answer;
};

constexpr MessageName kMessages[] = {
    {Hello::kId, "Hello", DeviceHello::kId},
    {Stop::kId, "Stop", Ack::kId},
    {Estop::kId, "Estop", Ack::kId},
    {SetWheelVelocity::kId, "SetWheelVelocity", 0},
    {SetDuty::kId, "SetDuty", 0},
    {Ping::kId, "Ping", Pong::kId},
    {ClearEstop::kId, "ClearEstop", Ack::kId},
    {ClearFault::kId, "ClearFault", Ack::kId},
    {SetStreamRate::kId, "SetStreamRate", Ack::kId},
    {ParameterGet::kId, "ParameterGet", ParameterValue::kId},
    {ParameterSet::kId, "ParameterSet", ParameterValue::kId},
    {ParameterSave::kId, "ParameterSave", Ack::kId},
    {ParameterReset::kId, "ParameterReset", Ack::kId},
    {ParameterList::kId, "ParameterList", ParameterEntry::kId},
    {LinkCountersGet::kId, "LinkCountersGet", LinkCounters::kId},
    {ControlCountersGet::kId, "ControlCountersGet", ControlCounters::kId},
    {ParameterTrial::kId, "ParameterTrial", Ack::kId},
    {GroupGet::kId, "GroupGet", GroupInfo::kId},
    {Restart::kId, "Restart", Ack::kId},
    {ContradictionsGet::kId, "ContradictionsGet", Contradictions::kId},
    {HoldGet::kId, "HoldGet", Hold::kId},
    {ConfigurationGet::kId, "ConfigurationGet", ConfigurationValue::kId},
    {PeripheralGet::kId, "PeripheralGet", PeripheralValue::kId},
    {BoardSet::kId, "BoardSet", Ack::kId},
    {PeripheralSet::kId, "PeripheralSet", Ack::kId},
    {ConfigurationWrite::kId, "ConfigurationWrite", Ack::kId},
    {ConfigurationConfirm::kId, "ConfigurationConfirm", Ack::kId},
    {BoxGet::kId, "BoxGet", BoxValue::kId},
    {BoxRead::kId, "BoxRead", BoxPart::kId},
    {LedgerGet::kId, "LedgerGet", LedgerValue::kId},
    {UnsavedGet::kId, "UnsavedGet", UnsavedValue::kId},
    {MemoryGet::kId, "MemoryGet", MemoryValue::kId},
    {SensorStream::kId, "SensorStream", Ack::kId},
    {DeviceHello::kId, "DeviceHello", 0},
    {WheelState::kId, "WheelState", 0},
    {Refuse::kId, "Refuse", 0},
    {Ack::kId, "Ack", 0},
    {Pong::kId, "Pong", 0},
    {ParameterValue::kId, "ParameterValue", 0},
    {ParameterEntry::kId, "ParameterEntry", 0},
    {Event::kId, "Event", 0},
    {LinkCounters::kId, "LinkCounters", 0},
    {ControlCounters::kId, "ControlCounters", 0},
    {GroupInfo::kId, "GroupInfo", 0},
    {Contradictions::kId, "Contradictions", 0},
    {Hold::kId, "Hold", 0},
    {ConfigurationValue::kId, "ConfigurationValue", 0},
    {BoxValue::kId, "BoxValue", 0},
    {BoxPart::kId, "BoxPart", 0},
    {LedgerValue::kId, "LedgerValue", 0},
    {UnsavedValue::kId, "UnsavedValue", 0},
    {SensorInfo::kId, "SensorInfo", 0},
    {Imu::kId, "Imu", 0},
    {Power::kId, "Power", 0},
    {Inputs::kId, "Inputs", 0},
    {SensorEvent::kId, "SensorEvent", 0},
    {PeripheralValue::kId, "PeripheralValue", 0},
};

const MessageName* find(uint8_t id) {
  for (const MessageName& message : kMessages)
    if (message.id == id) return &message;
  return nullptr;
}

}  // namespace

std::string name_of(RefusalCode code) {
  static constexpr std::array<const char*, kRefusalCodes> kNames = {"NONE",
                                                                    "PROTOCOL_VERSION",
                                                                    "SCHEMA",
                                                                    "NO_SESSION",
                                                                    "CLOCK_UNSYNCHRONISED",
                                                                    "EXPIRED",
                                                                    "NOT_FINITE",
                                                                    "OUT_OF_RANGE",
                                                                    "UNKNOWN_PARAMETER",
                                                                    "ESTOPPED",
                                                                    "FAULT",
                                                                    "CAUSE_PRESENT",
                                                                    "NOT_STOPPED",
                                                                    "STORE_FAILED",
                                                                    "RATE_TOO_HIGH",
                                                                    "NOT_INTEGRAL",
                                                                    "BOOTING",
                                                                    "ON_TRIAL",
                                                                    "NO_TRIAL",
                                                                    "BOARD_REFUSED",
                                                                    "BOARD_ON_TRIAL",
                                                                    "NO_BOARD_ON_TRIAL",
                                                                    "NOT_SUPPORTED",
                                                                    "BOARD_UNCONFIRMED",
                                                                    "UNARMED",
                                                                    "CONTRADICTION",
                                                                    "COMMAND_SEQ_SPENT"};
  return look_up(kNames, code);
}

std::string name_of(SupervisorState state) {
  static constexpr std::array<const char*, kStates> kNames = {"BOOT",      "IDLE",     "DRIVING",
                                                              "TIMED_OUT", "ESTOPPED", "FAULT"};
  return look_up(kNames, state);
}

std::string name_of(SupervisorEvent event) {
  static constexpr std::array<const char*, kEvents> kNames = {
      "STARTED", "SESSION",     "SETPOINT", "STOP",       "DEADLINE",
      "ESTOP",   "CLEAR_ESTOP", "FAULT",    "CLEAR_FAULT"};
  return look_up(kNames, event);
}

std::string name_of(ConfigurationState state) {
  static constexpr std::array<const char*, kConfigurationStates> kNames = {"DAMAGED", "BUILT_IN",
                                                                           "STORED", "TRIAL"};
  return look_up(kNames, state);
}

std::string name_of(ResetReason reason) {
  return std::string(sim::kResetReasonNames[static_cast<size_t>(reason)]);
}

std::string name_of_board(uint32_t wanted) {
  for (const sim::ShippedBoard& board : sim::kShippedBoards)
    if (checksum(board.board) == wanted) return std::string(board.name);
  return "another board";
}

std::string name_of_message(uint8_t id) {
  const MessageName* const message = find(id);
  return message != nullptr ? message->name : "message " + std::to_string(id);
}

std::string describe(const Seen& message) {
  std::string text = name_of_message(message.id);
  switch (message.id) {
    case Refuse::kId: {
      const auto refuse = message.as<Refuse>();
      return text + "(" + name_of(refuse.code) + " of " + name_of_message(refuse.message_id) + ")";
    }
    case Ack::kId:
      return text + "(" + name_of_message(message.as<Ack>().message_id) + ")";
    case ParameterSet::kId: {
      const auto set = message.as<ParameterSet>();
      return text + "(" + std::to_string(set.parameter) + " to " +
             text_of(static_cast<double>(set.value)) + ")";
    }
    case ParameterSave::kId:
      return text + "(" + std::to_string(message.as<ParameterSave>().parameter) + ")";
    case ParameterTrial::kId:
      return text + "(" + std::to_string(static_cast<int>(message.as<ParameterTrial>().action)) +
             ")";
    case SetWheelVelocity::kId: {
      const auto setpoint = message.as<SetWheelVelocity>();
      return text + "(" + text_of(static_cast<double>(setpoint.left_mps)) + ", " +
             text_of(static_cast<double>(setpoint.right_mps)) + ")";
    }
    default:
      return text;
  }
}

uint8_t answer_to(uint8_t id) {
  const MessageName* const message = find(id);
  return message != nullptr ? message->answer : uint8_t{0};
}

std::string text_of(double value) {
  char text[40];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

}  // namespace wheelwire::explore
