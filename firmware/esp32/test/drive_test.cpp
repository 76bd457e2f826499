// Both wheels: what is forgotten at a stop.
#include "drive.hpp"

#include "check.hpp"

using namespace wheelwire;

namespace {

struct Motor final : MotorPort {
  void drive(int16_t duty_q15) override { duty = duty_q15; }
  void brake() override { duty = 0; }
  void coast() override { duty = 0; }
  int16_t duty = 0;
};

class DriveBench {
 public:
  void follow(int32_t umps, int right_ticks) {
    latch(right_ticks);
    drive.follow(ControlMode::kVelocity, {umps, umps}, config);
  }
  void stop() {
    drive.begin_stop(StopMode::kCoast, counts.t_us, config);
    for (int step = 0; step < 300; ++step) {
      latch(0);
      drive.keep_stopped(counts.t_us);
    }
  }

  ControlConfig config = make_config(Parameters());
  Motor left;
  Motor right;
  Drive drive{left, right};
  EncoderCounts counts{};

 private:
  void latch(int right_ticks) {
    counts.t_us += config.period_us;
    counts.right = static_cast<int16_t>(counts.right + right_ticks);
    CHECK(drive.latch(counts, config) == 0);
  }
};

}  // namespace

TEST(what_a_wheel_was_behind_before_a_stop_is_not_made_up_after_it) {
  DriveBench bench;
  bench.drive.note_battery(7400, bench.config);
  // The left wheel is held fast.
  for (int step = 0; step < 150; ++step) bench.follow(200'000, step % 4 == 0);
  CHECK(bench.drive.left().behind_um() > 5000);
  bench.stop();
  bench.follow(200'000, 0);
  CHECK(magnitude(bench.drive.left().behind_um()) < 100);
}
