#include "ota_trial.hpp"

#include "esp_ota_ops.h"
#include "image_trial.hpp"
#include "robot_bench.hpp"
#include "task_watchdog.hpp"

using namespace wheelwire;
using namespace wheelwire::test;

namespace {

/// A new image that runs for longer than its trial, on a robot whose session is open.
struct NewImage {
  RobotBench bench;
  OtaTrial trial;

  explicit NewImage(esp_ota_img_states_t state = ESP_OTA_IMG_PENDING_VERIFY) {
    fake_image = {.state = state};
    CHECK(start_task_watchdog());
    trial.start();
    bench.open();
    run(static_cast<int>(kTrialUs / RobotBench::kPeriodUs) + 1000, 1);
  }
  void run(int steps, int ticks) {
    for (int i = 0; i < steps; ++i) {
      bench.turn(ticks, ticks);
      bench.step();
      trial.step(bench.device, bench.now_us);
    }
  }
};

}  // namespace

TEST(a_new_image_is_confirmed_once_and_only_while_the_wheels_stand) {
  NewImage image;  // It rolls in IDLE, after a stop that coasts.
  CHECK(image.bench.state() == SupervisorState::kIdle);
  CHECK(fake_image.confirmations == 0);
  image.run(2000, 0);
  CHECK(fake_image.confirmations == 1);
  image.run(2000, 0);
  CHECK(fake_image.confirmations == 1);
}

TEST(an_image_that_was_flashed_by_cable_is_on_no_trial) {
  NewImage image{ESP_OTA_IMG_VALID};
  image.run(2000, 0);
  CHECK(fake_image.confirmations == 0);
}
