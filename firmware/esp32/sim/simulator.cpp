#include "simulator.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "own_board.hpp"
#include "reset_reason.hpp"

namespace wheelwire::sim {

namespace {

Identity power_on_identity(uint64_t board_id) {
  return {.boot_id = 0,
          .reset_reason = ResetReason::kPowerOn,
          .board = Chip::kSimulated,
          .board_id = board_id,
          .capabilities = capability::kBattery | capability::kEstopInput |
                          capability::kSimulatedPlant | capability::kRestart,
          .version_major = WHEELWIRE_VERSION_MAJOR,
          .version_minor = WHEELWIRE_VERSION_MINOR,
          .version_patch = WHEELWIRE_VERSION_PATCH,
          .git_hash = WHEELWIRE_GIT_HASH};
}

/// Like the text of the ESP32's ROM.
Bytes rom_text(ResetReason reason) {
  const std::string text = "\r\nrst:0x" + std::to_string(static_cast<int>(reason)) +
                           ",boot:0x13 (SPI_FAST_FLASH_BOOT)\r\nentry 0x400805e4\r\n";
  return Bytes(text.begin(), text.end());
}

}  // namespace

Simulator::Simulator(uint64_t seed)
    : board(mix(seed)), random_(seed), identity_(power_on_identity(random_.next() >> 16)) {
  platform_specs(identity_.board, specs_);
  reset(ResetReason::kPowerOn);
}

void Simulator::advance(Nanoseconds duration) {
  const Nanoseconds end = board.now() + duration;
  for (;;) {
    const Nanoseconds step = next_step();
    if (!run_until(std::min(step, end))) continue;
    if (step > end) break;
    if (device_) {
      control_step();
    } else {
      boot();
    }
    if (std::exchange(board.power_cut.has_failed, false)) reset(ResetReason::kPowerOn);
  }
}

Nanoseconds Simulator::next_step() const {
  return board.clock.when(device_ ? next_step_us_ : boot_time_us);
}

Nanoseconds Simulator::next_event() const {
  const double line_s = board.line.until_idle();
  if (line_s == 0.0) return next_step();
  const auto line_ns = static_cast<Nanoseconds>(std::ceil(line_s * 1e9));
  return std::min(next_step(), board.now() + line_ns);
}

bool Simulator::run_until(Nanoseconds end) {
  if (end <= board.now()) return true;
  board.run_until(end, device_.has_value());
  const bool browned_out = board.is_browned_out();
  if (browned_out) brown_out();
  observe();
  return !browned_out;
}

/// The chip is held in reset as long as the supply is too low.
void Simulator::brown_out() {
  if (device_) reset(ResetReason::kBrownout);
  identity_.reset_reason = ResetReason::kBrownout;
  board.clock.reset(board.now());
}

void Simulator::boot() {
  const Configuration& built_in = board_unwritten ? kUnwrittenConfiguration : kOwnConfiguration;
  // The chip that is simulated: it refuses boards of others, as the real one does.
  configuration_.emplace(&board.configuration_store, built_in.board.chip, &built_in,
                         board_unwritten ? ActiveConfiguration::BuiltIn::kUnconfirmed
                                         : ActiveConfiguration::BuiltIn::kConfirmed);
  configuration_->start();
  std::copy(std::begin(specs_), std::end(specs_), boot_specs_);
  if (configuration_->is_confirmed()) apply_board(configuration_->board(), boot_specs_);
  board.take_up(configuration_->board(), configuration_->is_confirmed());
  device_.emplace(board.hal(), identity_, boot_specs_, *configuration_);
  board.sensors.take_up(configuration_->peripherals());
  sensors_.emplace(configuration_->peripherals(), &board.sensors, &board.battery);
  device_->sense(*sensors_);
  const uint64_t now_us = board.device_us();
  if (driver_failed_) device_->report_driver_failure();
  device_->start(now_us);
  recorder_.emplace(recorder_memory_, board.recorder_flash, origin_of(identity_),
                    identity_.reset_reason, configuration_->fingerprint());
  recorder_->start();
  device_->record(recorder_->black_box());
  device_->offer(*recorder_);
  next_step_us_ = now_us + device_->control_period_us();
  observe();
}

void Simulator::control_step() {
  // Before the step, not after it: so what a step does is seen before the restart that follows it.
  if (device_->is_restart_due(board.device_us())) return reset(ResetReason::kSoftware);
  ++control_steps_;
  device_->step(board.device_us());
  recorder_->step(*device_, board.device_us());
  next_step_us_ += device_->control_period_us();
  observe();
}

void Simulator::service_link() {
  if (!device_) return;
  board.line.carry(0.0, true);
  device_->service_link(board.device_us());
  board.line.carry(0.0, true);
  observe();
}

void Simulator::reset(ResetReason reason) {
  device_.reset();
  recorder_.reset();
  sensors_.reset();
  configuration_.reset();
  board.reset();
  if (loses_memory(reason)) {
    board.latches.lose();
    recorder_memory_ = {};
  }
  identity_.boot_id = static_cast<uint32_t>(random_.next());
  identity_.reset_reason = reason;
  record_.deadline_us = 0;
  record_.drive_removed_us = 0;
  record_.standstill_us = 0;
  if (boot_text) board.line.emit_from_rom(rom_text(reason));
  observe();
}

std::vector<uint32_t> Simulator::box_image() {
  std::vector<uint32_t> image(kBoxImageWords);
  const bool is_closed = recorder_ && recorder_->black_box().is_closed();
  const BoxHead* const stored = recorder_ && !is_closed ? recorder_->store().head(0) : nullptr;
  if (stored != nullptr) {
    recorder_->store().read(stored->number, 0, reinterpret_cast<uint8_t*>(image.data()),
                            kBoxImageSize);
    return image;
  }
  const BoxHead head{.cause = is_closed ? recorder_->black_box().cause() : BoxCause::kRequest,
                     .reset_reason = identity_.reset_reason,
                     .origin = origin_of(identity_),
                     .board = configuration_fingerprint(),
                     .faults = faults(),
                     .stored_us = board.device_us(),
                     .check = box_check(recorder_memory_.box)};
  head.encode(image.data());
  std::copy(std::begin(recorder_memory_.box), std::end(recorder_memory_.box),
            image.begin() + BoxHead::kWords);
  return image;
}

bool Simulator::preset(int parameter, float value) {
  const auto id = static_cast<ParameterId>(parameter);
  if (parameter < 1 || parameter > 255) return false;
  if (Parameters(specs_).set(id, value) != RefusalCode::kNone) return false;
  specs_[parameter - 1].default_value = value;
  return true;
}

void Simulator::set_driver_failed(bool failed) {
  driver_failed_ = failed;
  if (failed && device_) device_->report_driver_failure();
}

void Simulator::set_core_dump(bool present) {
  identity_.capabilities &= ~capability::kCoreDump;
  if (present) identity_.capabilities |= capability::kCoreDump;
}

void Simulator::observe() {
  const uint64_t now_us = board.device_us();
  if (device_ && device_->deadline_us() != 0) record_.deadline_us = device_->deadline_us();
  if (board.drives() != record_.drive_on) {
    record_.drive_on = !record_.drive_on;
    ++record_.drive_changes;
    if (!record_.drive_on) record_.drive_removed_us = now_us;
  }
  if (board.plant.stands_still() != record_.stands_still) {
    record_.stands_still = !record_.stands_still;
    if (record_.stands_still) record_.standstill_us = now_us;
  }
}

}  // namespace wheelwire::sim
