// A whole device on hardware made of variables, and a host that sends exactly what a test says.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "check.hpp"
#include "device.hpp"
#include "frames.hpp"
#include "memory_store.hpp"
#include "power_stage.hpp"

namespace wheelwire::test {

constexpr uint32_t kPeriod_us = 1000;  ///< Of the control loop, by default.
constexpr int32_t kNominal = 4096;     ///< The supply that the feed-forward was measured at.

/// Shows its duty.
struct BenchMotor final : MotorPort {
  void drive(int16_t duty_q15) override { duty = duty_q15, brakes = false; }
  void brake() override { duty = 0, brakes = true; }
  void coast() override { duty = 0, brakes = false; }
  int16_t duty = 0;
  bool brakes = false;
};

/// One half of a bridge. Records for how long EN was low when the inputs switched.
class BenchBridge final : public StagePort {
 public:
  explicit BenchBridge(const uint64_t& now_us) : now_us_(now_us) {}

  void set(const StageOutputs& outputs) override {
    for_each_input(outputs_, outputs, [this](StageInput input, uint16_t duty_q15) {
      if (input == StageInput::kEnable) {
        set_enable(duty_q15);
      } else {
        set_input(input, duty_q15 != 0);
      }
    });
    outputs_ = outputs;
  }

  bool brakes() const { return in1 == in2 && enable != 0; }
  bool coasts() const { return enable == 0; }
  /// EN's duty, with the direction's sign; braking and coasting are 0.
  int duty() const { return in1 == in2 ? 0 : in1 ? enable : -enable; }

  bool in1 = false;
  bool in2 = false;
  uint16_t enable = 0;
  bool switched_under_current = false;
  uint64_t shortest_pause_us = UINT64_MAX;

 private:
  void set_input(StageInput input, bool level) {
    bool& shown = input == StageInput::kIn1 ? in1 : in2;
    if (shown == level || (input != StageInput::kIn1 && input != StageInput::kIn2)) return;
    if (enable != 0) switched_under_current = true;
    const uint64_t low_us = now_us_ - low_since_us_;
    if (was_driven_ && low_us < shortest_pause_us) shortest_pause_us = low_us;
    shown = level;
  }
  void set_enable(uint16_t duty_q15) {
    if (enable != 0 && duty_q15 == 0) low_since_us_ = now_us_;
    was_driven_ |= duty_q15 != 0;
    enable = duty_q15;
  }

  const uint64_t& now_us_;
  StageOutputs outputs_;
  uint64_t low_since_us_ = 0;
  bool was_driven_ = false;
};

struct BenchEncoders final : EncoderPort {
  EncoderCounts counts{};
  EncoderCounts latch() override { return counts; }
};

struct BenchLine final : ByteStream {
  std::deque<uint8_t> to_device;
  std::vector<uint8_t> to_host;
  size_t room = SIZE_MAX;  ///< Bytes that it accepts before it is full.
  uint32_t rate = 0;

  size_t read(uint8_t* out, size_t capacity) override {
    size_t size = 0;
    for (; size < capacity && !to_device.empty(); ++size) {
      out[size] = to_device.front();
      to_device.pop_front();
    }
    return size;
  }
  bool write(const uint8_t* data, size_t size) override {
    if (size > room) return false;
    to_host.insert(to_host.end(), data, data + size);
    return true;
  }
  uint32_t bytes_per_second() const override { return rate; }
};

struct BenchContact final : EstopInput {
  bool open = false;
  bool is_open() override { return open; }
};

struct BenchBattery final : BatterySense {
  uint16_t measured_mv = 7400;
  uint16_t millivolts() override { return measured_mv; }
};

/// The host at the other end of a line: sends exactly what a test says, and keeps what it is sent.
class BenchHost {
 public:
  static constexpr uint32_t kNonce = 0x1234;
  static constexpr uint32_t kBootId = 0xab00;

  /// Of the last greeting.
  uint32_t session_id() const { return nonce_ ^ kBootId; }
  static Hello hello(uint32_t nonce) {
    return {.nonce = nonce, .protocol_version = schema::kVersion, .schema_hash = schema::kHash};
  }
  /// Asks for a session, and synchronises its clock if `pings`, before the device reads its line.
  void greet(uint32_t nonce = kNonce, bool pings = true) {
    nonce_ = nonce;
    send(hello(nonce));
    if (pings) send(Ping{session_id(), ++request_id, 0});
  }

  /// Puts a frame on the line, for when the device reads it.
  template <typename Message>
  void send(const Message& message) {
    const std::vector<uint8_t> frame = frame_of(message, seq_++);
    line.to_device.insert(line.to_device.end(), frame.begin(), frame.end());
  }
  /// Sends a request under the session's next id, lets the device read it, and returns the answer.
  template <typename Answer, typename Request>
  std::optional<Answer> ask(Request request) {
    request.session_id = session_id();
    request.request_id = ++request_id;
    send(request);
    service();
    for (const Answer& answer : of<Answer>()) {
      if (answers<Request>(answer, request_id)) return answer;
    }
    return std::nullopt;
  }
  /// Why a request is refused; kNone when it is not.
  template <typename Request>
  RefusalCode refusal(const Request& request) {
    const auto refused = ask<Refuse>(request);
    return refused ? refused->code : RefusalCode::kNone;
  }
  RefusalCode set(ParameterId id, float value) {
    return refusal(ParameterSet{.parameter = static_cast<uint8_t>(id), .value = value});
  }
  /// The device reads its line between two steps.
  virtual void service() = 0;

  template <typename Message>
  std::vector<Message> of() const {
    std::vector<Message> found;
    for (const auto& [id, body] : received) {
      if (id == Message::kId) found.push_back(Message::decode(body.data()));
    }
    return found;
  }

  BenchLine line;
  std::vector<std::pair<uint8_t, std::vector<uint8_t>>> received;
  uint16_t request_id = 0;

 protected:
  /// With the bodies' sizes by the messages' ids.
  explicit BenchHost(int (*sizes)(uint8_t) = body_size) : sizes_(sizes) {}
  ~BenchHost() = default;

  void collect() {
    Frame frame{};
    for (const uint8_t byte : line.to_host) {
      if (!decoder_.feed(byte, frame)) continue;
      const auto size = static_cast<size_t>(sizes_(frame.id));
      received.emplace_back(frame.id, std::vector<uint8_t>(frame.body, frame.body + size));
    }
    line.to_host.clear();
  }

 private:
  template <typename Request>
  static bool answers(const Refuse& refuse, uint16_t id) {
    return refuse.reference == id && refuse.message_id == Request::kId;
  }
  template <typename Request, typename Answer>
  static bool answers(const Answer& answer, uint16_t id) {
    return answer.request_id == id;
  }

  int (*sizes_)(uint8_t);
  FrameDecoder decoder_{sizes_};
  uint32_t nonce_ = kNonce;
  uint16_t seq_ = 0;
};

class RobotBench : public BenchHost {
 public:
  static constexpr uint64_t kPeriodUs = 1000;
  static constexpr Identity kIdentity{.boot_id = kBootId,
                                      .reset_reason = ResetReason::kPowerOn,
                                      .board = Chip::kSimulated,
                                      .board_id = 7,
                                      .capabilities = 0,
                                      .version_major = 0,
                                      .version_minor = 1,
                                      .version_patch = 0,
                                      .git_hash = 0};

  /// `start_us`: the device's clock at the start.
  explicit RobotBench(uint64_t start_us = 1'000'000) : now_us(start_us) {}
  /// With these in place of its own two stores.
  RobotBench(BlockStore& parameters, BlockStore& latched)
      : now_us(1'000'000), parameter_store_(parameters), latched_store_(latched) {}

  /// Powers up, opens a session, synchronises the clock, and arms the robot.
  RobotBench& open() {
    connect();
    arm();
    received.clear();
    return *this;
  }
  /// As `open`, but as a program does whose library reconnects by itself: nothing arms.
  RobotBench& connect() {
    start();
    greet();
    step();
    received.clear();
    return *this;
  }
  /// A zero setpoint, and a stop that leaves the windings open, before the next step.
  void arm() {
    send(velocity(0.0f, 0.0f));
    send(stop(StopMode::kCoast));
    service();
  }
  void start() {
    device.start(now_us);
    step();
  }

  /// Sets all of these, of which none is refused.
  void configure(std::initializer_list<std::pair<ParameterId, float>> values) {
    for (const auto& [id, value] : values) CHECK(set(id, value) == RefusalCode::kNone);
  }
  RefusalCode clear_fault() { return refusal(ClearFault{}); }
  RefusalCode clear_estop() { return refusal(ClearEstop{}); }

  SetWheelVelocity velocity(float left_mps, float right_mps, uint64_t ttl_us = 300'000) {
    return {session_id(), ++command_seq, now_us + ttl_us, left_mps, right_mps};
  }
  SetDuty duty(int16_t left_q15, int16_t right_q15, uint64_t ttl_us = 300'000) {
    return {session_id(), ++command_seq, now_us + ttl_us, left_q15, right_q15};
  }
  Stop stop(StopMode mode = StopMode::kConfigured) {
    return {session_id(), ++request_id, command_seq, mode};
  }
  /// Commands a velocity and runs for some steps.
  void drive(float left_mps, float right_mps, int steps = 20) {
    send(velocity(left_mps, right_mps));
    run(steps);
  }
  void drive_duty(int16_t left_q15, int16_t right_q15, int steps = 100) {
    send(duty(left_q15, right_q15));
    run(steps);
  }
  /// An e-stop of another program, and a step.
  void estop() {
    send(Estop{});
    step();
  }

  /// One control period, with a step at its end.
  void step(uint64_t elapsed_us = kPeriodUs) {
    now_us += elapsed_us;
    encoders.counts.t_us = now_us;
    device.step(now_us);
    collect();
  }
  void run(int steps) {
    for (int i = 0; i < steps; ++i) step();
  }
  void service() final {
    device.service_link(now_us);
    collect();
  }
  /// Steps, each of which finds that both wheels have turned by these ticks.
  void roll(int steps, int left_ticks = 1, int right_ticks = 1) {
    for (int i = 0; i < steps; ++i) {
      turn(left_ticks, right_ticks);
      step();
    }
  }
  /// Advances both counters.
  void turn(int left_ticks, int right_ticks) {
    encoders.counts.left = static_cast<int16_t>(encoders.counts.left + left_ticks);
    encoders.counts.right = static_cast<int16_t>(encoders.counts.right + right_ticks);
  }

  size_t count(EventCode code) const {
    size_t found = 0;
    for (const Event& event : of<Event>()) found += event.code == code;
    return found;
  }
  RefusalCode last_refusal() const {
    const auto refusals = of<Refuse>();
    return refusals.empty() ? RefusalCode::kNone : refusals.back().code;
  }
  /// The last one of the next steps, alone.
  WheelState newest_state() {
    received.clear();
    run(20);
    return of<WheelState>().back();
  }
  bool driven() const { return left.duty() != 0 || right.duty() != 0; }
  bool brakes() const { return left.brakes() && right.brakes(); }
  bool coasts() const { return left.coasts() && right.coasts(); }
  /// Nothing switched under current, and each change came after a period with EN low.
  bool switched_gently() const {
    return !left.switched_under_current && !right.switched_under_current &&
           left.shortest_pause_us >= kPeriodUs && right.shortest_pause_us >= kPeriodUs;
  }
  /// Before its start: what `other` keeps through a reset of the processor, or a cut of the power.
  RobotBench& survive_reset(const RobotBench& other) {
    latches.record = other.latches.record;
    return survive_power_cut(other);
  }
  RobotBench& survive_power_cut(const RobotBench& other) {
    latch_store.block = other.latch_store.block;
    return *this;
  }
  SupervisorState state() const { return device.state(); }

  uint64_t now_us;
  BenchBridge left{now_us};
  BenchBridge right{now_us};
  BenchEncoders encoders;
  MemoryStore store;
  MemoryLatches latches;
  MemoryStore latch_store;
  BenchContact contact;
  BenchBattery battery;
  PowerStage left_motor{left};
  PowerStage right_motor{right};

 private:
  BlockStore& parameter_store_ = store;
  BlockStore& latched_store_ = latch_store;

 public:
  Device device{{left_motor, right_motor, encoders, line, parameter_store_, latches, latched_store_,
                 contact, battery},
                kIdentity};
  uint32_t command_seq = 0;
};

/// One that is ready to drive.
struct OpenRobot : RobotBench {
  OpenRobot() { open(); }
};

/// One that drives forward.
struct DrivingRobot : RobotBench {
  DrivingRobot() { open().drive(0.2f, 0.2f); }
};

}  // namespace wheelwire::test
