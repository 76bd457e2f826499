// The chip's peripherals, connected to the plant: every interface that the core uses.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "board_rules.hpp"
#include "clock.hpp"
#include "counter.hpp"
#include "flash.hpp"
#include "hal.hpp"
#include "line.hpp"
#include "own_board.hpp"
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

  uint16_t millivolts() override {
    return static_cast<uint16_t>(std::lround(std::max(0.0, volts - sag_v) * measured * 1e3));
  }
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
  explicit ChipState(WiredBoard& wired)
      : stages{DrivenStage(pins, wired), DrivenStage(pins, wired)} {}
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
  explicit SimulatedBoard(uint64_t seed)
      : encoders{Quadrature(mix(seed)), Quadrature(mix(seed + 1))},
        sensors(*this, mix(seed + 2)),
        active_(kOwnBoard),
        wired_(kOwnBoard) {
    for (Store* const one : {&configuration_store, &store, &latch_store}) {
      one->lie_in(flash);
      one->watch = &power_cut;
    }
    configuration_store.record(store, latch_store);
    reset();
  }

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
  void run_until(Nanoseconds end, bool listening) {
    const std::array<BridgeState, 2> applied = bridges();
    const Nanoseconds start = now_;
    while (now_ < end) {
      const Nanoseconds step = std::min(kPhysicsStep, end - now_);
      plant.step(static_cast<double>(step) * kNanosecond, applied);
      for (const Side side : kSides) turn_encoder(side);
      now_ += step;
      sensors.advance(listening);
      if (is_browned_out()) break;
    }
    battery.sag_v = plant.sag_v();
    line.carry(static_cast<double>(now_ - start) * kNanosecond, listening);
  }

  /// All pins float, counters and clock from 0, the line's buffers lost. The store stays.
  void reset() {
    chip_.emplace(wired_);
    wired_.reset();
    wired_.read(chip_->pins);
    for (const Side counter : kSides) chip_->counters[counter] = fresh_counter(counter);
    line.reset();
    clock.reset(now_);
  }

  /// The firmware starts its peripherals on the GPIOs of its active board: a default one if it has
  /// none. With `drives` false all pins go on floating, and it only reads.
  void take_up(const BoardDescription& active, bool drives = true) {
    active_ = active;
    const bool is_board = active.version == kBoardVersion;
    rewire(wired_as_active_ && is_board ? active : wired_.description());
    for (const Side counter : kSides) chip_->counters[counter] = fresh_counter(counter);
    const StageTable& table = *table_of(active.stage);
    chip_->left_motor.emplace(chip_->stages[kLeft], table);
    chip_->right_motor.emplace(chip_->stages[kRight], table);
    if (!drives || !is_board) return;
    chip_->pins.pull_up(active.estop);
    if (active.encoder_pulls == EncoderPulls::kInternal)
      for (const BoardPin input : kEncoderPins) chip_->pins.pull_up(active.pin(input));
    chip_->pins.drive(active.led, 0);
    for (const Side side : kSides) chip_->stages[side].start(active, side);
  }

  /// From now on the robot is wired as this board, whatever the firmware's active board.
  void wire(const BoardDescription& board) {
    wired_as_active_ = false;
    rewire(board);
  }

  /// It is wired as the active board, now and after each start. So it is at first.
  void wire_as_active() {
    wired_as_active_ = true;
    if (active_.version == kBoardVersion) rewire(active_);
  }

  bool is_wired_as_active() const { return wired_as_active_; }
  const BoardDescription& wired() const { return wired_.description(); }

  /// Whether the board that is wired has nothing at this GPIO: it is left to a peripheral.
  bool is_free(int pin) const {
    for (size_t i = 0; i < kBoardPinCount; ++i)
      if (wired_.description().pin(static_cast<BoardPin>(i)) == pin) return false;
    return true;
  }

  void set_floating_level(bool high) {
    wired_.set_floating_level(high);
    wired_.read(chip_->pins);
  }

  bool floating_level() const { return wired_.floating_level(); }

  EncoderCounts latch() override {
    return {.t_us = device_us(),
            .left = chip_->counters[kLeft].value(),
            .right = chip_->counters[kRight].value()};
  }

  Hal hal() {
    return {.left_motor = *chip_->left_motor,
            .right_motor = *chip_->right_motor,
            .encoders = *this,
            .line = line,
            .store = store,
            .latches = latches,
            .latch_store = latch_store,
            .estop = estop,
            .battery = battery,
            .configuration = &configuration_store};
  }

  std::array<BridgeState, 2> bridges() const { return wired_.states(); }
  bool drives() const { return wired_.drives(); }

  uint32_t hard_switches() const {
    return wired_.bridges()[kLeft].hard_switches() + wired_.bridges()[kRight].hard_switches();
  }

  const ChipPins& pins() const { return chip_->pins; }

  /// GPIOs that the chip and what is wired to it both drive now: an encoder's output, or a contact
  /// that is closed to ground.
  int pin_conflicts() const {
    const BoardDescription& board = wired_.description();
    int count = contact_is_grounded() && chip_->pins.is_driven(board.estop) ? 1 : 0;
    for (const BoardPin output : kEncoderPins)
      if (chip_->pins.is_driven(board.pin(output))) ++count;
    return count;
  }

  bool reads_open_contact() const {
    const bool is_stop = active_.estop_contact == ContactKind::kNormallyClosed;
    return active_.estop >= 0 && input_level(active_.estop) == is_stop;
  }

  bool is_browned_out() const { return plant.supply_v() < brownout_v; }

 private:
  static constexpr double kNanosecond = 1e-9;
  static constexpr auto kPhysicsStep = static_cast<Nanoseconds>(kMaxPhysicsStep / kNanosecond);

  void turn_encoder(Side side) {
    encoders[side].turn(plant.turned_rad(side), counts_per_revolution, [&](bool a, bool b) {
      if (encoders_in_place_ && wiring.is_right()) {
        chip_->counters[side].set_levels(a, b);
        return;
      }
      for (const Side counter : kSides) {
        chip_->counters[counter].set_levels(
            input_level(active_.pin(kEncoderPins[2 * counter])),
            input_level(active_.pin(kEncoderPins[2 * counter + 1])));
      }
    });
  }

  /// As the chip reads it against its pull-up.
  bool input_level(int pin) const {
    if (pin < 0) return true;
    const BoardDescription& board = wired_.description();
    for (const Side counter : kSides) {
      if (pin == board.pin(kEncoderPins[2 * counter])) return encoders[wiring.a_of(counter)].a();
      if (pin == board.pin(kEncoderPins[2 * counter + 1]))
        return encoders[wiring.b_of(counter)].b();
    }
    return !(pin == board.estop && contact_is_grounded());
  }

  bool contact_is_grounded() const {
    return (wired_.description().estop_contact == ContactKind::kNormallyClosed) != estop.open;
  }

  PulseCounter fresh_counter(Side counter) const {
    return PulseCounter(input_level(active_.pin(kEncoderPins[2 * counter])),
                        input_level(active_.pin(kEncoderPins[2 * counter + 1])));
  }

  void rewire(const BoardDescription& board) {
    if (board != wired_.description()) wired_.wire(board);
    wired_.read(chip_->pins);
    encoders_in_place_ = true;
    for (const BoardPin pin : kEncoderPins)
      encoders_in_place_ = encoders_in_place_ && board.pin(pin) == active_.pin(pin);
    // A board without an input for it leaves the battery to the simulator.
    if (active_.battery < 0) {
      battery.measured = 1.0;
    } else if (board.battery != active_.battery) {
      battery.measured = 0.0;
    } else {
      battery.measured =
          static_cast<double>(active_.battery_divider_permille) / board.battery_divider_permille;
    }
  }

  BoardDescription active_;
  WiredBoard wired_;
  bool wired_as_active_ = true;
  bool encoders_in_place_ = true;  ///< On the GPIOs that the firmware counts at.
  std::optional<ChipState> chip_;
  Nanoseconds now_ = 0;
};

inline bool EstopContact::is_open() { return board_.reads_open_contact(); }

}  // namespace wheelwire::sim
