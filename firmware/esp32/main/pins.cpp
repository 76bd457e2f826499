#include "pins.hpp"

#include "gpio_pin.hpp"
#include "release_pins.hpp"

namespace wheelwire {
namespace {

constexpr const ChipTable& kChip = *table_of(kImageBoard.chip);

/// A reset of the CPU, as by a restart, a panic or a watchdog, leaves GPIO_ENABLE, GPIO_OUT and the
/// GPIO matrix as they were: an output stays one, at its level or on its PWM. Nothing else ends
/// that: pcnt_new_channel() of ESP-IDF 5.5 sets pull-up, IO_MUX function, input enable and the
/// matrix's input for an encoder's pin, and leaves its output enabled.
///
/// gpio_config() with the mode "input" does, for each pin: input enable in IO_MUX; open drain off;
/// GPIO_ENABLE_W1TC, which disables the output, and that register in charge of it; both pulls off;
/// interrupt off; IO_MUX to the GPIO matrix, away from JTAG and the like. It leaves the pin's
/// FUNC_OUT_SEL_CFG: the bootloader has taken the pin from any peripheral, and the mode "output"
/// does so, too.
bool let_float(PinMask pins) { return configure(pins, GPIO_MODE_INPUT); }

}  // namespace

// Before a board is read no module is known, and the pins of an octal flash must stay as they are.
bool float_pins() { return let_float(drivable_pins(kChip) & ~saved_release_pins()); }

bool take_pins(ConfigurationState state, const BoardDescription& board) {
  const PinMask held = is_confirmed(state) ? release_pins(board) : 0;
  // A board on trial may be the wrong one: after a reset its pins float, too.
  set_release_pins(held, state == ConfigurationState::kStored ? held : 0);
  release_motors();
  const Module module = is_confirmed(state) ? board.module : Module::kAny;
  return let_float(drivable_pins(kChip, module) & ~held);
}

}  // namespace wheelwire
