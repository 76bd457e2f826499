// A robot on the chip's pins, from a reset on.
#pragma once

#include "check.hpp"
#include "pins.hpp"
#include "release_pins.hpp"
#include "stage_boards.hpp"
#include "wired_robot.hpp"

extern "C" void bootloader_before_init();

namespace wheelwire::test {

inline void power_on() {
  fake_matrix = {};
  for (uint8_t& byte : fake_rtc_memory.custom) byte = 0x5a;
}

/// From a reset of the CPU, which leaves all registers of the pins, to the control task.
struct StartedRobot : WiredRobot {
  explicit StartedRobot(const BoardDescription& of,
                        ConfigurationState state = ConfigurationState::kStored)
      : WiredRobot(of) {
    bootloader_before_init();
    CHECK(float_pins());
    CHECK(take_pins(state, of));
    if (is_confirmed(state)) CHECK(start(Parameters{}));
  }
};

}  // namespace wheelwire::test
