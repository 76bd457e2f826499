// Drives the whole firmware for four seconds and prints its instruction counts as JSON.
//
// The bench's own HAL is counted, too; it only copies bytes and numbers. With WHEELWIRE_RECORDED
// the black box records the run.
#include <stdio.h>

#include "bench_hal.hpp"
#include "counter.hpp"
#include "device.hpp"
#include "power_stage.hpp"
#ifdef WHEELWIRE_RECORDED
#include "black_box.hpp"
#endif

using namespace wheelwire;
using namespace wheelwire::rv32;

namespace {

constexpr uint32_t kNonce = 0x5eed0001;
constexpr uint32_t kBootId = 0xb0070001;
constexpr uint32_t kSessionId = kNonce ^ kBootId;

constexpr uint32_t kSteps = 4000;
constexpr uint32_t kTtl_us = 300'000;
// Setpoints come every 17 steps, state goes every 10: each with and without the other.
constexpr uint32_t kSetpointInterval = 17;

/// Straight, curves, on the spot, reversals: the slew limit is active most of the time.
constexpr float kTargets_mps[][2] = {{0.4f, 0.4f},   {0.15f, 0.3f},   {-0.4f, -0.4f}, {0.2f, -0.2f},
                                     {0.02f, 0.02f}, {-0.37f, 0.11f}, {0.5f, 0.3f},   {0.0f, 0.0f}};
constexpr uint32_t kTargetCount = sizeof kTargets_mps / sizeof kTargets_mps[0];

struct Bench {
  BenchWheel left;
  BenchWheel right;
  PowerStage left_motor{left};
  PowerStage right_motor{right};
  BenchEncoders encoders{left, right};
  BenchLine line;
  NoStore store;
  NoLatches latches;
  NoStore latch_store;
  ReleasedEstop estop;
  BenchBattery battery;
  Device device{
      {left_motor, right_motor, encoders, line, store, latches, latch_store, estop, battery},
      {.boot_id = kBootId,
       .reset_reason = ResetReason::kPowerOn,
       .board = Chip::kEsp32c6,
       .board_id = 0x0123456789ab,
       .capabilities = capability::kBattery | capability::kEstopInput,
       .version_major = 0,
       .version_minor = 1,
       .version_patch = 0,
       .git_hash = 0}};
#ifdef WHEELWIRE_RECORDED
  uint32_t box_memory[box::kWords];
  BlackBox black_box{box_memory, {}};
  uint32_t segments() const { return black_box.segments(); }
#else
  static uint32_t segments() { return 0; }
#endif
  uint64_t now_us = 0;

  /// Advances the world by a period, then runs a control step. Returns the step's count.
  uint32_t step() {
    now_us += device.control_period_us();
    left.turn();
    right.turn();
    encoders.sample(now_us);
    return instructions([this] { device.step(now_us); });
  }

  void connect() {
    device.start(now_us);
#ifdef WHEELWIRE_RECORDED
    device.record(black_box);
#endif
    line.arrive(Hello{kNonce, schema::kVersion, schema::kHash});
    step();
    line.arrive(Ping{kSessionId, 1, now_us});
    step();
    line.arrive(SetWheelVelocity{kSessionId, 1, now_us + kTtl_us, 0.0f, 0.0f});
    step();
  }
};

SetWheelVelocity setpoint(uint32_t step, uint64_t now_us) {
  const auto& target = kTargets_mps[step * kTargetCount / kSteps];
  return {kSessionId, step + 2, now_us + kTtl_us, target[0], target[1]};
}

/// The link alone, with the run's own messages.
class LinkBench {
 public:
  uint32_t receive(const SetWheelVelocity& sent) {
    line_.arrive(sent);
    SetWheelVelocity received;
    return instructions([&] {
      link_.renew_read_budget();
      Frame frame;
      if (link_.receive(frame)) received = SetWheelVelocity::decode(frame.body);
      asm volatile("" : : "m"(received));  // Or the compiler drops the unused result.
    });
  }

  uint32_t send(const WheelState& state) {
    return instructions([&] { link_.send(state); });
  }

 private:
  BenchLine line_;
  Link link_{line_};
};

/// Kinds of work. A step with both a setpoint and a state is the sum of the first ones.
enum Work : size_t {
  kStep,
  kSetpoint,
  kState,
  kBoth,
  kSegment,  ///< The step begins a segment, whatever else it does.
  kHold,     ///< It says what holds the robot, each second and at a change.
  kReceive,
  kSend,
  kWorks
};
constexpr const char* kNames[] = {"step",
                                  "step_with_setpoint",
                                  "step_with_state",
                                  "step_with_both",
                                  "step_with_segment",
                                  "step_with_hold",
                                  "receive_setpoint",
                                  "send_state"};

Bench bench;
LinkBench link_bench;
Counts counted[kWorks];

/// False if the robot stopped driving.
bool run() {
  bench.connect();
  for (uint32_t i = 0; i < kSteps; ++i) {
    const bool commanded = i % kSetpointInterval == 0;
    if (commanded) {
      const SetWheelVelocity message = setpoint(i, bench.now_us);
      bench.line.arrive(message);
      counted[kReceive].add(link_bench.receive(message));
    }
    const uint32_t segments = bench.segments();
    const uint32_t count = bench.step();
    const bool begins_segment = bench.segments() != segments;
    WheelState state;
    Frame frame{};
    const bool tells = bench.line.newest(frame) && frame.id == Hold::kId;
    const bool streamed = bench.line.take(state);
    if (streamed) counted[kSend].add(link_bench.send(state));
    if (bench.device.state() != SupervisorState::kDriving) return false;
    const size_t usual = (commanded ? kSetpoint : kStep) + (streamed ? kState : kStep);
    counted[begins_segment ? kSegment : tells ? kHold : usual].add(count);
  }
  return true;
}

}  // namespace

int main() {
  if (!run()) {
    printf("the robot did not drive\n");
    return 1;
  }
  printf("{\n");
  for (size_t work = 0; work < kWorks; ++work)
    if (Counts& counts = counted[work]; counts.size() != 0)
      printf(" \"%s\": {\"runs\": %lu, \"median\": %lu, \"max\": %lu},\n", kNames[work],
             static_cast<unsigned long>(counts.size()), static_cast<unsigned long>(counts.median()),
             static_cast<unsigned long>(counts.max()));
  printf(" \"device_bytes\": %lu\n}\n",
         static_cast<unsigned long>(sizeof(Device) + 2 * sizeof(PowerStage)));
  return 0;
}
