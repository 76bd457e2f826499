// What the core needs from the hardware. A test can inject a fault into any of these.
//
// Called from the control task only, never from an interrupt handler: a vtable in flash cannot be
// read while the cache is off.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "board_tables.hpp"

namespace wheelwire {

/// One wheel's power stage.
class MotorPort {
 public:
  virtual void drive(int16_t duty_q15) = 0;  ///< -32767..32767, forward positive.
  virtual void brake() = 0;                  ///< Windings shorted.
  virtual void coast() = 0;                  ///< Outputs off; safe at any time.

 protected:
  ~MotorPort() = default;  // Owned by main(), never deleted through the interface.
};

/// An input of a power stage that is always high.
constexpr uint16_t kHigh_q15 = INT16_MAX;

/// The duty of the PWM on each input of a power stage, by StageInput: 0 is low, kHigh_q15 is high.
/// Inputs that the stage does not have are 0.
struct StageOutputs {
  uint16_t duty_q15[kStageInputs]{};

  constexpr uint16_t operator[](StageInput input) const {
    return duty_q15[static_cast<size_t>(input)];
  }
  bool operator==(const StageOutputs&) const = default;
};

/// The pins of one wheel's power stage. All are low at first.
class StagePort {
 public:
  /// Called in each control period, changed or not; see for_each_input().
  virtual void set(const StageOutputs& outputs) = 0;

 protected:
  ~StagePort() = default;
};

/// Calls `set(input, duty_q15)` for each input in an order that is safe on every stage: what falls
/// goes first, then the others, with directions before enables. Unchanged ones are set again: an
/// interrupt may have pulled them low.
template <typename Set>
void for_each_input(const StageOutputs& from, const StageOutputs& to, Set set) {
  for (size_t i = 0; i < kStageInputs; ++i)
    if (to.duty_q15[i] < from.duty_q15[i]) set(static_cast<StageInput>(i), to.duty_q15[i]);
  for (size_t i = kStageInputs; i-- > 0;)
    if (to.duty_q15[i] >= from.duty_q15[i]) set(static_cast<StageInput>(i), to.duty_q15[i]);
}

/// The chip's counters stay within -32766..32766: at +-32767 they return to 0.
constexpr int32_t kCounterLimit = 32767;

/// Both quadrature counters at one instant: by the pins from an EncoderPort, by the wheels once
/// `encoders_swapped` is taken into account.
struct EncoderCounts {
  uint64_t t_us;  ///< Device clock at the latch.
  int16_t left;   ///< Raw counter, x4, modulo kCounterLimit.
  int16_t right;
  uint32_t left_illegal = 0;  ///< Transitions that imply a lost edge; 0 if not detectable.
  uint32_t right_illegal = 0;

  EncoderCounts exchanged() const { return {t_us, right, left, right_illegal, left_illegal}; }
};

class EncoderPort {
 public:
  virtual EncoderCounts latch() = 0;

 protected:
  ~EncoderPort() = default;
};

/// The line to the host.
class ByteStream {
 public:
  /// Does not block. Returns how many bytes were read, 0 when none are waiting.
  virtual size_t read(uint8_t* out, size_t capacity) = 0;
  /// Does not block. Takes all of the bytes; or none, and returns false, when there is no room.
  virtual bool write(const uint8_t* data, size_t size) = 0;
  /// What the line carries; 0: more than the core can send.
  virtual uint32_t bytes_per_second() const = 0;

 protected:
  ~ByteStream() = default;
};

/// Keeps one block of bytes across resets. A save is atomic: the old block or the new one.
class BlockStore {
 public:
  /// Returns the size of the block, 0 when there is none; at most `capacity` bytes are copied.
  virtual size_t load(uint8_t* out, size_t capacity) = 0;
  virtual bool save(const uint8_t* data, size_t size) = 0;
  /// Formats storage that cannot be opened, with all that lies in it. False if it still cannot be
  /// opened.
  virtual bool format() { return true; }
  /// Why the stored block cannot be read, as flags of `fault`; 0 if it can, or if there is none. A
  /// save clears it.
  virtual uint32_t faults() { return 0; }
  /// Whether half of the storage had lost the block, which was loaded from the other half.
  virtual bool has_lost_copy() { return false; }
  /// Whether something is to be repaired.
  virtual bool is_incomplete() { return false; }
  /// Writes what is lost. It may stall the processor: only while the wheels stand.
  virtual bool repair() { return true; }

 protected:
  ~BlockStore() = default;
};

/// A few bytes that survive a reset of the processor, and may be lost with the power.
class LatchMemory {
 public:
  /// Returns the size of what was saved; 0 when nothing is known, as after a power-on. At most
  /// `capacity` bytes are copied.
  virtual size_t load(uint8_t* out, size_t capacity) = 0;
  /// Also called while driving: it must not block.
  virtual void save(const uint8_t* data, size_t size) = 0;

 protected:
  ~LatchMemory() = default;
};

/// The emergency-stop contact, normally closed.
class EstopInput {
 public:
  virtual bool is_open() = 0;

 protected:
  ~EstopInput() = default;
};

class BatterySense {
 public:
  virtual uint16_t millivolts() = 0;  ///< 0: not measured.

 protected:
  ~BatterySense() = default;
};

/// All that a device drives and listens to. Owned by the caller, outlives the device.
struct Hal {
  MotorPort& left_motor;
  MotorPort& right_motor;
  EncoderPort& encoders;
  ByteStream& line;
  BlockStore& store;
  LatchMemory& latches;
  BlockStore& latch_store;  ///< For a latched e-stop.
  EstopInput& estop;
  BatterySense& battery;
  BlockStore* configuration = nullptr;  ///< nullptr: it is not stored.
};

}  // namespace wheelwire
