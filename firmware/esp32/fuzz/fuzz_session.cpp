// The firmware under any messages and any course of events, on the simulated robot and judged by
// the explorer's rules. The input is a script, one instruction after the other, each an operation
// and its operands; numbers are little-endian:
//
//   00 n bytes...        n bytes onto the line, as they are
//   01 id body...        a good frame of the message, with the next seq
//   02 id body...        as 01, made plausible: Hello's version and hash are right, session_id is
//                        the open session's, an expiry counts from now and has 3 bytes, a trial's
//                        time-out is 0.25 to 16 s and its action one that there is
//   03 n                 n control steps
//   04                   the firmware reads the line between two steps
//   05 flags left right  from now on: flags 1 e-stop contact open, 2 line slow, 4 store failing;
//                        signed loads of both wheels, in 1/128 Nm
//   06                   the last frame again
//   07                   a power-on
//   08 us us             a control step that is so many microseconds late
//
// Anything else ends the script.
#include "require.hpp"
#include "run.hpp"

using namespace wheelwire;
using namespace wheelwire::explore;

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
constexpr double kBootUs = 1'000;
constexpr double kStartedUs = 5'000;
constexpr double kSlowBaud = 9'600;

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

class Course {
 public:
  explicit Course(Script script) : script_(script) {
    apply("boot_time"_op, kBootUs);
    apply("run"_op, kStartedUs);
  }

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
        return apply("run"_op, script_.next() * period_us());
      case Operation::kService:
        return apply("service"_op);
      case Operation::kWorld:
        return world();
      case Operation::kRepeat:
        send(last_frame_);
        return true;
      case Operation::kReset:
        seq_ = 0;
        return apply("reset"_op, static_cast<double>(ResetReason::kPowerOn)) &&
               apply("run"_op, kStartedUs);
      case Operation::kLateStep: {
        const double late_us = read<uint16_t>(script_.next(2), 0);
        return apply("late"_op, late_us) && apply("run"_op, late_us + period_us());
      }
    }
    return false;
  }

  /// False once nothing more can be judged.
  bool apply(Kind kind, double first = 0.0, double second = 0.0) {
    const bool goes_on = robot_.apply({.kind = kind, .values = {first, second}});
    if (const auto& finding = robot_.finding())
      std::fprintf(stderr, "%s: %s\n", code_of(finding->rule).c_str(), finding->text.c_str());
    REQUIRE(!robot_.finding());
    return goes_on;
  }

  double period_us() {
    return 1e6 / static_cast<double>(robot_.witness().value(ParameterId::kControlRateHz));
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

  void make_plausible(uint8_t id, std::vector<uint8_t>& body) {
    if (id == Hello::kId) {
      write(schema::kVersion, body, kHelloVersionAt);
      write(schema::kHash, body, kHelloVersionAt + sizeof schema::kVersion);
      return;
    }
    write(robot_.witness().session.id, body, kSessionAt);
    if (id == ParameterTrial::kId) {
      write(static_cast<uint8_t>(1 + body[kActionAt] % 4), body, kActionAt);
      write(static_cast<float>(1 + body[kTimeoutAt] % 64) / 4, body, kTimeoutAt);
    }
    if (id != SetWheelVelocity::kId && id != SetDuty::kId) return;
    const uint32_t life_us = read<uint32_t>(body, kExpiryAt) & kLongestLife_us;
    write(robot_.simulator().board.device_us() + life_us, body, kExpiryAt);
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

  bool world() {
    const uint8_t flags = script_.next();
    const double left_nm = static_cast<int8_t>(script_.next()) / 128.0;
    const double right_nm = static_cast<int8_t>(script_.next()) / 128.0;
    return apply("contact"_op, (flags & 1) != 0) &&
           apply("baud"_op, (flags & 2) != 0 ? kSlowBaud : 0.0) &&
           apply("store_fails"_op, 0, (flags & 4) != 0) && apply("load"_op, 0, left_nm) &&
           apply("load"_op, 1, right_nm);
  }

  void send(const std::vector<uint8_t>& bytes) {
    robot_.simulator().board.line.host_write(bytes.data(), bytes.size());
  }

  Script script_;
  explore::Run robot_{0};
  uint16_t seq_ = 0;
  std::vector<uint8_t> last_frame_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Course(Script(data, size)).to_its_end();
  return 0;
}
