// What only the self-test image has: a core that fails when a host asks for it, and measurements at
// the chip's own pins. Nothing is driven before a host says that the motor supply is off, and then
// until the next reset.
#pragma once

#include <atomic>

#include "board_rules.hpp"
#include "clock.hpp"
#include "framing.hpp"
#include "pulse_watch.hpp"
#include "sdkconfig.h"
#include "self_test_protocol.hpp"
#include "shared_state.hpp"

namespace wheelwire {

/// One wheel's motor, off until the self-test is allowed, and while the self-test has its pins.
class GatedMotor final : public MotorPort {
 public:
  GatedMotor(MotorPort& motor, const std::atomic<bool>& is_allowed,
             const std::atomic<bool>& is_taken)
      : motor_(motor), is_allowed_(is_allowed), is_taken_(is_taken) {}

  void drive(int16_t duty_q15) override {
    if (may_drive()) return motor_.drive(duty_q15);
    coast();
  }
  void brake() override {
    if (may_drive()) return motor_.brake();
    coast();
  }
  void coast() override {
    if (!is_taken_) motor_.coast();
  }

 private:
  bool may_drive() const { return is_allowed_ && !is_taken_; }

  MotorPort& motor_;
  const std::atomic<bool>& is_allowed_;
  const std::atomic<bool>& is_taken_;
};

struct SelfTestAnswer {
  uint8_t id = 0;
  size_t size = 0;  ///< Of the body.
  uint8_t body[kMaxBody];
};

class SelfTest {
 public:
  SelfTest(const BoardDescription& board, MotorPort& left, MotorPort& right,
           const SharedState& state)
      : left_motor(left, is_allowed_, turns_),
        right_motor(right, is_allowed_, turns_),
        board_(board),
        state_(state) {}

  /// Creates a task on each core, which waits for what it is asked to do.
  void start();

  /// Answers a question. Called by the control task.
  SelfTestAnswer serve(const Frame& frame, uint32_t session_id, uint16_t request_id);

  /// What one of its tasks does next, if there is something to do.
  void work(int core);

 private:
  /// For the task of one core. Written before `is_due`.
  struct Order {
    SelfTestFail fail{};
    SelfTestTurn turn{};
    SelfTestWatch watch{};
    std::atomic<uint8_t> is_due{0};  ///< The id of the message that is to be carried out; 0: none.
  };

  std::atomic<bool> is_allowed_{false};
  std::atomic<bool> turns_{false};  ///< The pins of the power stage play an encoder.

 public:
  GatedMotor left_motor;
  GatedMotor right_motor;

 private:
  [[noreturn]] static void run(void* self);
  RefusalCode allow(const SelfTestAllow& request);
  RefusalCode fail(const SelfTestFail& request);
  RefusalCode turn(const SelfTestTurn& request);
  RefusalCode watch(const SelfTestWatch& request);
  SelfTestReport report();
  RefusalCode carry_out(const Frame& frame);
  void turn_encoder(const SelfTestTurn& request);

  const BoardDescription& board_;
  const SharedState& state_;
  Order orders_[CONFIG_FREERTOS_NUMBER_OF_CORES];
  PulseWatch pulses_;
};

}  // namespace wheelwire
