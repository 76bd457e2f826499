#include "rerun.hpp"

#include <string.h>

#include "state_readers.hpp"

namespace wheelwire {

using box::Kind;

Rerun::Rerun(const uint32_t* memory, Accept accept) : reader_(memory), accept_(accept) {
  limit_ = at_;  // No state is asked for.
  advance();
}

Rerun::Outcome Rerun::run() {
  if (reader_.is_empty() || !has_next_) return Outcome::kEmpty;
  if (accept_ == Accept::kThisCore && !is_this_core()) return Outcome::kOtherCore;
  restore();
  while (has_next_ && outcome_ == Outcome::kSame) carry_out();
  if (outcome_ == Outcome::kSame && is_pending_) finish_step();
  return outcome_;
}

/// The robot as it was when the box begins.
void Rerun::restore() {
  const uint32_t flags = next_.words == 0 ? 0 : next_.payload[0];
  const Hal hal{.left_motor = motor_,
                .right_motor = motor_,
                .encoders = encoders_,
                .line = line_,
                .store = store_,
                .latches = latches_,
                .latch_store = store_,
                .estop = estop_,
                .battery = battery_,
                .configuration = &store_};
  // With all possible parts: the state removes those that did not exist.
  configuration_.emplace(&store_, Chip::kSimulated, nullptr);
  device_.emplace(hal, Identity{}, kParameters, *configuration_);
  device_->offer(archive_);
  device_->offer(platform_);
  device_->sense(sensors_.emplace(PeripheralList{}, nullptr, nullptr));
  contact_ = (flags & box::kOpenContact) != 0;
  is_pending_ = (flags & box::kInStep) != 0;
  StateReader reader(next_.payload + 1, next_.words - 1);
  reader.read(*device_);
  if (!reader.is_whole()) outcome_ = Outcome::kUnreadable;
  now_us_ = device_->last_step_us();
  // Only from here on: what the constructors do is not in the box.
  device_->record(*this);
  advance();
}

void Rerun::carry_out() {
  switch (next_.kind) {
    case Kind::kStep:
    case Kind::kWideStep:
    case Kind::kEnd:
      return carry_out_step();
    case Kind::kMessage:
      return carry_out_message();
    case Kind::kState:
      return compare_state();
    case Kind::kHangUp:
      finish_step();
      return device_->hang_up(now_us_ = next_.t_us);
    case Kind::kFailure:
      finish_step();
      return device_->report_driver_failure();
    case Kind::kStall:
      finish_step();
      return device_->note_stall();
    case Kind::kReflexes:
      finish_step();
      device_->note_reflexes(static_cast<uint8_t>(next_.words == 0 ? 0 : next_.payload[0]));
      return;
    case Kind::kContact:
    case Kind::kTransition:
    case Kind::kRefusal:
    case Kind::kStore:
    case Kind::kParameters:
      break;
  }
  // It came of something before it: of the step's second half, or the re-run does not have it.
  if (is_pending_) return finish_step();
  differ("record", static_cast<double>(next_.kind), 0);
}

void Rerun::carry_out_step() {
  finish_step();
  if (next_.kind != Kind::kEnd) {
    const StepNote& step = next_.step;
    encoders_.counts = {.t_us = step.t_us,
                        .left = step.left_counter,
                        .right = step.right_counter,
                        .left_illegal = step.left_illegal,
                        .right_illegal = step.right_illegal};
    battery_.mv = step.battery_mv;
    ++steps_;
    last_us_ = next_.t_us;
    if (steps_ == 1) first_us_ = last_us_;
  }
  is_pending_ = next_.kind != Kind::kEnd;
  device_->begin_step(now_us_ = next_.t_us);
}

void Rerun::carry_out_message() {
  if (!next_.in_step) {
    finish_step();
    now_us_ = next_.t_us;
  }
  if (body_size(next_.message_id) != next_.body_size) {
    outcome_ = Outcome::kUnreadable;
    return;
  }
  device_->serve({next_.message_id, next_.body}, now_us_);
}

void Rerun::compare_state() {
  const uint32_t flags = next_.words == 0 ? 0 : next_.payload[0];
  if ((flags & box::kInStep) == 0) finish_step();
  if (next_.kind != Kind::kState || outcome_ != Outcome::kSame) return;
  if (!is_this_core()) return advance();
  StateComparer comparer(next_.payload + 1, next_.words - 1);
  comparer.compare(*device_);
  if (comparer.differs()) return differ(comparer.field(), comparer.recorded(), comparer.computed());
  if (!comparer.is_whole()) outcome_ = Outcome::kUnreadable;
  advance();
}

// --- what comes of it ----------------------------------------------------------------------------

/// True if the box has such a record next; it stays until `advance`. If the box was not closed,
/// nothing is left to compare with at its end.
bool Rerun::take(Kind kind) {
  if (!has_next_ || outcome_ != Outcome::kSame) return false;
  if (next_.kind == kind) return true;
  differ("record", static_cast<double>(next_.kind), static_cast<double>(kind));
  return false;
}

void Rerun::differ(const char* field, double recorded, double computed) {
  if (outcome_ != Outcome::kSame) return;
  outcome_ = Outcome::kDiffers;
  difference_ = {.step = steps_, .t_us = now_us_, .recorded = recorded, .computed = computed};
  const size_t size = strnlen(field, sizeof difference_.field - 1);
  memcpy(difference_.field, field, size);
  difference_.field[size] = '\0';
}

void Rerun::note_step(const StepNote& note) {
  if (!is_this_core()) return advance();
  compare("left_duty_q15", next_.step.left_duty_q15, note.left_duty_q15);
  compare("right_duty_q15", next_.step.right_duty_q15, note.right_duty_q15);
  advance();
}

bool Rerun::contact_changes() const {
  return has_next_ && next_.kind == Kind::kContact && next_.argument >> 1 == reads_;
}

void Rerun::note_contact(bool open) {
  if (!contact_changes()) {
    ++reads_;
    return;
  }
  contact_ = (next_.argument & 1) != 0;
  compare("contact", contact_, open);
  advance();
}

bool Rerun::write_was_done() const {
  return !has_next_ || next_.kind != Kind::kStore || next_.argument != 0;
}

uint32_t Rerun::recorded_store_faults() const {
  return has_next_ && next_.kind == Kind::kStore ? next_.payload[0] : 0;
}

void Rerun::note_store(bool done, uint32_t faults) {
  if (!take(Kind::kStore)) return;
  compare("store.done", next_.argument != 0, done);
  compare("store.faults", next_.payload[0], faults);
  advance();
}

void Rerun::note_parameters(Parameters& parameters, ControlConfig& config,
                            uint32_t& contradictions) {
  if (!take(Kind::kParameters)) return;
  StateReader reader(next_.payload, next_.words);
  reader.read(parameters, config, contradictions);
  if (!reader.is_whole()) outcome_ = Outcome::kUnreadable;
  advance();
}

void Rerun::note_transition(SupervisorEvent event, SupervisorState before, SupervisorState after,
                            uint32_t faults) {
  if (!take(Kind::kTransition)) return;
  const uint32_t recorded = next_.argument;
  const auto was = [&](int shift) { return static_cast<double>(recorded >> shift & 15); };
  compare("transition.event", was(0), static_cast<double>(event));
  compare("transition.before", was(4), static_cast<double>(before));
  compare("transition.after", was(8), static_cast<double>(after));
  compare("transition.faults", next_.payload[0], faults);
  advance();
}

void Rerun::note_refusal(uint8_t message_id, RefusalCode code) {
  if (!take(Kind::kRefusal)) return;
  const uint32_t computed = message_id | static_cast<uint32_t>(code) << 8;
  compare("refusal", next_.payload[0], computed);
  advance();
}

}  // namespace wheelwire
