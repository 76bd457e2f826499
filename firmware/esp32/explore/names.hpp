// Codes and messages in words.
#pragma once

#include <string>

#include "wire_decoder.hpp"

namespace wheelwire::explore {

std::string name_of(RefusalCode code);
std::string name_of(SupervisorState state);
std::string name_of(SupervisorEvent event);
std::string name_of(ConfigurationState state);
std::string name_of(ResetReason reason);
/// Name of a shipped board, found by its checksum.
std::string name_of_board(uint32_t checksum);
/// Of a message.
std::string name_of_message(uint8_t id);
/// The message with what tells it from others of its kind.
std::string describe(const Seen& message);
/// The message that answers this one when it is carried out.
uint8_t answer_to(uint8_t id);
std::string text_of(double value);

constexpr size_t kRefusalCodes = static_cast<size_t>(RefusalCode::kCommandSeqSpent) + 1;
constexpr size_t kStates = static_cast<size_t>(SupervisorState::kFault) + 1;
constexpr size_t kEvents = static_cast<size_t>(SupervisorEvent::kClearFault) + 1;
constexpr size_t kConfigurationStates = static_cast<size_t>(ConfigurationState::kTrial) + 1;

}  // namespace wheelwire::explore
