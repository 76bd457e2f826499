// Codes and messages in words.
#pragma once

#include <string>

#include "configuration.hpp"
#include "protocol_names.hpp"
#include "wire_decoder.hpp"

namespace wheelwire::explore {

using wheelwire::name_of;
std::string name_of(ResetReason reason);
/// Name of a shipped board, found by its checksum.
std::string name_of(const BoardDescription& board);
/// Of a message.
std::string name_of_message(uint8_t id);
/// The message with what tells it from others of its kind.
std::string describe(const Seen& message);
constexpr bool is_setpoint(uint8_t id) { return id == SetWheelVelocity::kId || id == SetDuty::kId; }
/// The message that answers this one when it is carried out.
uint8_t answer_to(uint8_t id);
/// The shortest text that reads back as the same number.
std::string text_of(double value);

}  // namespace wheelwire::explore
