#include "board.hpp"

#include <algorithm>
#include <cmath>

#include "own_board.hpp"

namespace wheelwire::sim {

namespace {

constexpr double kNanosecond = 1e-9;
constexpr auto kPhysicsStep = static_cast<Nanoseconds>(kMaxPhysicsStep / kNanosecond);

}  // namespace

bool EstopContact::is_open() { return board_.reads_open_contact(); }

uint16_t Battery::millivolts() {
  return static_cast<uint16_t>(std::lround(std::max(0.0, volts - sag_v) * measured * 1e3));
}

ChipState::ChipState(WiredBoard& wired)
    : stages{DrivenStage(pins, wired), DrivenStage(pins, wired)} {}

SimulatedBoard::SimulatedBoard(uint64_t seed)
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

void SimulatedBoard::run_until(Nanoseconds end, bool listening) {
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

void SimulatedBoard::turn_encoder(Side side) {
  encoders[side].turn(plant.turned_rad(side), counts_per_revolution, [&](bool a, bool b) {
    if (encoders_in_place_ && wiring.is_right()) {
      chip_->counters[side].set_levels(a, b);
      return;
    }
    for (const Side counter : kSides) {
      chip_->counters[counter].set_levels(input_level(active_.pin(kEncoderPins[2 * counter])),
                                          input_level(active_.pin(kEncoderPins[2 * counter + 1])));
    }
  });
}

/// As the chip reads it against its pull-up.
bool SimulatedBoard::input_level(int pin) const {
  if (pin < 0) return true;
  const BoardDescription& board = wired_.description();
  for (const Side counter : kSides) {
    if (pin == board.pin(kEncoderPins[2 * counter])) return encoders[wiring.a_of(counter)].a();
    if (pin == board.pin(kEncoderPins[2 * counter + 1])) return encoders[wiring.b_of(counter)].b();
  }
  return !(pin == board.estop && contact_is_grounded());
}

bool SimulatedBoard::contact_is_grounded() const {
  return (wired_.description().estop_contact == ContactKind::kNormallyClosed) != estop.open;
}

bool SimulatedBoard::reads_open_contact() const {
  const bool is_stop = active_.estop_contact == ContactKind::kNormallyClosed;
  return active_.estop >= 0 && input_level(active_.estop) == is_stop;
}

int SimulatedBoard::pin_conflicts() const {
  const BoardDescription& board = wired_.description();
  int count = contact_is_grounded() && chip_->pins.is_driven(board.estop) ? 1 : 0;
  for (const BoardPin output : kEncoderPins)
    if (chip_->pins.is_driven(board.pin(output))) ++count;
  return count;
}

PulseCounter SimulatedBoard::fresh_counter(Side counter) const {
  return PulseCounter(input_level(active_.pin(kEncoderPins[2 * counter])),
                      input_level(active_.pin(kEncoderPins[2 * counter + 1])));
}

void SimulatedBoard::reset() {
  chip_.emplace(wired_);
  wired_.reset();
  wired_.read(chip_->pins);
  for (const Side counter : kSides) chip_->counters[counter] = fresh_counter(counter);
  line.reset();
  clock.reset(now_);
}

void SimulatedBoard::take_up(const BoardDescription& active, bool drives) {
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

void SimulatedBoard::wire(const BoardDescription& board) {
  wired_as_active_ = false;
  rewire(board);
}

void SimulatedBoard::wire_as_active() {
  wired_as_active_ = true;
  if (active_.version == kBoardVersion) rewire(active_);
}

void SimulatedBoard::rewire(const BoardDescription& board) {
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

bool SimulatedBoard::is_free(int pin) const {
  for (size_t i = 0; i < kBoardPinCount; ++i)
    if (wired_.description().pin(static_cast<BoardPin>(i)) == pin) return false;
  return true;
}

void SimulatedBoard::set_floating_level(bool high) {
  wired_.set_floating_level(high);
  wired_.read(chip_->pins);
}

EncoderCounts SimulatedBoard::latch() {
  return {.t_us = device_us(),
          .left = chip_->counters[kLeft].value(),
          .right = chip_->counters[kRight].value()};
}

Hal SimulatedBoard::hal() {
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

std::array<BridgeState, 2> SimulatedBoard::bridges() const {
  return {wired_.bridges()[kLeft].state(), wired_.bridges()[kRight].state()};
}

uint32_t SimulatedBoard::hard_switches() const {
  return wired_.bridges()[kLeft].hard_switches() + wired_.bridges()[kRight].hard_switches();
}

bool SimulatedBoard::drives() const {
  return wired_.bridges()[kLeft].state().drives() || wired_.bridges()[kRight].state().drives();
}

}  // namespace wheelwire::sim
