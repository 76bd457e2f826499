// Power stages by GPIO: the wired ones, and those that the firmware drives. If the wired board is
// not the active one, each input gets what its GPIO carries.
#pragma once

#include <array>

#include "bridge_port.hpp"
#include "chip_pins.hpp"

namespace wheelwire::sim {

/// The power stages of a board, each input on its GPIO.
class WiredBoard {
 public:
  explicit WiredBoard(const BoardDescription& board) { wire(board); }

  /// Other wires, and other stages on them.
  void wire(const BoardDescription& board);
  const BoardDescription& description() const { return board_; }

  /// Counts what went wrong from 0.
  void reset() { wire(board_); }

  /// Passes the levels of the pins on to the stages.
  void read(ChipPins& pins);

  /// What an input of a stage reads that nothing drives and nothing holds. An L298N's float high, a
  /// CMOS input either way.
  void set_floating_level(bool high);
  bool floating_level() const { return floating_level_; }

  const std::array<Bridge, 2>& bridges() const { return bridges_; }

 private:
  uint16_t level(const ChipPins& pins, int pin) const;

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
  void start(const BoardDescription& board, size_t wheel);
  /// Without a start the pins stay as they are.
  void set(const StageOutputs& outputs) override;

 private:
  ChipPins& pins_;
  WiredBoard& wired_;
  std::array<int, kStageInputs> gpio_{};
  int standby_ = -1;
  bool started_ = false;
};

}  // namespace wheelwire::sim
