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
