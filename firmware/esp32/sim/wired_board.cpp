#include "wired_board.hpp"

namespace wheelwire::sim {

namespace {

/// Whether the parts have pull-downs of their own at all inputs, standby included, by their data
/// sheets: TB6612FNG 200 kOhm, DRV8833 150 and 500 kOhm.
bool holds_its_inputs_low(Stage stage) {
  return stage == Stage::kPwmIn1In2 || stage == Stage::kInIn;
}

std::array<int, kStageInputs> inputs_of(const BoardDescription& board, size_t wheel) {
  std::array<int, kStageInputs> pins;
  for (size_t i = 0; i < kStageInputs; ++i) pins[i] = board.pin(input_of(wheel, i));
  return pins;
}

}  // namespace

void WiredBoard::wire(const BoardDescription& board) {
  board_ = board;
  is_rewired_ = true;
  holds_low_ = holds_its_inputs_low(board.stage);
  for (size_t wheel = 0; wheel < 2; ++wheel) {
    pins_[wheel] = inputs_of(board, wheel);
    read_[wheel] = mask_of(board.standby);
    for (const int pin : pins_[wheel]) read_[wheel] |= mask_of(pin);
  }
  bridges_ = {Bridge(board.stage), Bridge(board.stage)};
}

void WiredBoard::set_floating_level(bool high) {
  floating_level_ = high;
  is_rewired_ = true;
}

/// The stronger one decides: some 10 kOhm of the board, 45 kOhm of the chip, 150 kOhm of a part.
uint16_t WiredBoard::level(const ChipPins& pins, int pin) const {
  if (pins.is_driven(pin)) return pins.duty_q15(pin);
  if (board_.pulldowns & mask_of(pin)) return 0;
  const bool high = pins.is_pulled_up(pin) || (!holds_low_ && floating_level_);
  return high ? kHigh_q15 : uint16_t{0};
}

void WiredBoard::read(ChipPins& pins) {
  const PinMask changed = pins.take_changed();
  for (size_t wheel = 0; wheel < 2; ++wheel) {
    if (!is_rewired_ && (changed & read_[wheel]) == 0) continue;
    StageOutputs inputs;
    for (size_t i = 0; i < kStageInputs; ++i) inputs.duty_q15[i] = level(pins, pins_[wheel][i]);
    // Tied high where it does not lead to the chip.
    bridges_[wheel].apply(inputs, board_.standby < 0 ? kHigh_q15 : level(pins, board_.standby));
  }
  is_rewired_ = false;
}

void DrivenStage::start(const BoardDescription& board, size_t wheel) {
  gpio_ = inputs_of(board, wheel);
  standby_ = board.standby;
  started_ = true;
  pins_.drive(standby_, 0);
  for (const int gpio : gpio_) pins_.drive(gpio, 0);
  wired_.read(pins_);
}

void DrivenStage::set(const StageOutputs& outputs) {
  if (!started_) return;
  pins_.drive(standby_, kHigh_q15);
  for (size_t i = 0; i < kStageInputs; ++i) pins_.drive(gpio_[i], outputs.duty_q15[i]);
  wired_.read(pins_);
}

}  // namespace wheelwire::sim
