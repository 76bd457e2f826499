// Codes and messages in words.
#pragma once

#include <charconv>
#include <string>

#include "protocol_names.hpp"
#include "wire_decoder.hpp"

namespace wheelwire::explore {

using wheelwire::name_of;

/// The shortest text that reads back as the same number.
inline std::string text_of(double value) {
  char text[40];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

/// nullptr: no message has this id.
inline const MessageName* find_message(uint8_t id) {
  for (const MessageName& message : kMessageNames)
    if (message.id == id) return &message;
  return nullptr;
}

/// Of a message.
inline std::string name_of_message(uint8_t id) {
  const MessageName* const message = find_message(id);
  return message != nullptr ? message->name : "message " + std::to_string(id);
}

/// The message with what tells it from others of its kind.
inline std::string describe(const Seen& message) {
  const std::string name = name_of_message(message.id);
  const auto with = [&name](const std::string& what) { return name + "(" + what + ")"; };
  switch (message.id) {
    case Refuse::kId: {
      const auto refuse = message.as<Refuse>();
      return with(name_of(refuse.code) + " of " + name_of_message(refuse.message_id));
    }
    case Ack::kId:
      return with(name_of_message(message.as<Ack>().message_id));
    case ParameterSet::kId: {
      const auto set = message.as<ParameterSet>();
      return with(std::to_string(set.parameter) + " to " + text_of(set.value));
    }
    case ParameterSave::kId:
      return with(std::to_string(message.as<ParameterSave>().parameter));
    case ParameterTrial::kId:
      return with(std::to_string(static_cast<int>(message.as<ParameterTrial>().action)));
    case SetWheelVelocity::kId: {
      const auto setpoint = message.as<SetWheelVelocity>();
      return with(text_of(setpoint.left_mps) + ", " + text_of(setpoint.right_mps));
    }
    default:
      return name;
  }
}

constexpr bool is_setpoint(uint8_t id) { return id == SetWheelVelocity::kId || id == SetDuty::kId; }

/// The message that answers this one when it is carried out.
inline uint8_t answer_to(uint8_t id) {
  const MessageName* const message = find_message(id);
  return message != nullptr ? message->answer : uint8_t{0};
}

}  // namespace wheelwire::explore
