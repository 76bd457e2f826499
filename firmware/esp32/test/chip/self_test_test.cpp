// The self-test: what it answers, what it drives, what it does to a core. A whole device runs on
// its line, since the core must not notice it.
#include "self_test.hpp"

#include "esp_cpu.h"
#include "esp_rom_sys.h"
#include "fail_core.hpp"
#include "fake_line.hpp"
#include "freertos/task.h"
#include "self_test_line.hpp"
#include "stage_boards.hpp"
#include "wired_robot.hpp"

using namespace wheelwire;

namespace {

constexpr uint8_t kEnable = 25;
constexpr uint8_t kIn1 = 26;
constexpr uint8_t kA = 18;
constexpr uint8_t kB = 19;

/// What was done to a core.
std::vector<std::pair<int, Failure>> core_failures;

int any_body_size(uint8_t id) {
  const int size = body_size(id);
  return size < 0 ? self_test_body_size(id) : size;
}

/// A device with the self-test image, and its host.
class SelfTestWorld : public test::BenchHost {
 public:
  SelfTestWorld() : BenchHost(any_body_size) {
    fake_matrix = {};
    fake_capture = {};
    fake_time_us = 1'000'000;
    core_failures.clear();
    fake_sleep = [](TickType_t) {};
    device.start(now_us());
    greet();
    step();
  }
  ~SelfTestWorld() { fake_sleep = nullptr; }
  SelfTestWorld(const SelfTestWorld&) = delete;
  SelfTestWorld& operator=(const SelfTestWorld&) = delete;

  void service() final {
    device.service_link(now_us());
    collect();
  }
  void step() {
    fake_time_us += 1000;
    device.step(now_us());
    collect();
  }
  RefusalCode allow() { return refusal(SelfTestAllow{.permission = kSelfTestPermission}); }
  RefusalCode fail(Failure failure, uint8_t core) {
    return refusal(SelfTestFail{.failure = failure, .core = core});
  }
  void work() {
    for (const int core : {0, 1}) {
      fake_core = core;
      test.work(core);
    }
  }
  /// A setpoint of duties, and the steps in which it takes effect.
  void drive(int16_t left_q15, int16_t right_q15) {
    for (int i = 0; i < 50; ++i) {
      send(SetDuty{session_id(), ++command_seq_, now_us() + 100'000, left_q15, right_q15});
      step();
    }
  }

  BoardDescription board = test::board_of(Stage::kEnableIn1In2);
  test::BenchMotor left;
  test::BenchMotor right;
  SharedState state;
  test::FakeLine chip_line{line};
  SelfTest test{board, left, right, state};
  SelfTestLine self_test_line{chip_line, test};

 private:
  MemoryStore store_;
  MemoryLatches latches_;
  MemoryStore latch_store_;
  test::BenchEncoders encoders_;
  test::BenchContact contact_;
  test::BenchBattery battery_;
  uint32_t command_seq_ = 0;

 public:
  Device device{{test.left_motor, test.right_motor, encoders_, self_test_line, store_, latches_,
                 latch_store_, contact_, battery_},
                test::RobotBench::kIdentity};
};

/// The left encoder, with its inputs at the outputs of the left power stage.
class Loop {
 public:
  Loop() {
    fake_pcnt.clear();
    Parameters parameters;
    const auto filter_ns = static_cast<uint32_t>(parameters.get(ParameterId::kGlitchFilterNs));
    CHECK(encoders_.start(test::board_of(Stage::kEnableIn1In2), filter_ns));
    for (const int pin : {kEnable, kIn1}) gpio_set_level(pin, 0);
    read();
    start_ = total_.ticks();
    fake_on_set = [this](gpio_num_t pin) {
      if (pin == kEnable || pin == kIn1) show(pin == kEnable ? kA : kB, fake_matrix.levels[pin]);
    };
    fake_on_delay = [this](uint32_t us) { pass_ns(1000 * int64_t{us}); };
    fake_on_look = [this](uint32_t cycles) { pass_ns(1000 * int64_t{cycles} / 240); };
  }
  ~Loop() { fake_on_set = nullptr, fake_on_delay = nullptr, fake_on_look = nullptr; }
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  int32_t ticks() {
    pass_ns(100'000);
    read();
    return total_.ticks() - start_;
  }

 private:
  void show(int pin, bool level) {
    for (FakePcntUnit& unit : fake_pcnt) unit.set(pin, level, ns_);
    if (++edges_ % 100 == 0) read();
  }
  void pass_ns(int64_t ns) {
    ns_ += ns;
    fake_time_us = ns_ / 1000;
  }
  void read() { total_.update(encoders_.latch().left, false); }

  Encoders encoders_;
  TickTotal total_;
  int64_t ns_ = 1'000'000'000;
  int32_t start_ = 0;
  int edges_ = 0;
};

}  // namespace

namespace wheelwire {

void fail_core(Failure failure) { core_failures.emplace_back(fake_core, failure); }

}  // namespace wheelwire

TEST(an_ordinary_device_has_no_self_test) {
  test::RobotBench bench;
  bench.open();
  CHECK(bench.ask<GroupInfo>(GroupGet{.group = static_cast<Group>(kSelfTestGroup)})->hash == 0);
  CHECK(!bench.ask<Ack>(SelfTestAllow{.permission = kSelfTestPermission}));
  CHECK(bench.ask<LinkCounters>(LinkCountersGet{})->unknown_id == 1);
}

TEST(a_host_finds_the_self_test_by_its_group_and_the_others_as_they_were) {
  SelfTestWorld world;
  CHECK(world.ask<GroupInfo>(GroupGet{.group = static_cast<Group>(kSelfTestGroup)})->hash ==
        kSelfTestHash);
  CHECK(world.ask<GroupInfo>(GroupGet{.group = Group::kBase})->hash == schema::kHash);
  CHECK(world.ask<GroupInfo>(GroupGet{.group = Group::kPlatform})->hash == 0);
}

TEST(the_core_gets_every_byte_but_the_self_tests_frames) {
  SelfTestWorld world;
  auto& to_device = world.line.to_device;
  std::vector<uint8_t> passed, wanted;
  uint32_t random = 1;
  const auto read = [&] {
    uint8_t out[100];
    const size_t size = world.self_test_line.read(out, 1 + random % 90);
    passed.insert(passed.end(), out, out + size);
    return size != 0;
  };
  for (uint16_t i = 0; i < 2000; ++i) {
    random = random * 1'664'525 + 1'013'904'223;
    const size_t before = to_device.size();
    const uint32_t kind = random >> 29;
    if (kind <= 1) world.send(Ping{world.session_id(), i, random});
    // A line with nothing but noise on it, longer than any frame.
    for (uint32_t byte = 0; kind == 2 && byte < 200; ++byte)
      to_device.push_back(static_cast<uint8_t>(1 + (random + 77 * byte) % 255));
    if (kind == 4) world.send(GroupGet{world.session_id(), i, Group::kStore});
    // A delimiter ends what is in front of a frame of the self-test, and is passed on, as the one
    // before it.
    if (kind == 3 || kind > 4) to_device.push_back(0);
    wanted.insert(wanted.end(), to_device.begin() + static_cast<long>(before), to_device.end());
    if (kind > 4) {
      world.send(SelfTestAllow{world.session_id(), i, 0});
      wanted.push_back(0);
      while (read()) {
      }
      CHECK(world.line.to_host.size() > 0);
      world.line.to_host.clear();
    } else if (i % 3 == 0) {
      read();
    }
  }
  to_device.push_back(0);
  wanted.push_back(0);
  while (read()) {
  }
  CHECK(passed == wanted);
}

TEST(a_question_that_is_repeated_is_answered_again_and_carried_out_once) {
  SelfTestWorld world;
  world.allow();
  for (int i = 0; i < 3; ++i) {
    world.received.clear();
    world.send(SelfTestFail{world.session_id(), 77, Failure::kHang, 0, 0});
    world.service();
    CHECK(world.received.size() == 1 && world.received[0].first == Ack::kId);
    world.work();
  }
  CHECK(core_failures.size() == 1);
}

TEST(nothing_is_driven_before_the_user_has_said_that_the_supply_is_off) {
  SelfTestWorld world;
  world.drive(0, 0);
  world.drive(3000, -3000);
  CHECK(world.device.state() == SupervisorState::kDriving);
  CHECK(world.left.duty == 0 && world.right.duty == 0);
  world.test.right_motor.brake();
  CHECK(!world.right.brakes);
  CHECK(world.refusal(SelfTestAllow{.permission = 1}) == RefusalCode::kOutOfRange);
  CHECK(world.fail(Failure::kCrash, 0) == RefusalCode::kNotSupported);
  CHECK(world.refusal(SelfTestTurn{.pin_a = kEnable, .pin_b = kIn1, .edges = 4, .edge_us = 5}) ==
        RefusalCode::kNotSupported);
  CHECK(world.refusal(SelfTestWatch{.edge_pin = kA, .level_pin = kB}) ==
        RefusalCode::kNotSupported);
  CHECK(world.refusal(SelfTestLastGet{}) == RefusalCode::kNotSupported);
  world.work();
  CHECK(core_failures.empty());
  world.drive(3000, -3000);
  CHECK(world.left.duty == 0 && world.right.duty == 0);

  CHECK(world.allow() == RefusalCode::kNone);
  world.drive(3000, -3000);
  CHECK(world.left.duty == 3000 && world.right.duty == -3000);
  world.test.right_motor.brake();
  CHECK(world.right.brakes);
}

TEST(each_core_fails_as_it_is_asked_to_and_no_other) {
  for (const uint8_t core : {uint8_t{0}, uint8_t{1}}) {
    for (const Failure failure : {Failure::kCrash, Failure::kHang, Failure::kFreeze}) {
      SelfTestWorld world;
      CHECK(world.allow() == RefusalCode::kNone);
      CHECK(world.fail(failure, core) == RefusalCode::kNone);
      CHECK(core_failures.empty());  // The Ack first.
      world.work();
      CHECK(core_failures.size() == 1 && core_failures[0] == std::pair(int{core}, failure));
    }
  }
  SelfTestWorld world;
  world.allow();
  CHECK(world.fail(Failure::kCrash, 2) == RefusalCode::kOutOfRange);
  CHECK(world.fail(Failure::kNone, 0) == RefusalCode::kOutOfRange);
  CHECK(world.fail(static_cast<Failure>(4), 0) == RefusalCode::kOutOfRange);
}

TEST(after_the_reset_it_tells_what_failed_and_when) {
  {
    SelfTestWorld world;
    world.allow();
    world.fail(Failure::kFreeze, 1);
    fake_time_us = 5'000'000;
    world.work();
  }
  SelfTestWorld world;
  fake_sleep = [](TickType_t) { throw EndOfTask{}; };
  CHECK(fake_run([&] { world.test.start(); }));
  world.allow();
  const auto last = world.ask<SelfTestLast>(SelfTestLastGet{});
  CHECK(last->failure == Failure::kFreeze && last->core == 1 && last->failed_us == 5'000'000);
  // Once: the next reset is another one's.
  CHECK(fake_run([&] { world.test.start(); }));
  CHECK(world.ask<SelfTestLast>(SelfTestLastGet{})->failure == Failure::kNone);
}

TEST(it_plays_an_encoder_at_the_pins_of_the_power_stage_and_edges_in_spikes_count_once) {
  SelfTestWorld world;
  Loop loop;
  world.allow();
  for (const int32_t edges : {40'000, -80'000, 40'000}) {
    const int32_t before = loop.ticks();
    CHECK(world.refusal(
              SelfTestTurn{.pin_a = kEnable, .pin_b = kIn1, .edges = edges, .edge_us = 5}) ==
          RefusalCode::kNone);
    world.work();
    CHECK(std::abs(loop.ticks() - before) == std::abs(edges));
  }
  CHECK(loop.ticks() == 0);
  world.refusal(
      SelfTestTurn{.pin_a = kEnable, .pin_b = kIn1, .edges = 0, .edge_us = 5, .spikes = 100});
  world.work();
  CHECK(std::abs(loop.ticks()) == 100);
}

TEST(it_takes_no_pins_but_those_of_the_power_stage_and_not_while_it_drives) {
  SelfTestWorld world;
  world.allow();
  const SelfTestTurn turn{.pin_a = kEnable, .pin_b = kIn1, .edges = 4, .edge_us = 5};
  SelfTestTurn other_pin = turn, no_pin = turn, too_fast = turn;
  other_pin.pin_b = 1;
  no_pin.pin_a = 200;
  too_fast.edge_us = 3;
  for (const SelfTestTurn& wrong : {other_pin, no_pin, too_fast})
    CHECK(world.refusal(wrong) == RefusalCode::kOutOfRange);
  world.state.supervisor = SupervisorState::kDriving;
  CHECK(world.refusal(turn) == RefusalCode::kNotStopped);
}

TEST(nothing_drives_while_the_pins_play_an_encoder) {
  SelfTestWorld world;
  world.allow();
  world.refusal(SelfTestTurn{.pin_a = kEnable, .pin_b = kIn1, .edges = 4, .edge_us = 5});
  world.test.left_motor.drive(1000);
  CHECK(world.left.duty == 0);
  world.work();
  world.test.left_motor.drive(1000);
  CHECK(world.left.duty == 1000);
}

TEST(it_reports_the_pulses_at_an_encoders_input) {
  SelfTestWorld world;
  world.allow();
  CHECK(world.refusal(SelfTestWatch{.edge_pin = kEnable, .level_pin = kB}) ==
        RefusalCode::kOutOfRange);
  CHECK(world.ask<SelfTestReport>(SelfTestWatch{.edge_pin = kA, .level_pin = kB})->resolution_hz ==
        0);
  world.work();
  for (uint32_t at = 0; at < 3; ++at) {
    fake_capture.edge(kA, true, 4000 * at);
    fake_capture.edge(kA, false, 4000 * at + 100);
  }
  const auto report = world.ask<SelfTestReport>(SelfTestWatch{.edge_pin = kA, .level_pin = kB});
  CHECK(report->resolution_hz == 80'000'000 && report->rises == 3);
  CHECK(report->most_period == 4000 && report->most_high == 100 && report->turns == 0);
}
