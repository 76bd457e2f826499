// What a black box holds, and that a re-run of it computes the same.
#include "black_box.hpp"

#include <cstring>
#include <memory>
#include <random>

#include "core_hash.hpp"
#include "rerun.hpp"
#include "robot_bench.hpp"
#include "sensor_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;
using Outcome = Rerun::Outcome;
using box::Kind;

namespace {

const BoxOrigin kRecordedOrigin{
    .core = kCoreHash, .release = 0x000102, .git_hash = 7, .boot_id = 9};

/// A robot that is recorded.
struct RecordedRobot {
  std::vector<uint32_t> memory = std::vector<uint32_t>(box::kWords);
  BlackBox black_box{memory.data(), kRecordedOrigin};
  RobotBench bench;

  RecordedRobot() {
    bench.device.start(bench.now_us);
    bench.device.record(black_box);
    bench.step();
    bench.greet();
    bench.arm();
    bench.step();
  }

  std::vector<BoxEntry> entries() const {
    std::vector<BoxEntry> all;
    BoxReader reader(memory.data());
    BoxEntry entry;
    while (reader.next(entry)) all.push_back(entry);
    return all;
  }
  size_t count(Kind kind) const {
    size_t found = 0;
    for (const BoxEntry& entry : entries()) found += entry.kind == kind ? 1 : 0;
    return found;
  }
  Outcome rerun() const { return Rerun(memory.data()).run(); }
};

/// A step that drives as no core does.
StepNote odd_step(uint64_t now_us) {
  return {.now_us = now_us,
          .t_us = now_us,
          .left_counter = 0,
          .right_counter = 0,
          .left_illegal = 0,
          .right_illegal = 0,
          .battery_mv = 7400,
          .left_duty_q15 = 1,
          .right_duty_q15 = 2};
}

}  // namespace

TEST(a_drive_is_recorded_with_all_its_inputs_and_re_runs_the_same) {
  RecordedRobot robot;
  robot.bench.send(robot.bench.velocity(0.3f, 0.2f));
  for (int i = 0; i < 100; ++i) {
    robot.bench.turn(i % 3, -(i % 2));
    robot.bench.step(1000 + static_cast<uint64_t>(i % 7));
  }
  const auto entries = robot.entries();
  CHECK(!entries.empty() && entries.front().kind == Kind::kState);
  const BoxEntry& last = entries.back();
  CHECK(last.is_step() && last.step.now_us == robot.bench.now_us);
  CHECK(last.step.left_counter == robot.bench.encoders.counts.left);
  CHECK(last.step.right_counter == robot.bench.encoders.counts.right);
  CHECK(last.step.battery_mv == 7400);
  CHECK(robot.count(Kind::kMessage) == 5);
  Rerun rerun(robot.memory.data());
  CHECK(rerun.run() == Outcome::kSame);
  CHECK(rerun.steps() == 102 && rerun.last_us() == robot.bench.now_us);
}

/// A bumper, a drive back, a cliff; then a host's messages that write another list. A box that
/// begins in the middle has the list's state in its first record.
TEST(what_sensors_forbid_is_recorded_and_re_runs_the_same) {
  for (const bool begins_late : {false, true}) {
    SensorBench bench(
        list_of({bumper(Place::kFront),
                 Peripheral{.kind = PeripheralKind::kCliff, .place = Place::kFront, .pin_a = 39}}));
    std::vector<uint32_t> memory(box::kWords);
    BlackBox black_box(memory.data(), kRecordedOrigin);
    bench.device.start(bench.now_us);
    if (!begins_late) bench.device.record(black_box);
    bench.step();
    bench.greet();
    bench.arm();
    bench.step();
    bench.drive_on(0.2f, 0.2f, 60);
    bench.refusal(PeripheralSet{.channel = 1, .kind = PeripheralKind::kBumper});
    bench.set_level(0, true);
    bench.drive_on(0.2f, 0.2f, 5);
    if (begins_late) bench.device.record(black_box);
    bench.drive_on(0.2f, -0.2f, 5);
    bench.drive_on(-0.2f, -0.2f, 60);
    bench.set_level(0, false);
    bench.drive_on(0.2f, 0.2f, 90);
    bench.device.hang_up(bench.now_us);
    bench.run(5);
    CHECK(bench.refusal(ConfigurationWrite{.peripheral_count = 2, .fingerprint = 1}) !=
          RefusalCode::kNone);
    bench.send(RobotBench::hello(RobotBench::kNonce + 1));
    bench.step();
    Rerun rerun(memory.data());
    CHECK(rerun.run() == Outcome::kSame);
    if (!begins_late) CHECK(rerun.steps() > 200);
    bench.set_level(1, true);
    bench.run(3);
    size_t reflexes = 0;
    BoxReader reader(memory.data());
    BoxEntry entry;
    while (reader.next(entry)) reflexes += entry.kind == Kind::kReflexes ? 1 : 0;
    CHECK(reflexes >= 2);
    CHECK(Rerun(memory.data()).run() == Outcome::kSame);
  }
}

/// A part that the device had, and one that it did not have, are so in the re-run.
TEST(what_the_platform_answers_re_runs_the_same) {
  struct Memory final : PlatformMessages {
    void serve(MessageServer& server, const Frame&, uint16_t request_id) override {
      server.answer_afresh(request_id, MemoryValue{});
    }
  } memory;
  for (const bool has_platform : {false, true}) {
    RecordedRobot robot;
    if (has_platform) robot.bench.device.offer(memory);
    robot.black_box.clear();
    robot.bench.step();
    const RefusalCode refusal = robot.bench.refusal(MemoryGet{});
    CHECK((refusal == RefusalCode::kNone) == has_platform);
    robot.bench.step();
    CHECK(robot.rerun() == Outcome::kSame);
  }
}

TEST(what_does_not_fit_in_a_packed_step_is_recorded_in_full) {
  RecordedRobot robot;
  robot.bench.turn(3000, -3000);
  robot.bench.step(20'000);
  robot.bench.encoders.counts.left_illegal = 5;
  robot.bench.step();
  robot.bench.step();
  const auto entries = robot.entries();
  CHECK(entries.back().kind == Kind::kStep);
  CHECK(entries.back().step.left_illegal == 5 && entries.back().step.left_counter == 3000);
  CHECK(entries.back().step.now_us == robot.bench.now_us);
  CHECK(robot.count(Kind::kWideStep) == 3);
  CHECK(robot.rerun() == Outcome::kSame);
}

TEST(a_fault_and_an_estop_end_the_box_with_the_step_in_which_they_came) {
  for (const bool contact : {false, true}) {
    RecordedRobot robot;
    robot.bench.drive(0.2f, 0.2f);
    CHECK(robot.bench.driven() && !robot.black_box.is_closed());
    if (contact) {
      robot.bench.contact.open = true;
      robot.bench.step();
    } else {
      robot.bench.step(60'000);
    }
    CHECK(robot.black_box.is_triggered() && !robot.black_box.is_closed());
    robot.bench.step();
    CHECK(robot.black_box.is_closed());
    const auto whole = robot.memory;
    robot.bench.run(50);
    CHECK(robot.memory == whole);
    const auto entries = robot.entries();
    CHECK(entries.back().kind == Kind::kEnd);
    CHECK(entries.back().step.left_duty_q15 == 0);
    CHECK(entries.back().t_us == robot.bench.now_us - 50 * RobotBench::kPeriodUs);
    CHECK(robot.count(Kind::kContact) == (contact ? 1 : 0));
    CHECK(robot.rerun() == Outcome::kSame);
    robot.black_box.clear();
    CHECK(robot.rerun() == Outcome::kEmpty);
    robot.bench.run(5);
    CHECK(robot.count(Kind::kWideStep) == 1 && robot.rerun() == Outcome::kSame);
  }
}

TEST(a_message_between_two_steps_has_its_own_time) {
  RecordedRobot robot;
  robot.bench.now_us += 400;
  robot.bench.send(robot.bench.velocity(0.1f, 0.1f));
  robot.bench.service();
  robot.bench.step(600);
  const auto entries = robot.entries();
  const BoxEntry& message = entries[entries.size() - 3];
  CHECK(message.kind == Kind::kMessage && !message.in_step);
  CHECK(message.t_us == robot.bench.now_us - 600);
  CHECK(message.message_id == SetWheelVelocity::kId);
  CHECK(SetWheelVelocity::decode(message.body).left_mps == 0.1f);
  CHECK(entries[entries.size() - 2].kind == Kind::kTransition);
  CHECK(robot.rerun() == Outcome::kSame);
}

TEST(a_second_at_1_khz_with_100_setpoints_is_always_there) {
  RecordedRobot robot;
  uint64_t shortest_us = UINT64_MAX;
  for (int i = 0; i < 20'000; ++i) {
    if (i % 10 == 0) robot.bench.send(robot.bench.duty(3000, 3000));
    robot.bench.turn(i % 2, i % 2);
    robot.bench.step();
    if (i < 4000 || i % 50 != 0) continue;
    BoxReader reader(robot.memory.data());
    CHECK(reader.missing() == 0);
    BoxEntry entry;
    while (reader.next(entry) && !entry.is_step()) {
    }
    const uint64_t span_us = robot.bench.now_us - entry.t_us;
    if (span_us < shortest_us) shortest_us = span_us;
  }
  CHECK(robot.bench.driven());
  CHECK(shortest_us > 1'000'000);
  CHECK(robot.rerun() == Outcome::kSame);
}

TEST(a_flood_of_messages_stays_within_the_memory) {
  RecordedRobot robot;
  std::vector<uint32_t> guarded(box::kWords + 8, 0x5a5a5a5au);
  BlackBox black_box(guarded.data(), kRecordedOrigin);
  robot.bench.device.record(black_box);
  std::mt19937 random(1);
  for (int i = 0; i < 3000; ++i) {
    for (int n = 0; n < 30; ++n) {
      const auto action = random() % 2 == 0 ? TrialAction::kBegin : TrialAction::kRevert;
      robot.bench.send(
          ParameterTrial{robot.bench.session_id(), ++robot.bench.request_id, action, 1.0f});
    }
    robot.bench.step();
  }
  for (size_t i = box::kWords; i < guarded.size(); ++i) CHECK(guarded[i] == 0x5a5a5a5au);
  CHECK(Rerun(guarded.data()).run() == Outcome::kSame);
}

TEST(a_torn_last_record_is_dropped_and_the_rest_re_runs) {
  RecordedRobot robot;
  robot.bench.drive(0.2f, 0.2f, 50);
  const size_t whole = robot.entries().size();
  for (ptrdiff_t cut = 1; cut <= 3; ++cut) {  // the third word is before the payload
    // As a reset leaves it: some words of the newest record are there, the others are older.
    RecordedRobot torn;
    torn.memory = robot.memory;
    auto* const payload = const_cast<uint32_t*>(torn.entries().back().payload);
    payload[2 - cut] ^= 0x10;
    CHECK(torn.entries().size() == whole - 1);
    CHECK(torn.rerun() == Outcome::kSame);
  }
}

TEST(a_box_of_another_core_is_refused_or_only_what_the_robot_did_is_compared) {
  std::vector<uint32_t> memory(box::kWords);
  BlackBox other(memory.data(), {.core = kCoreHash + 1, .release = 0, .git_hash = 0, .boot_id = 0});
  RecordedRobot robot;
  robot.bench.device.record(other);
  robot.bench.drive(0.2f, 0.2f, 10);
  CHECK(Rerun(memory.data()).run() == Outcome::kOtherCore);
  const uint64_t now_us = robot.bench.now_us + 1000;
  other.note_pause();
  other.note_step(odd_step(now_us));
  Rerun other_duty(memory.data(), Rerun::Accept::kAnyCore);
  CHECK(other_duty.run() == Outcome::kSame);
  CHECK(other_duty.steps() > 10);
  other.note_transition(SupervisorEvent::kDeadline, SupervisorState::kDriving,
                        SupervisorState::kTimedOut, 0);
  Rerun other_act(memory.data(), Rerun::Accept::kAnyCore);
  CHECK(other_act.run() == Outcome::kDiffers);
  CHECK(other_act.difference().t_us == now_us);
}

TEST(a_difference_names_the_first_step_and_the_field) {
  // Another core would have driven otherwise in one step; so it is recorded.
  RecordedRobot changed;
  changed.bench.drive(0.2f, 0.2f, 10);
  BlackBox& box = changed.black_box;
  box.note_pause();
  box.note_step(odd_step(changed.bench.now_us + 1000));
  Rerun rerun(changed.memory.data());
  CHECK(rerun.run() == Outcome::kDiffers);
  CHECK(rerun.difference().step == 13 && rerun.difference().recorded == 1);
  CHECK(std::strcmp(rerun.difference().field, "left_duty_q15") == 0);
  CHECK(rerun.difference().t_us == changed.bench.now_us + 1000);
}

TEST(a_transition_that_the_re_run_does_not_make_is_a_difference) {
  RecordedRobot robot;
  robot.bench.drive(0.2f, 0.2f, 10);
  robot.black_box.note_transition(SupervisorEvent::kDeadline, SupervisorState::kDriving,
                                  SupervisorState::kTimedOut, 0);
  Rerun rerun(robot.memory.data());
  CHECK(rerun.run() == Outcome::kDiffers);
  CHECK(std::strcmp(rerun.difference().field, "record") == 0);
}

TEST(a_state_that_is_not_what_the_re_run_computes_names_its_field) {
  RecordedRobot robot;
  // A request is served behind the recorder's back.
  RecordedRobot other;
  robot.bench.device.record(other.black_box);
  CHECK(robot.bench.refusal(ParameterGet{.parameter = 255}) == RefusalCode::kUnknownParameter);
  robot.bench.device.record(robot.black_box);
  robot.bench.run(1000);
  Rerun rerun(robot.memory.data());
  CHECK(rerun.run() == Outcome::kDiffers);
  CHECK(std::strcmp(rerun.difference().field, "server.session.newest_request") == 0);
  CHECK(rerun.difference().recorded == 3 && rerun.difference().computed == 0);
}

TEST(what_a_reset_damaged_is_missing_with_all_before_it) {
  RecordedRobot robot;
  CHECK(BoxReader(robot.memory.data()).missing() == 0);  // Of a box that is not full yet, too.
  for (int i = 0; i < 5000; ++i) {
    robot.bench.turn(i % 2, i % 2);
    robot.bench.step();
  }
  // The newest one comes last in the order of their numbers.
  const size_t newest = (robot.black_box.segments() - 1) % box::kSegments;
  for (size_t age = 1; age < box::kSegments; ++age) {
    const size_t segment = (newest + box::kSegments - age) % box::kSegments;
    uint32_t& word = robot.memory[segment * box::kSegmentWords + 1000];
    word ^= 1;
    BoxReader reader(robot.memory.data());
    CHECK(reader.missing() == box::kSegments - age);
    BoxEntry entry;
    CHECK(reader.next(entry));
    word ^= 1;
  }
  CHECK(BoxReader(robot.memory.data()).missing() == 0);
}

TEST(damaged_boxes_are_read_without_harm) {
  RecordedRobot robot;
  for (int i = 0; i < 200; ++i) {
    if (i % 10 == 0) robot.bench.send(robot.bench.velocity(0.3f, 0.3f));
    robot.bench.step();
  }
  std::mt19937 random(7);
  for (int i = 0; i < 2000; ++i) {
    std::vector<uint32_t> damaged = robot.memory;
    for (auto n = random() % 4 + 1; n > 0; --n) damaged[random() % 900] ^= 1u << random() % 32;
    // A check finds what is damaged. What follows it is not read.
    const Outcome outcome = Rerun(damaged.data()).run();
    CHECK(outcome == Outcome::kSame || outcome == Outcome::kEmpty);
  }
}

TEST(two_hundred_random_runs_re_run_bit_by_bit) {
  for (uint32_t seed = 0; seed < draws(200u); ++seed) {
    std::mt19937 random(seed);
    const auto chance = [&](uint32_t one_in) { return random() % one_in == 0; };
    RecordedRobot robot;
    RobotBench& bench = robot.bench;
    const auto speed = [&] {
      return static_cast<float>(static_cast<int>(random() % 121) - 60) / 100;
    };
    int left = 0;
    int right = 0;
    for (int i = 0; i < 3000; ++i) {
      if (chance(15)) bench.send(bench.velocity(speed(), speed(), 20'000 + random() % 300'000));
      if (chance(90)) bench.send(bench.duty(static_cast<int16_t>(random()), -900));
      if (chance(400)) bench.send(bench.stop(static_cast<StopMode>(random() % 4)));
      if (chance(900)) bench.send(Estop{});
      if (chance(200)) (void)bench.clear_estop();
      if (chance(200)) (void)bench.clear_fault();
      if (chance(150)) {
        const auto id = static_cast<ParameterId>(random() % kParameterCount + 1);
        const ParameterSpec& spec = kParameters[static_cast<size_t>(id) - 1];
        (void)bench.set(id, chance(2) ? spec.maximum : spec.default_value);
      }
      if (chance(500))
        bench.send(ParameterTrial{bench.session_id(), ++bench.request_id,
                                  static_cast<TrialAction>(random() % 4), 0.3f});
      if (chance(700)) (void)bench.refusal(ParameterSave{});
      if (chance(1500)) (void)bench.refusal(ParameterReset{});
      if (chance(1000)) bench.send(RobotBench::hello(static_cast<uint32_t>(random())));
      if (chance(1200)) bench.device.hang_up(bench.now_us);
      if (chance(800)) bench.contact.open = !bench.contact.open;
      if (chance(2500)) bench.store.failing = !bench.store.failing;
      if (chance(20)) left = static_cast<int>(random() % 9) - 4;
      if (chance(20)) right = static_cast<int>(random() % 9) - 4;
      bench.turn(left, right);
      if (chance(3)) {
        bench.now_us += random() % 900;
        bench.service();
      }
      if (robot.black_box.is_closed() && chance(40)) robot.black_box.clear();
      bench.step(chance(500) ? 30'000 : bench.device.control_period_us());
      bench.received.clear();
      if (robot.black_box.is_closed() || i == 2999) {
        Rerun rerun(robot.memory.data());
        const Outcome outcome = rerun.run();
        CHECK(outcome == Outcome::kSame || outcome == Outcome::kEmpty);
        if (outcome != Outcome::kSame && outcome != Outcome::kEmpty)
          std::printf("seed %u, i %d: outcome %d, step %u, %s: recorded %g, computed %g\n", seed, i,
                      static_cast<int>(outcome), rerun.difference().step, rerun.difference().field,
                      rerun.difference().recorded, rerun.difference().computed);
        if (outcome == Outcome::kDiffers) return;
      }
    }
  }
}
