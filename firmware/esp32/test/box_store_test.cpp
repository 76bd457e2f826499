// Black boxes and counts in flash: what is there after a cut of the power, how much stays, when
// anything is written, and what a host reads of it.
#include "box_store.hpp"

#include <array>
#include <map>

#include "core_hash.hpp"
#include "cut_flash.hpp"
#include "recorder_keeper.hpp"
#include "rerun.hpp"
#include "robot_bench.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

const BoxOrigin kOrigin{.core = kCoreHash, .release = 1, .git_hash = 2, .boot_id = 3};

std::vector<uint32_t> memory_of(uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<uint32_t> memory(box::kWords);
  for (uint32_t& word : memory) word = static_cast<uint32_t>(random());
  return memory;
}

/// Stores a box; false if the power went.
bool store(BoxStore& boxes, CutFlash& flash, uint32_t seed, BoxCause cause = BoxCause::kFault) {
  const auto memory = memory_of(seed);
  boxes.begin({.cause = cause, .faults = seed}, memory.data());
  for (int i = 0; i < 300 && !flash.is_off(); ++i) boxes.work();
  return !flash.is_off();
}

/// A box in flash as its re-run takes it.
std::vector<uint32_t> memory_in(BoxStore& boxes, uint32_t number) {
  std::vector<uint32_t> image(kBoxImageWords);
  CHECK(boxes.read(number, 0, reinterpret_cast<uint8_t*>(image.data()), kBoxImageSize));
  return {image.begin() + BoxHead::kWords, image.end()};
}

using Images = std::map<uint32_t, std::vector<uint8_t>>;

/// All boxes by their numbers.
Images images(BoxStore& boxes) {
  Images all;
  for (size_t age = 0; const BoxHead* const head = boxes.head(age); ++age) {
    std::vector<uint8_t> image(kBoxImageSize);
    CHECK(boxes.read(head->number, 0, image.data(), image.size()));
    CHECK(box_check(memory_in(boxes, head->number).data()) == head->check);
    all[head->number] = image;
  }
  return all;
}

/// A device with its recorder, at rest since long.
struct RobotWithBoxes {
  RecorderMemory memory{};
  CutFlash flash{RecorderKeeper::kFlashSize};
  RobotBench bench;
  explicit RobotWithBoxes(uint64_t start_us = 20'000'000) : bench(start_us) {}
  std::optional<RecorderKeeper> keeper;

  void start(ResetReason reason = ResetReason::kPowerOn) {
    keeper.emplace(memory, flash, kOrigin, reason, 0x77);
    keeper->start();
    bench.device.start(bench.now_us);
    bench.device.record(keeper->black_box());
    bench.device.offer(*keeper);
    run(1);
    bench.greet();
    bench.arm();
    run(1);
  }
  void run(int steps) {
    for (int i = 0; i < steps; ++i) {
      bench.step();
      keeper->step(bench.device, bench.now_us);
    }
  }
  /// The box as a host reads it, part by part; empty if it is not there to its end.
  std::vector<uint8_t> read(uint32_t number) {
    std::vector<uint8_t> image;
    while (image.size() < kBoxImageSize) {
      const auto part = bench.ask<BoxPart>(
          BoxRead{.number = number, .offset = static_cast<uint32_t>(image.size())});
      bench.received.clear();
      if (!part || part->size == 0) return {};
      image.insert(image.end(), part->data, part->data + part->size);
    }
    return image;
  }
  void estop_and_clear(int steps) {
    bench.send(Estop{});
    run(steps);
    (void)bench.clear_estop();
    run(10);
  }
};

/// One that has stood since its start for so long that its recorder may write.
struct RestingRobot : RobotWithBoxes {
  RestingRobot() {
    start();
    run(3000);
  }
};

/// The boxes that a start finds.
struct StartedBoxes : BoxStore {
  explicit StartedBoxes(CutFlash& flash) : BoxStore(flash) { start(); }
};

/// Flash in which so many boxes were stored.
CutFlash flash_with(uint32_t stored) {
  CutFlash flash(BoxStore::kSize);
  StartedBoxes boxes(flash);
  for (uint32_t i = 0; i < stored; ++i) store(boxes, flash, i);
  return flash;
}

uint32_t stops(const LedgerCounts& counts, SupervisorEvent event) {
  return counts.stops[static_cast<size_t>(event)];
}
uint32_t resets(const LedgerCounts& counts, ResetReason reason) {
  return counts.resets[static_cast<size_t>(reason)];
}
uint32_t deadlines(const LedgerCounts& counts) { return stops(counts, SupervisorEvent::kDeadline); }

using LedgerMemory = std::array<uint8_t, Ledger::kMemorySize>;

struct StartedLedger : Ledger {
  StartedLedger(CutFlash& flash, LedgerMemory& memory, ResetReason reason = ResetReason::kPowerOn)
      : Ledger(flash, BoxStore::kSize, memory.data()) {
    start(reason);
  }
  void count_deadline() { count(SupervisorEvent::kDeadline, SupervisorState::kDriving); }
};

/// What a ledger knows that starts now, in a copy of this memory.
LedgerCounts counts_after(ResetReason reason, CutFlash& flash, LedgerMemory memory = {}) {
  return StartedLedger(flash, memory, reason).counts(0);
}

/// The boxes are the old ones, and perhaps the new one, which may have replaced an old one. Each is
/// whole.
void check_old_or_new(const Images& old, BoxStore& boxes, uint32_t number, uint32_t faults) {
  const Images found = images(boxes);
  CHECK(found.size() + 1 >= old.size() && found.size() <= old.size() + 1);
  for (const auto& [found_number, image] : found) {
    const auto same = old.find(found_number);
    if (same != old.end()) {
      CHECK(same->second == image);
    } else {
      CHECK(found_number == number && boxes.head(0)->faults == faults);
    }
  }
  // No old box was erased for a missing new one, except a ninth: its slot is that of the next box.
  CHECK(found.contains(number) || found.size() >= std::min(old.size(), BoxStore::kSlots - 1));
}

constexpr CutFlash::Cut kCuts[] = {CutFlash::Cut::kBefore, CutFlash::Cut::kInside,
                                   CutFlash::Cut::kAfter};

}  // namespace

TEST(a_box_is_found_again_with_its_head) {
  CutFlash flash(BoxStore::kSize);
  StartedBoxes first(flash);
  CHECK(first.count() == 0 && first.head(0) == nullptr);
  CHECK(store(first, flash, 11, BoxCause::kEstop));
  StartedBoxes second(flash);
  CHECK(second.count() == 1 && second.head(0)->number == 1 && second.head(0)->faults == 11);
  CHECK(second.head(0)->cause == BoxCause::kEstop && images(second).size() == 1);
  uint8_t byte;
  CHECK(!second.read(2, 0, &byte, 1));
  CHECK(!second.read(1, kBoxImageSize, &byte, 1) && !second.read(1, UINT32_MAX, &byte, 1));
}

TEST(eight_boxes_stay_and_the_next_slot_is_erased_in_advance) {
  CutFlash flash(BoxStore::kSize);
  StartedBoxes boxes(flash);
  for (uint32_t i = 1; i <= 20; i += 2) {
    CHECK(store(boxes, flash, i));
    CHECK(boxes.count() == (i < 8 ? i : 8));
    CHECK(boxes.head(0)->number == i);
    const size_t before = flash.erasures;
    const auto memory = memory_of(i);
    boxes.begin({}, memory.data());
    CHECK(boxes.work() && flash.erasures == before);
    boxes.start();  // As after a reset.
    CHECK(store(boxes, flash, i + 100) && boxes.head(0)->faults == i + 100);
  }
}

TEST(the_only_box_of_a_cause_outlasts_many_of_another) {
  CutFlash flash(BoxStore::kSize);
  StartedBoxes boxes(flash);
  CHECK(store(boxes, flash, 1, BoxCause::kReset));
  for (uint32_t i = 2; i < 30; ++i) CHECK(store(boxes, flash, i, BoxCause::kEstop));
  CHECK(boxes.head(7)->number == 1 && boxes.head(7)->cause == BoxCause::kReset);
  CHECK(boxes.head(6)->number == 23);
}

TEST(a_cut_at_any_operation_leaves_the_old_boxes_or_these_and_the_new_one) {
  for (const uint32_t stored : {0u, 3u, 8u, 12u}) {
    CutFlash base = flash_with(stored);
    StartedBoxes filled(base);
    const Images old = images(filled);
    for (size_t cut = 0; cut < 200; ++cut) {
      CutFlash flash = base;
      StartedBoxes before(flash);
      flash.cut_after(cut / 3, kCuts[cut % 3]);
      const bool is_done = store(before, flash, 99);
      flash.power_on();
      StartedBoxes after(flash);
      check_old_or_new(old, after, stored + 1, 99);
      CHECK(store(after, flash, 100) && after.head(0)->faults == 100);
      CHECK(images(after).size() == after.count());
      if (is_done) break;
    }
  }
}

TEST(a_second_cut_while_the_first_one_is_mended_loses_no_box_either) {
  std::mt19937 random(1);
  for (const uint32_t stored : {0u, 3u, 8u, 12u}) {
    const CutFlash base = flash_with(stored);
    for (int run = 0; run < 40; ++run) {
      CutFlash flash = base;
      Images old;
      // Each start is cut in the middle of its store, or of what the one before has left.
      for (uint32_t start = 0; start < 3; ++start) {
        StartedBoxes boxes(flash);
        if (start == 0) old = images(boxes);
        const uint32_t number = old.empty() ? 1 : old.rbegin()->first + 1;
        const CutFlash::Cut cut = kCuts[random() % 3];
        flash.cut_after(random() % 60, cut);
        store(boxes, flash, 1000 + start);
        flash.power_on();
        StartedBoxes after(flash);
        check_old_or_new(old, after, number, 1000 + start);
        old = images(after);
      }
      StartedBoxes last(flash);
      CHECK(store(last, flash, 2000) && last.head(0)->faults == 2000);
      CHECK(images(last).size() == last.count());
    }
  }
}

TEST(a_cut_while_a_robot_stores_a_box_leaves_its_parameters_and_its_counts) {
  size_t operations = SIZE_MAX;
  for (size_t cut = 0; cut <= operations; ++cut) {
    for (const CutFlash::Cut how : kCuts) {
      RobotWithBoxes robot;
      robot.start();
      CHECK(robot.bench.set(ParameterId::kMaxDuty, 0.5f) == RefusalCode::kNone);
      CHECK(robot.bench.refusal(ParameterSave{}) == RefusalCode::kNone);
      robot.run(3000);
      const std::vector<uint8_t> saved = robot.bench.store.block;
      CHECK(!saved.empty());
      const size_t before = robot.flash.operations;
      if (operations != SIZE_MAX) robot.flash.cut_after(cut, how);
      robot.bench.send(Estop{});
      robot.run(300);
      if (operations == SIZE_MAX) operations = robot.flash.operations - before;
      CHECK(robot.bench.store.block == saved);
      robot.flash.power_on();
      StartedBoxes boxes(robot.flash);
      CHECK(images(boxes).size() <= 1);
      const LedgerCounts counts = counts_after(ResetReason::kPowerOn, robot.flash);
      CHECK(resets(counts, ResetReason::kPowerOn) == 2);
    }
  }
  CHECK(operations >= 33);
}

TEST(a_flash_that_takes_nothing_is_left_alone_until_the_next_start) {
  CutFlash flash(BoxStore::kSize);
  std::fill(flash.bytes.begin(), flash.bytes.end(), 0);
  flash.failing = true;
  StartedBoxes boxes(flash);
  boxes.begin({}, memory_of(1).data());
  int touched = 0;
  for (int i = 0; i < 1000; ++i) touched += boxes.work() ? 1 : 0;
  CHECK(touched == 2 && !boxes.is_storing());
}

TEST(a_box_is_stored_once_the_robot_stands_and_can_be_re_run) {
  RobotWithBoxes robot;
  robot.start();
  robot.bench.send(robot.bench.velocity(0.2f, 0.2f));
  for (int i = 0; i < 200; ++i) {
    robot.bench.turn(i % 5 == 0, i % 5 == 0);
    robot.run(1);
  }
  CHECK(robot.bench.driven());
  robot.bench.contact.open = true;
  robot.run(1900);
  CHECK(robot.keeper->store().count() == 0 && robot.flash.operations == 0);
  robot.run(200);
  CHECK(robot.keeper->store().count() == 1);
  const BoxHead& head = *robot.keeper->store().head(0);
  CHECK(head.cause == BoxCause::kEstop && head.board == 0x77 && head.origin.boot_id == 3);
  const auto recorded = memory_in(robot.keeper->store(), 1);
  CHECK(Rerun(recorded.data()).run() == Rerun::Outcome::kSame);
  // It records again, and the box written to flash re-runs, too.
  CHECK(!robot.keeper->black_box().is_closed());
  robot.run(15'000);
  CHECK(Rerun(robot.memory.box).run() == Rerun::Outcome::kSame);
}

TEST(a_drive_puts_the_rest_of_a_write_off) {
  RestingRobot robot;
  robot.bench.send(Estop{});
  robot.run(10);
  const size_t begun = robot.flash.operations;
  CHECK(begun > 0 && robot.keeper->store().is_storing());
  CHECK(robot.bench.clear_estop() == RefusalCode::kNone);
  robot.run(1);
  robot.bench.send(robot.bench.velocity(0.0f, 0.0f));
  robot.run(1);
  CHECK(robot.bench.state() == SupervisorState::kDriving);
  const size_t before = robot.flash.operations;
  for (int i = 0; i < 1000; ++i) {
    robot.bench.send(robot.bench.velocity(0.2f, 0.2f));
    robot.bench.turn(1, 1);
    robot.run(1);
  }
  CHECK(robot.flash.operations == before && robot.keeper->store().is_storing());
  robot.bench.send(robot.bench.stop());
  robot.run(3000);
  CHECK(robot.keeper->store().count() == 1 && !robot.keeper->black_box().is_closed());
}

TEST(boxes_are_stored_three_at_once_and_then_one_in_ten_minutes) {
  RestingRobot robot;
  for (int i = 0; i < 20; ++i) robot.estop_and_clear(200);
  CHECK(robot.keeper->store().count() == 3);
  robot.bench.now_us += 600'000'000;
  robot.run(200);
  for (int i = 0; i < 5; ++i) robot.estop_and_clear(200);
  CHECK(robot.keeper->store().count() == 4);
}

TEST(a_panic_leaves_a_box_and_a_power_cut_none) {
  for (const bool panics : {true, false}) {
    RobotWithBoxes first;
    first.start();
    first.bench.drive(0.2f, 0.2f, 30);
    RobotWithBoxes second(50'000);
    second.memory = first.memory;
    second.start(panics ? ResetReason::kPanic : ResetReason::kPowerOn);
    second.run(9900);
    CHECK(second.flash.operations == 0);
    second.run(1000);
    CHECK(second.keeper->store().count() == (panics ? 1 : 0));
    if (!panics) continue;
    const BoxHead& head = *second.keeper->store().head(0);
    CHECK(head.cause == BoxCause::kReset && head.reset_reason == ResetReason::kPanic);
    const auto recorded = memory_in(second.keeper->store(), 1);
    Rerun rerun(recorded.data());
    CHECK(rerun.run() == Rerun::Outcome::kSame && rerun.steps() == 32);
    CHECK(!second.keeper->black_box().is_closed());
  }
}

TEST(the_ledger_counts_across_resets) {
  CutFlash flash(RecorderKeeper::kFlashSize);
  LedgerMemory memory{};
  StartedLedger first(flash, memory);
  first.count_deadline();
  first.count(SupervisorEvent::kDeadline, SupervisorState::kTimedOut);
  first.count(SupervisorEvent::kEstop, SupervisorState::kIdle);
  CHECK(first.work(10'000'000));
  first.count(SupervisorEvent::kStop, SupervisorState::kDriving);
  CHECK(!first.work(609'000'000));
  CHECK(first.work(610'000'000) && !first.work(2'000'000'000));
  memory = {};  // As a cut of the power does.
  StartedLedger second(flash, memory, ResetReason::kBrownout);
  const LedgerCounts counts = second.counts(5'000'000);
  CHECK(counts.uptime_s == 615);
  CHECK(resets(counts, ResetReason::kPowerOn) == 1);
  CHECK(resets(counts, ResetReason::kBrownout) == 1);
  CHECK(deadlines(counts) == 1);
  CHECK(stops(counts, SupervisorEvent::kEstop) == 1);
  CHECK(stops(counts, SupervisorEvent::kStop) == 1);
}

TEST(a_cut_at_any_operation_leaves_the_old_counts_or_the_new_ones) {
  // More entries than fit: sectors are erased on the way.
  for (const uint32_t entries : {0u, 5u, 31u, 32u, 255u, 256u, 700u}) {
    for (size_t cut = 0; cut < 3; ++cut) {
      CutFlash flash(RecorderKeeper::kFlashSize);
      LedgerMemory memory[3]{};  // Lost with the power.
      StartedLedger before(flash, memory[0]);
      uint64_t now_us = 10'000'000;
      const auto write = [&now_us](StartedLedger& ledger, CutFlash& power) {
        now_us += 600'000'000;
        ledger.count_deadline();
        for (int i = 0; i < 5 && !power.is_off(); ++i) ledger.work(now_us);
      };
      for (uint32_t i = 0; i < entries; ++i) write(before, flash);
      flash.cut_after(cut);
      write(before, flash);
      flash.power_on();
      StartedLedger after(flash, memory[1]);
      CHECK(deadlines(after.counts(0)) == entries || deadlines(after.counts(0)) == entries + 1);
      write(after, flash);
      const StartedLedger later(flash, memory[2]);
      CHECK(deadlines(later.counts(0)) == deadlines(after.counts(0)));
    }
  }
}

TEST(a_reset_of_the_processor_loses_no_count) {
  CutFlash flash(RecorderKeeper::kFlashSize);
  LedgerMemory memory;
  memory.fill(0xa5);  // As a power-on leaves it.
  for (uint32_t boot = 0; boot < 5; ++boot) {
    StartedLedger ledger(flash, memory, boot == 0 ? ResetReason::kPowerOn : ResetReason::kPanic);
    CHECK(deadlines(ledger.counts(0)) == boot);
    CHECK(ledger.counts(0).uptime_s == 4 * boot);
    CHECK(resets(ledger.counts(0), ResetReason::kPanic) == boot);
    for (uint64_t now_us = 1000; now_us < 4'500'000; now_us += 1000) ledger.note_time(now_us);
    ledger.count_deadline();
  }
  CHECK(flash.operations == 0);
}

TEST(what_is_in_flash_is_not_counted_twice) {
  CutFlash flash(RecorderKeeper::kFlashSize);
  LedgerMemory memory{};
  StartedLedger ledger(flash, memory);
  ledger.count_deadline();
  const LedgerMemory before_write = memory;
  CHECK(ledger.work(20'000'000));
  ledger.count_deadline();
  // A panic between the write and what follows it leaves the memory of before: flash knows more.
  const LedgerCounts torn = counts_after(ResetReason::kPanic, flash, before_write);
  CHECK(deadlines(torn) == 1);
  CHECK(torn.uptime_s == 20);
  const LedgerCounts whole = counts_after(ResetReason::kPanic, flash, memory);
  CHECK(deadlines(whole) == 2);
  CHECK(resets(whole, ResetReason::kPowerOn) == 1);
}

TEST(counts_in_memory_that_are_damaged_or_of_another_flash_are_not_believed) {
  CutFlash flash(RecorderKeeper::kFlashSize);
  LedgerMemory memory{};
  StartedLedger ledger(flash, memory);
  ledger.count_deadline();
  const auto counted = [&] { return deadlines(counts_after(ResetReason::kPanic, flash, memory)); };
  // A reset in the middle of a write leaves one of the two records whole.
  for (uint8_t& byte : memory) {
    byte ^= 1;
    CHECK(counted() == 1);
    byte ^= 1;
  }
  memory[5] ^= 1;
  memory[LedgerCounts::kSize + 5] ^= 1;
  CHECK(counted() == 0);
  memory[5] ^= 1;
  CHECK(counted() == 1);
  CutFlash written(RecorderKeeper::kFlashSize);
  LedgerMemory other{};
  StartedLedger elsewhere(written, other);
  CHECK(elsewhere.work(10'000'000));
  flash = written;
  CHECK(counted() == 0);
}

TEST(a_boot_loop_writes_nothing_and_is_counted) {
  CutFlash flash(RecorderKeeper::kFlashSize);
  RecorderMemory memory{};
  for (uint32_t boot = 0; boot < 50; ++boot) {
    RobotWithBoxes robot(50'000);
    robot.flash = flash;
    robot.memory = memory;
    robot.start(boot % 2 == 0 ? ResetReason::kTaskWatchdog : ResetReason::kPanic);
    robot.estop_and_clear(100);
    robot.run(9700);
    flash = robot.flash;
    memory = robot.memory;
    const auto ledger = robot.bench.ask<LedgerValue>(LedgerGet{});
    CHECK(ledger && ledger->resets_panic + ledger->resets_task_watchdog == boot + 1);
    CHECK(ledger->stops_estop == boot + 1);
  }
  CHECK(flash.operations == 0);
}

TEST(a_host_reads_the_boxes_part_by_part) {
  RestingRobot robot;
  CHECK(robot.bench.ask<GroupInfo>(GroupGet{.group = Group::kRecorder})->hash ==
        hash_of(Group::kRecorder));
  const auto none = robot.bench.ask<BoxValue>(BoxGet{});
  CHECK(none && none->box_count == 0 && none->number == 0);
  robot.estop_and_clear(200);
  robot.estop_and_clear(200);
  const auto newest = robot.bench.ask<BoxValue>(BoxGet{.age = 0});
  const auto first = robot.bench.ask<BoxValue>(BoxGet{.age = 1});
  CHECK(newest && newest->box_count == 2 && newest->number == 2);
  CHECK(newest->size == kBoxImageSize && newest->cause == BoxCause::kEstop);
  CHECK(newest->boot_id == 3 && newest->core == kCoreHash && newest->board == 0x77);
  CHECK(first && first->number == 1 && first->stored_us < newest->stored_us);
  CHECK(robot.bench.ask<BoxValue>(BoxGet{.age = 2})->number == 0);
  // Each time more requests than the ids of a session go round with.
  const Images stored = images(robot.keeper->store());
  for (int i = 0; i < 120; ++i)
    for (const auto& [number, image] : stored) CHECK(robot.read(number) == image);
  CHECK(robot.read(3).empty());
  // What was read is in the box that is recorded now, and re-runs.
  robot.run(10);
  CHECK(Rerun(robot.memory.box).run() == Rerun::Outcome::kSame);
}

TEST(a_repeat_is_answered_afresh_and_an_older_request_is_not) {
  RobotWithBoxes robot;
  robot.start();
  robot.run(10);
  robot.bench.received.clear();
  BoxGet request{.session_id = robot.bench.session_id(), .request_id = 50, .age = 0};
  const auto answers = [&] {
    robot.bench.send(request);
    robot.bench.service();
    return robot.bench.of<BoxValue>().size();
  };
  CHECK(answers() == 1);
  CHECK(answers() == 2);
  request.request_id = 49;
  CHECK(answers() == 2);
}

TEST(nothing_is_read_while_driving_but_with_a_stop_or_a_fault_latched) {
  RestingRobot robot;
  robot.estop_and_clear(200);
  const auto refusals = [&] {
    return std::vector<RefusalCode>{robot.bench.refusal(BoxGet{}), robot.bench.refusal(BoxRead{1}),
                                    robot.bench.refusal(LedgerGet{})};
  };
  const std::vector<RefusalCode> refused(3, RefusalCode::kNotStopped);
  const std::vector<RefusalCode> served(3, RefusalCode::kNone);
  robot.bench.send(robot.bench.velocity(0.0f, 0.0f));
  robot.run(1);
  robot.bench.send(robot.bench.velocity(0.2f, 0.2f));
  robot.run(1);
  CHECK(robot.bench.state() == SupervisorState::kDriving && refusals() == refused);
  robot.run(1000);
  CHECK(robot.bench.state() == SupervisorState::kTimedOut && refusals() == served);
  robot.bench.send(Estop{});
  robot.run(1);
  CHECK(robot.bench.state() == SupervisorState::kEstopped && refusals() == served);
}

TEST(a_box_is_current_until_anything_happens_to_the_state) {
  RestingRobot robot;
  const auto is_current = [&] { return robot.bench.ask<BoxValue>(BoxGet{})->is_current; };
  robot.bench.send(Estop{});
  robot.run(200);
  CHECK(robot.keeper->store().count() == 1 && is_current() == 1);
  robot.bench.send(robot.bench.stop());
  robot.run(10);
  CHECK(is_current() == 1);
  (void)robot.bench.clear_estop();
  CHECK(is_current() == 0);
  // Cleared and stopped again while no box can be stored: the newest one is not of that stop.
  for (int i = 0; i < 2; ++i) robot.estop_and_clear(200);
  robot.bench.send(Estop{});
  robot.run(200);
  CHECK(robot.keeper->store().count() == 3 && is_current() == 0);
}

TEST(the_box_of_a_reset_is_current_all_of_the_boot) {
  RobotWithBoxes first;
  first.start();
  first.bench.drive(0.2f, 0.2f, 30);
  RobotWithBoxes second(50'000);
  second.memory = first.memory;
  second.start(ResetReason::kPanic);
  second.run(11'000);
  CHECK(second.bench.ask<BoxValue>(BoxGet{})->is_current == 1);
  second.estop_and_clear(200);
  CHECK(second.bench.ask<BoxValue>(BoxGet{.age = 1})->is_current == 1);
  CHECK(second.bench.ask<BoxValue>(BoxGet{.age = 0})->is_current == 0);
  RobotWithBoxes third(50'000);
  third.flash = second.flash;
  third.start(ResetReason::kPowerOn);
  third.run(11'000);
  CHECK(third.bench.ask<BoxValue>(BoxGet{.age = 1})->is_current == 0);
}

TEST(a_box_that_is_overwritten_while_it_is_read_ends_in_no_mixture) {
  RestingRobot robot;
  for (int i = 0; i < 8; ++i) {
    robot.estop_and_clear(200);
    robot.bench.now_us += 600'000'000;
  }
  CHECK(robot.keeper->store().count() == 8 && !robot.read(1).empty());
  robot.estop_and_clear(200);
  CHECK(robot.keeper->store().head(0)->number == 9 && robot.read(1).empty());
}

TEST(a_host_reads_the_ledger) {
  RobotWithBoxes robot;
  robot.start(ResetReason::kBrownout);
  robot.bench.send(robot.bench.velocity(0.2f, 0.2f));
  robot.run(1000);
  robot.estop_and_clear(10);
  robot.estop_and_clear(10);
  const auto ledger = robot.bench.ask<LedgerValue>(LedgerGet{});
  CHECK(ledger && ledger->uptime_s == robot.bench.now_us / 1'000'000);
  CHECK(ledger->resets_brownout == 1 && ledger->resets_power_on == 0 && ledger->resets_panic == 0);
  CHECK(ledger->stops_deadline == 1 && ledger->stops_estop == 2 && ledger->stops_fault == 0);
}

TEST(without_a_recorder_there_is_nothing_to_read) {
  OpenRobot bench;
  CHECK(bench.ask<GroupInfo>(GroupGet{.group = Group::kRecorder})->hash == 0);
  CHECK(bench.refusal(BoxGet{}) == RefusalCode::kNotSupported);
  CHECK(bench.refusal(BoxRead{}) == RefusalCode::kNotSupported);
  CHECK(bench.refusal(LedgerGet{}) == RefusalCode::kNotSupported);
}
