#include "device.hpp"

namespace wheelwire {

namespace {

BoardFacts facts_of(const ActiveConfiguration& configuration) {
  const StageTable* const stage = table_of(configuration.board().stage);
  const bool is_known = configuration.is_confirmed() && stage != nullptr;
  return {.checksum = checksum(configuration.board()),
          .max_pwm_hz = is_known ? stage->max_frequency_hz : 0,
          .is_confirmed = configuration.is_confirmed(),
          .on_trial = configuration.on_trial()};
}

}  // namespace

Device::Device(const Hal& hal, const Identity& identity, const ParameterSpec* specs,
               ActiveConfiguration& configuration)
    : server_(robot_, hal.line, identity, &configuration),
      robot_(hal, server_, specs, facts_of(configuration)) {
  if (configuration.state() == ConfigurationState::kDamaged)
    robot_.report_failure(fault::kNoBoard | (configuration.faults() & fault::kStoreOutdated));
}

void Device::start(uint64_t now_us) {
  robot_.start(server_.reset_reason(), now_us);
  if (sensors_ != nullptr && (robot_.reflexes() & kBatteryAtStop) != 0) sensors_->start_at_stop();
}

/// The order matters. Faults are latched before the link is read: a message may clear a fault, or
/// stop the wheels, only after the fault has been reported. Contact and deadline are checked after
/// it, and just before the outputs are written: a setpoint that has just arrived counts, but drives
/// nothing while the contact is open.
void Device::step(uint64_t now_us) {
  if (recorder() != nullptr) prepare_recorder();
  if (sensors_ != nullptr) robot_.note_reflexes(sensors_->update(now_us));
  robot_.begin_step(now_us);
  server_.service_link(now_us);
  robot_.finish_step(now_us);
  server_.stream_state(now_us);
  if (sensors_ != nullptr) sensors_->stream(now_us);
}

void Device::sense(SensorMessages& sensors) {
  sensors.attach(server_);
  server_.offer(sensors);
  if (!sensors.is_active()) return;
  sensors_ = &sensors;
  robot_.expect_sensors();
}

/// What follows does not belong to the step before it.
void Device::prepare_recorder() {
  recorder()->note_pause();
  if (recorder()->wants_state()) recorder()->note_state(server_, robot_);
}

void Device::note_stall() {
  if (recorder() != nullptr) recorder()->note_stall();
  robot_.note_stall();
}

void Device::service_link(uint64_t now_us) {
  if (recorder() != nullptr) recorder()->note_pause();
  server_.service_link(now_us);
}

void Device::hang_up(uint64_t now_us) {
  if (recorder() != nullptr) {
    prepare_recorder();
    recorder()->note_hang_up(now_us);
  }
  server_.hang_up(now_us);
}

}  // namespace wheelwire
