// A whole device on the chip's stores, of two slots each, that a power cut or worn flash has
// damaged.
#include "robot_bench.hpp"
#include "twin_store.hpp"

using namespace wheelwire;
using enum ParameterId;
using test::RobotBench;

namespace {

/// The flash, which outlives each device on it.
struct Slots {
  MemoryStore first;
  MemoryStore second;
  TwinStore store{first, second};

  void damage(MemoryStore& slot) { slot.block.back() ^= 1; }
  /// Those that were ever saved.
  void damage_all() {
    for (MemoryStore* const slot : {&first, &second}) {
      if (!slot->block.empty()) damage(*slot);
    }
  }
};

struct Flash {
  Slots parameters;
  Slots latched;

  /// Sets a duty limit for each of the values, and saves it.
  void save(std::initializer_list<float> duties) {
    RobotBench robot{parameters.store, latched.store};
    robot.open();
    for (const float duty : duties) {
      CHECK(robot.set(kMaxDuty, duty) == RefusalCode::kNone);
      CHECK(robot.refusal(ParameterSave{}) == RefusalCode::kNone);
    }
  }
};

}  // namespace

TEST(a_robot_drives_on_the_last_block_but_one_if_the_last_is_damaged) {
  Flash flash;
  flash.save({0.5f, 0.25f});
  flash.parameters.damage(flash.parameters.second);
  RobotBench robot{flash.parameters.store, flash.latched.store};
  robot.open();
  CHECK(robot.of<Event>().empty());
  robot.drive(0.2f, 0.2f);
  CHECK(robot.driven());
  robot.send(robot.duty(32'767, 32'767));
  robot.run(250);
  CHECK(robot.left.duty() == 16'384 && robot.right.duty() == 16'384);
}

TEST(a_robot_none_of_whose_saved_blocks_is_whole_does_not_drive_until_they_are_erased) {
  for (const bool only_one_was_saved : {true, false}) {
    Flash flash;
    flash.save({0.5f});
    if (!only_one_was_saved) flash.save({0.25f});
    CHECK(flash.parameters.second.block.empty() == only_one_was_saved);
    flash.parameters.damage_all();
    RobotBench robot{flash.parameters.store, flash.latched.store};
    robot.open().drive(0.2f, 0.2f);
    CHECK(robot.state() == SupervisorState::kFault && !robot.driven());
    CHECK(robot.of<WheelState>().back().faults == fault::kStoreUnreadable);
    CHECK(robot.clear_fault() == RefusalCode::kCausePresent);
    CHECK(robot.refusal(ParameterSave{}) == RefusalCode::kStoreFailed);
    CHECK(robot.refusal(ParameterReset{}) == RefusalCode::kNone);
    CHECK(robot.clear_fault() == RefusalCode::kNone);
    robot.drive(0.0f, 0.0f);
    robot.drive(0.2f, 0.2f);
    CHECK(robot.driven());
    RobotBench next{flash.parameters.store, flash.latched.store};
    next.open().drive(0.2f, 0.2f);
    CHECK(next.driven());
  }
}

TEST(a_note_of_an_estop_of_which_no_slot_is_whole_is_an_estop) {
  for (const bool only_one_was_saved : {true, false}) {
    Flash flash;
    {
      RobotBench robot{flash.parameters.store, flash.latched.store};
      robot.open().send(Estop{});
      robot.run(3000);
      if (!only_one_was_saved) {
        CHECK(robot.clear_estop() == RefusalCode::kNone);
        robot.run(100);
      }
    }
    CHECK(flash.latched.second.block.empty() == only_one_was_saved);
    flash.latched.damage_all();
    RobotBench robot{flash.parameters.store, flash.latched.store};
    robot.open();
    CHECK(robot.state() == SupervisorState::kEstopped);
    CHECK(robot.clear_estop() == RefusalCode::kNone);
    robot.run(3000);
    RobotBench next{flash.parameters.store, flash.latched.store};
    next.open();
    CHECK(next.state() == SupervisorState::kIdle);
  }
}
