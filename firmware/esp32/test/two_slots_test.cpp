// A whole device on the chip's flash, which a power cut or time has damaged.
#include "robot_bench.hpp"
#include "slots.hpp"

using namespace wheelwire;
using enum ParameterId;
using namespace wheelwire::test;

namespace {

struct SlotRobot : RobotBench {
  explicit SlotRobot(SlotFlash& flash) : RobotBench(flash.parameters(), flash.latches()) {
    flash.configuration().load(bytes_, sizeof bytes_);
  }
  bool reports(EventCode code) const { return count(code) != 0; }
  /// Opens a session, with the events that it begins with.
  SlotRobot& start_and_greet() {
    start();
    greet();
    step();
    return *this;
  }

 private:
  uint8_t bytes_[TwinStore::kCapacity];
};

void save_duty(SlotFlash& flash, float duty) {
  SlotRobot robot{flash};
  robot.open();
  CHECK(robot.set(kMaxDuty, duty) == RefusalCode::kNone);
  CHECK(robot.refusal(ParameterSave{}) == RefusalCode::kNone);
}

enum class Loss { kGone, kDamaged, kOutdated };

/// Loses both slots of a block. Those of earlier firmware are no good, either.
void lose(SlotFlash& flash, StoredBlock block, Loss loss) {
  for (const int slot : {0, 1}) {
    std::vector<uint8_t>& bytes = flash.bytes(block, slot);
    if (loss == Loss::kGone) bytes.clear();
    if (loss == Loss::kDamaged) bytes.back() ^= 1;
    if (loss == Loss::kOutdated) bytes = sealed({1, 2, 3}, 1);
  }
}

}  // namespace

TEST(a_robot_drives_on_the_saved_values_though_a_slot_is_damaged) {
  for (const int slot : {0, 1}) {
    SlotFlash flash;
    save_duty(flash, 0.5f);
    save_duty(flash, 0.25f);
    const std::vector<uint8_t> whole = flash.bytes(StoredBlock::kParameterValues, slot);
    flash.bytes(StoredBlock::kParameterValues, slot).back() ^= 1;
    SlotRobot robot{flash};
    robot.start_and_greet();
    CHECK(robot.reports(EventCode::kParametersCopyLost));
    robot.arm();
    robot.drive_duty(32'767, 32'767, 250);
    CHECK(robot.left.duty() == 8'192 && robot.right.duty() == 8'192);
    // Nothing is written while it drives; at rest the slot is repaired.
    CHECK(flash.bytes(StoredBlock::kParameterValues, slot) != whole);
    robot.send(robot.stop());
    robot.run(5000);
    CHECK(flash.bytes(StoredBlock::kParameterValues, slot) == whole);
    SlotRobot next{flash};
    next.start_and_greet();
    CHECK(!next.reports(EventCode::kParametersCopyLost));
  }
}

TEST(a_robot_whose_saved_values_are_damaged_outdated_or_gone_does_not_drive_on_defaults) {
  for (const Loss loss : {Loss::kGone, Loss::kDamaged, Loss::kOutdated}) {
    for (const bool loads : {true, false}) {
      SlotFlash flash;
      save_duty(flash, 0.5f);
      lose(flash, StoredBlock::kParameterValues, loss);
      SlotRobot robot{flash};
      robot.open().drive(0.2f, 0.2f);
      CHECK(robot.state() == SupervisorState::kFault && !robot.driven());
      CHECK(robot.of<WheelState>().back().faults ==
            (loss == Loss::kOutdated ? fault::kStoreOutdated : fault::kStoreUnreadable));
      CHECK(robot.clear_fault() == RefusalCode::kCausePresent);
      const ParameterSave one{.parameter = static_cast<uint8_t>(kMaxDuty)};
      CHECK(robot.refusal(one) == RefusalCode::kStoreFailed);
      if (loads) {
        CHECK(robot.set(kMaxDuty, 0.25f) == RefusalCode::kNone);
        CHECK(robot.refusal(ParameterSave{}) == RefusalCode::kNone);
      } else {
        CHECK(robot.refusal(ParameterReset{}) == RefusalCode::kNone);
      }
      CHECK(robot.clear_fault() == RefusalCode::kNone);
      robot.drive(0.0f, 0.0f);
      robot.drive(0.2f, 0.2f);
      CHECK(robot.driven());
      SlotRobot next{flash};
      next.open().drive(0.2f, 0.2f);
      CHECK(next.driven());
      CHECK(next.device.parameter(kMaxDuty) == (loads ? 0.25f : Parameters().get(kMaxDuty)));
    }
  }
}

TEST(damaged_latches_are_an_estop_until_it_is_cleared) {
  for (const Loss loss : {Loss::kGone, Loss::kDamaged}) {
    for (const bool keeps_memory : {true, false}) {
      SlotFlash flash;
      {
        SlotRobot robot{flash};
        robot.open().send(Estop{});
        robot.run(3000);
      }
      lose(flash, StoredBlock::kLatches, loss);
      SlotRobot robot{flash};
      if (keeps_memory) {
        uint8_t record[Latches::kSize];
        Latches{}.encode(record);
        robot.latches.save(record, sizeof record);
      }
      robot.open();
      CHECK(robot.state() == SupervisorState::kEstopped);
      CHECK(robot.clear_estop() == RefusalCode::kNone);
      robot.run(3000);
      SlotRobot next{flash};
      next.open();
      CHECK(next.state() == SupervisorState::kIdle);
    }
  }
}
