// Power stages by GPIO: the wired ones, and those that the firmware drives. If the wired board is
// not the active one, each input gets what its GPIO carries.
#pragma once

#include <array>

#include "bridge_port.hpp"
#include "chip_pins.hpp"

namespace wheelwire::sim {

/// Whether the parts have pull-downs of their own at all inputs, standby included, by their data
/// sheets: TB6612FNG 200 kOhm, DRV8833 150 and 500 kOhm.
inline bool holds_its_inputs_low(Stage stage) {
  return stage == Stage::kPwmIn1In2 || stage == Stage::kInIn;
}

inline std::array<int, kStageInputs> inputs_of(const BoardDescription& board, size_t wheel) {
  std::array<int, kStageInputs> pins;
  for (size_t i = 0; i < kStageInputs; ++i) pins[i] = board.pin(input_of(wheel, i));
  return pins;
}

/// The power stages of a board, each input on its GPIO.
class WiredBoard {
 public:
  explicit WiredBoard(const BoardDescription& board) { wire(board); }

  /// Other wires, and other stages on them.
  void wire(const BoardDescription& board) {
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

  const BoardDescription& description() const { return board_; }
  /// Counts what went wrong from 0.
  void reset() { wire(board_); }

  /// Passes the levels of the pins on to the stages.
  void read(ChipPins& pins) {
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

  /// What an input of a stage reads that nothing drives and nothing holds. An L298N's float high, a
  /// CMOS input either way.
  void set_floating_level(bool high) {
    floating_level_ = high;
    is_rewired_ = true;
  }

  bool floating_level() const { return floating_level_; }
  const std::array<Bridge, 2>& bridges() const { return bridges_; }
  std::array<BridgeState, 2> states() const { return {bridges_[0].state(), bridges_[1].state()}; }
  bool drives() const { return bridges_[0].state().drives() || bridges_[1].state().drives(); }

 private:
  /// The stronger one decides: some 10 kOhm of the board, 45 kOhm of the chip, 150 kOhm of a part.
  uint16_t level(const ChipPins& pins, int pin) const {
    if (pins.is_driven(pin)) return pins.duty_q15(pin);
    if (board_.pulldowns & mask_of(pin)) return 0;
    const bool high = pins.is_pulled_up(pin) || (!holds_low_ && floating_level_);
    return high ? kHigh_q15 : uint16_t{0};
  }

  BoardDescription board_;
  bool floating_level_ = true;
  bool is_rewired_ = true;         ///< Since the pins were read.
  std::array<PinMask, 2> read_{};  ///< The pins that matter to each stage.
  std::array<std::array<int, kStageInputs>, 2> pins_{};
  bool holds_low_ = false;  ///< The stages hold their inputs low by themselves.
  std::array<Bridge, 2> bridges_;
};

/// One wheel's power stage as the firmware drives it.
class DrivenStage final : public StagePort {
 public:
  DrivenStage(ChipPins& pins, WiredBoard& wired) : pins_(pins), wired_(wired) {}

  /// The inputs of this board's stage become outputs of the chip, low.
  void start(const BoardDescription& board, size_t wheel) {
    gpio_ = inputs_of(board, wheel);
    standby_ = board.standby;
    started_ = true;
    pins_.drive(standby_, 0);
    for (const int gpio : gpio_) pins_.drive(gpio, 0);
    wired_.read(pins_);
  }

  /// Without a start the pins stay as they are.
  void set(const StageOutputs& outputs) override {
    if (!started_) return;
    pins_.drive(standby_, kHigh_q15);
    for (size_t i = 0; i < kStageInputs; ++i) pins_.drive(gpio_[i], outputs.duty_q15[i]);
    wired_.read(pins_);
  }

 private:
  ChipPins& pins_;
  WiredBoard& wired_;
  std::array<int, kStageInputs> gpio_{};
  int standby_ = -1;
  bool started_ = false;
};

}  // namespace wheelwire::sim
