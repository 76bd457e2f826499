// The chip's peripherals, connected to the plant: every interface that the core uses.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "board_rules.hpp"
#include "clock.hpp"
#include "counter.hpp"
#include "flash.hpp"
#include "hal.hpp"
#include "line.hpp"
#include "plant.hpp"
#include "power_stage.hpp"
#include "quadrature.hpp"
#include "recorder_keeper.hpp"
#include "sensors.hpp"
#include "store.hpp"
#include "wired_board.hpp"

namespace wheelwire::sim {

class SimulatedBoard;

/// Wired to the wired board's GPIO; the firmware reads its active board's GPIO.
class EstopContact final : public EstopInput {
 public:
  explicit EstopContact(const SimulatedBoard& board) : board_(board) {}

  bool open = false;  ///< For a normally-open contact: closed.
  bool is_open() override;

 private:
  const SimulatedBoard& board_;
};

class Battery final : public BatterySense {
 public:
  double volts = 7.4;     ///< Without a load; 0: not measured.
  double sag_v = 0.0;     ///< Less by this.
  double measured = 1.0;  ///< What the firmware measures for one volt.
  uint16_t millivolts() override;
};

/// Which encoder's wires lead to each counter of the chip.
struct EncoderWiring {
  bool swapped = false;  ///< Each counter has the other wheel's encoder.
  int both_on = 0;       ///< Both counters have one encoder: 1 the left one, 2 the right one.
  bool mixed = false;    ///< Each counter has A of one encoder and B of the other.

  bool is_right() const { return !swapped && both_on == 0 && !mixed; }
  Side a_of(Side counter) const {
    if (both_on != 0) return both_on == 1 ? kLeft : kRight;
    return swapped ? other(counter) : counter;
  }
  Side b_of(Side counter) const { return mixed ? other(a_of(counter)) : a_of(counter); }
};

/// What a reset of the chip loses: pin levels and counters.
struct ChipState {
  explicit ChipState(WiredBoard& wired);
  ChipState(const ChipState&) = delete;
  ChipState& operator=(const ChipState&) = delete;

  ChipPins pins;
  std::array<DrivenStage, 2> stages;
  std::optional<PowerStage> left_motor{std::in_place, stages[kLeft]};
  std::optional<PowerStage> right_motor{std::in_place, stages[kRight]};
  std::array<PulseCounter, 2> counters{PulseCounter(true, true), PulseCounter(true, true)};
};

class SimulatedBoard final : public EncoderPort {
 public:
  explicit SimulatedBoard(uint64_t seed);
  SimulatedBoard(const SimulatedBoard&) = delete;
  SimulatedBoard& operator=(const SimulatedBoard&) = delete;

  Plant plant;
  std::array<Quadrature, 2> encoders;
  EncoderWiring wiring;
  int counts_per_revolution = 360;
  double brownout_v = 0.0;  ///< The chip needs a supply of at least this.
  Line line;
  Partition flash;
  PowerCut power_cut;
  Store store;
  Store configuration_store;
  RetainedMemory latches;
  Store latch_store;
  Flash recorder_flash{RecorderKeeper::kFlashSize};
  EstopContact estop{*this};
  Battery battery;
  Sensors sensors;
  DeviceClock clock;

  Nanoseconds now() const { return now_; }
  uint64_t device_us() const { return clock.microseconds(now_); }

  /// Advances physics and line to `end`, or to a brownout. A device that is not `listening` loses
  /// what it is sent.
  void run_until(Nanoseconds end, bool listening);
  /// All pins float, counters and clock from 0, the line's buffers lost. The store stays.
  void reset();

  /// The firmware starts its peripherals on the GPIOs of its active board: a default one if it has
  /// none. With `drives` false all pins go on floating, and it only reads.
  void take_up(const BoardDescription& active, bool drives = true);

  /// From now on the robot is wired as this board, whatever the firmware's active board.
  void wire(const BoardDescription& board);
  /// It is wired as the active board, now and after each start. So it is at first.
  void wire_as_active();
  bool is_wired_as_active() const { return wired_as_active_; }
  const BoardDescription& wired() const { return wired_.description(); }
  /// Whether the board that is wired has nothing at this GPIO: it is left to a peripheral.
  bool is_free(int pin) const;
  void set_floating_level(bool high);
  bool floating_level() const { return wired_.floating_level(); }

  EncoderCounts latch() override;
  Hal hal();
  std::array<BridgeState, 2> bridges() const;
  bool drives() const;
  uint32_t hard_switches() const;
  const ChipPins& pins() const { return chip_->pins; }
  /// GPIOs that the chip and what is wired to it both drive now: an encoder's output, or a contact
  /// that is closed to ground.
  int pin_conflicts() const;
  bool reads_open_contact() const;
  bool is_browned_out() const { return plant.supply_v() < brownout_v; }

 private:
  void rewire(const BoardDescription& board);
  void turn_encoder(Side side);
  bool input_level(int pin) const;
  bool contact_is_grounded() const;
  PulseCounter fresh_counter(Side counter) const;

  BoardDescription active_;
  WiredBoard wired_;
  bool wired_as_active_ = true;
  bool encoders_in_place_ = true;  ///< On the GPIOs that the firmware counts at.
  std::optional<ChipState> chip_;
  Nanoseconds now_ = 0;
};

}  // namespace wheelwire::sim
