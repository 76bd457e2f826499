// Ports that are values, for a robot whose hardware is elsewhere, or in the past.
#pragma once

#include "hal.hpp"

namespace wheelwire {

struct GivenEncoders final : EncoderPort {
  EncoderCounts counts{};
  EncoderCounts latch() override { return counts; }
};

struct GivenContact final : EstopInput {
  bool open = false;
  bool is_open() override { return open; }
};

struct GivenBattery final : BatterySense {
  uint16_t mv = 0;
  uint16_t millivolts() override { return mv; }
};

/// Holds nothing, and loses what it is given.
struct NoStore final : BlockStore {
  size_t load(uint8_t*, size_t) override { return 0; }
  bool save(const uint8_t*, size_t) override { return true; }
};

struct NoLatches final : LatchMemory {
  size_t load(uint8_t*, size_t) override { return 0; }
  void save(const uint8_t*, size_t) override {}
};

}  // namespace wheelwire
