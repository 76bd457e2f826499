// The board of this image: active until another one is written. It was checked when it was
// generated into the core, at compile time.
#pragma once

#include "built_in_boards.hpp"
#include "sdkconfig.h"

namespace wheelwire {

#if CONFIG_IDF_TARGET_ESP32
inline constexpr const BoardDescription& kImageBoard = kBoardOfEsp32;
#elif CONFIG_IDF_TARGET_ESP32S3
inline constexpr const BoardDescription& kImageBoard = kBoardOfEsp32s3;
#elif CONFIG_IDF_TARGET_ESP32C6
inline constexpr const BoardDescription& kImageBoard = kBoardOfEsp32c6;
#else
#error "Wheelwire runs on ESP32, ESP32-S3 and ESP32-C6: the motors need MCPWM, the encoders PCNT."
#endif

}  // namespace wheelwire
