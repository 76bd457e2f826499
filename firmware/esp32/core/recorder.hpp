// What a recorder learns of a running device: all inputs of the core and their results. It also
// reads its stored records for the host. Without a recorder, none of this is called.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "protocol.hpp"

namespace wheelwire {

class MessageServer;
class Parameters;
class Robot;
struct ControlConfig;

/// The inputs of a control step, and what the outputs were until it began.
struct StepNote {
  uint64_t now_us;
  uint64_t t_us;  ///< When the encoders were read.
  int16_t left_counter;
  int16_t right_counter;
  uint32_t left_illegal;
  uint32_t right_illegal;
  uint16_t battery_mv;
  int16_t left_duty_q15;
  int16_t right_duty_q15;

  bool operator==(const StepNote&) const = default;
};

/// Called from the control task, in the order in which things happen. What follows a step, a
/// message or the end of a connection happened because of it.
class Recorder {
 public:
  /// Whether it needs the device's state before anything else. Asked where a step or a message is
  /// about to be carried out.
  bool wants_state() const { return at_ > limit_; }
  virtual void note_state(MessageServer& server, Robot& robot) = 0;

  virtual void note_step(const StepNote& note) = 0;
  /// The messages of the step follow, then its outputs.
  virtual void note_message(uint8_t id, const uint8_t* body, size_t size, uint64_t now_us) = 0;
  /// From here on no message belongs to the step before.
  void note_pause() { in_step_ = false; }
  virtual void note_hang_up(uint64_t now_us) = 0;
  virtual void note_failure(uint32_t faults) = 0;
  /// Whether the emergency-stop contact stops the robot: it was looked at.
  virtual void note_contact(bool open) = 0;
  /// What the sensors forbid from the step on that follows, as flags of `reflex`.
  virtual void note_reflexes(uint8_t reflexes) = 0;
  /// The processor was held up, so a late step is not a fault.
  virtual void note_stall() = 0;
  /// Something was to be written to flash, or removed from it.
  virtual void note_store(bool done, uint32_t faults) = 0;
  /// These are active from now on. A re-run replaces them: a processor that rounds otherwise
  /// computes others.
  virtual void note_parameters(Parameters& parameters, ControlConfig& config,
                               uint32_t& contradictions) = 0;
  virtual void note_transition(SupervisorEvent event, SupervisorState before, SupervisorState after,
                               uint32_t faults) = 0;
  virtual void note_refusal(uint8_t message_id, RefusalCode code) = 0;

 protected:
  Recorder() = default;
  ~Recorder() = default;

  uint32_t at_ = 1;  // Where the next record goes, and the last place where a step may begin.
  uint32_t limit_ = 0;
  bool in_step_ = false;
};

/// What a recorder has stored. Asked from the control task, while nothing is driven; each call
/// takes a bounded time.
class BoxArchive {
 public:
  /// Fills in all but the ids of an answer to `BoxGet`; `value.age` is as asked.
  virtual void describe(BoxValue& value) const = 0;
  /// Reads at most `capacity` bytes from `offset` on; returns how many. 0: the box does not exist,
  /// or ends before this.
  virtual size_t read(uint32_t number, uint32_t offset, uint8_t* out, size_t capacity) = 0;
  /// Fills in all but the ids of an answer to `LedgerGet`.
  virtual void count(LedgerValue& value, uint64_t now_us) const = 0;

 protected:
  ~BoxArchive() = default;
};

}  // namespace wheelwire
