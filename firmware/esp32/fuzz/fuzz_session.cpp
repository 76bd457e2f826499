// The firmware under any messages and any course of events. The input is a script, one
// instruction after the other, each an operation and its operands; numbers are little-endian:
//
//   00 n bytes...        n bytes onto the line, as they are
//   01 id body...        a good frame of the message, with the next seq
//   02 id body...        as 01, made plausible: Hello's version and hash are right, session_id is
//                        the open session's, an expiry counts from now and has 3 bytes, a trial's
//                        time-out is 0.25 to 16 s and its action one that there is
//   03 n                 n control steps
//   04                   the firmware reads the line between two steps
//   05 flags left right  from now on: flags 1 e-stop contact open, 2 line full, 4 store failing;
//                        signed ticks per step of each wheel
//   06                   the last frame again
//   07                   a reset of the device
//   08 us us             a control step that comes after so many microseconds
//
// Anything else ends the script.
#include <memory>

#include "fuzzed_robot.hpp"

using namespace wheelwire;
using namespace wheelwire::fuzz;

namespace {

enum class Operation : uint8_t {
  kBytes,
  kMessage,
  kPlausible,
  kSteps,
  kService,
  kWorld,
  kRepeat,
  kReset,
  kLateStep,
};

/// Fields of fixed places in messages from the host.
constexpr size_t kHelloVersionAt = 4;
constexpr size_t kSessionAt = 0;
constexpr size_t kExpiryAt = 8;
constexpr size_t kActionAt = 6;
constexpr size_t kTimeoutAt = 7;

constexpr uint32_t kLongestLife_us = 0xffffff;

class Script {
 public:
  Script(const uint8_t* data, size_t size) : data_(data), left_(size) {}

  bool ended() const { return left_ == 0; }

  uint8_t next() {
    if (left_ == 0) return 0;
    --left_;
    return *data_++;
  }

  std::vector<uint8_t> next(size_t size) {
    std::vector<uint8_t> bytes(size);
    for (uint8_t& byte : bytes) byte = next();
    return bytes;
  }

 private:
  const uint8_t* data_;
  size_t left_;
};

class Run {
 public:
  explicit Run(Script script) : script_(script) { reset(); }

  void to_its_end() {
    while (!script_.ended() && obey(static_cast<Operation>(script_.next()))) {
    }
  }

 private:
  bool obey(Operation operation) {
    switch (operation) {
      case Operation::kBytes:
        send(script_.next(script_.next()));
        return true;
      case Operation::kMessage:
      case Operation::kPlausible:
        return message(operation == Operation::kPlausible);
      case Operation::kSteps:
        for (int steps = script_.next(); steps > 0; --steps) robot_->step();
        return true;
      case Operation::kService:
        robot_->service_link();
        return true;
      case Operation::kWorld:
        world();
        return true;
      case Operation::kRepeat:
        send(last_frame_);
        return true;
      case Operation::kReset:
        reset();
        return true;
      case Operation::kLateStep:
        robot_->step_after(read<uint16_t>(script_.next(2), 0));
        return true;
    }
    return false;
  }

  void reset() {
    robot_ = std::make_unique<FuzzedRobot>(++boot_id_, store_);
    seq_ = 0;
  }

  bool message(bool plausible) {
    const uint8_t id = script_.next();
    const int size = body_size(id);
    if (size < 0) return false;
    std::vector<uint8_t> body = script_.next(static_cast<size_t>(size));
    if (plausible) make_plausible(id, body);
    last_frame_.resize(kMaxFrame);
    last_frame_.resize(encode_frame(id, seq_++, body.data(), body.size(), last_frame_.data()));
    send(last_frame_);
    return true;
  }

  void make_plausible(uint8_t id, std::vector<uint8_t>& body) const {
    if (id == Hello::kId) {
      write(schema::kVersion, body, kHelloVersionAt);
      write(schema::kHash, body, kHelloVersionAt + sizeof schema::kVersion);
      return;
    }
    write(robot_->session_id(), body, kSessionAt);
    if (id == ParameterTrial::kId) {
      write(static_cast<uint8_t>(1 + body[kActionAt] % 4), body, kActionAt);
      write(static_cast<float>(1 + body[kTimeoutAt] % 64) / 4, body, kTimeoutAt);
    }
    if (id != SetWheelVelocity::kId && id != SetDuty::kId) return;
    const uint32_t life_us = read<uint32_t>(body, kExpiryAt) & kLongestLife_us;
    write(robot_->now_us() + life_us, body, kExpiryAt);
  }

  template <typename T>
  static T read(const std::vector<uint8_t>& bytes, size_t at) {
    const uint8_t* in = bytes.data() + at;
    T value;
    wire::get(in, value);
    return value;
  }

  template <typename T>
  static void write(T value, std::vector<uint8_t>& body, size_t at) {
    uint8_t* out = body.data() + at;
    wire::put(out, value);
  }

  void world() {
    const uint8_t flags = script_.next();
    robot_->estop().open = (flags & 1) != 0;
    robot_->line().full = (flags & 2) != 0;
    store_.failing = (flags & 4) != 0;
    robot_->encoders().left_ticks = static_cast<int8_t>(script_.next());
    robot_->encoders().right_ticks = static_cast<int8_t>(script_.next());
  }

  void send(const std::vector<uint8_t>& bytes) {
    robot_->line().arrive(bytes.data(), bytes.size());
  }

  Script script_;
  MemoryStore store_;  // Survives a reset of the device.
  std::unique_ptr<FuzzedRobot> robot_;
  uint32_t boot_id_ = 0;
  uint16_t seq_ = 0;
  std::vector<uint8_t> last_frame_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Run(Script(data, size)).to_its_end();
  return 0;
}
