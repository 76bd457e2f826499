// What an EN pin shows: period and high time of duties, what a change of duty shows, a reversal.
#include <algorithm>

#include "json.hpp"
#include "rows.hpp"
#include "stage_boards.hpp"
#include "wired_robot.hpp"

namespace wheelwire::hil {
namespace {

constexpr int64_t kStepUs = 1000;
/// Enough for two periods of the slowest PWM.
constexpr int kSettle = 10;

struct Wave {
  int64_t edges = 0;
  int64_t high_ticks = 0;  ///< In one period.
};

class Bench {
 public:
  explicit Bench(uint32_t frequency_hz) : board_(test::board_of(Stage::kEnableIn1In2)) {
    fake_matrix = {};
    fake_time_us = 1'000'000;
    Parameters parameters;
    parameters.set(ParameterId::kPwmFrequencyHz, static_cast<float>(frequency_hz));
    started_ = robot_.start(parameters);
    enable_ = board_.left_enable;
  }

  bool is_started() const { return started_; }
  int64_t period_ticks() const { return fake_matrix.pwm.period_ticks; }
  void drive(int steps, int16_t duty_q15) {
    for (int i = 0; i < steps; ++i) {
      robot_.left_motor.drive(duty_q15);
      fake_time_us += kStepUs;
    }
  }

  /// One period from a rising edge on, if there is one, at every tick of the PWM's clock.
  Wave period() const {
    const int64_t start_ns = 1000 * fake_time_us;
    Wave wave;
    bool before = level(start_ns, -1);
    for (int64_t tick = 0; tick < period_ticks(); ++tick) {
      const bool now = level(start_ns, tick);
      wave.edges += now != before;
      wave.high_ticks += now;
      before = now;
    }
    return wave;
  }
  /// The part of a control step in which the wheel is driven this way.
  double driven(bool forward, int16_t duty_q15) {
    robot_.left_motor.drive(duty_q15);
    constexpr int kSamples = 397;  // Not in step with the PWM.
    int seen = 0;
    for (int i = 0; i < kSamples; ++i) {
      const int64_t t_ns = 1000 * fake_time_us + i * 1000 * kStepUs / kSamples;
      const bool ahead = fake_matrix.level_at(board_.left_in1, t_ns);
      const bool back = fake_matrix.level_at(board_.left_in2, t_ns);
      seen += fake_matrix.level_at(enable_, t_ns) && (forward ? ahead && !back : back && !ahead);
    }
    fake_time_us += kStepUs;
    return static_cast<double>(seen) / kSamples;
  }

 private:
  bool level(int64_t start_ns, int64_t tick) const {
    // In the middle of the tick.
    const double tick_ns = 1e9 / fake_matrix.pwm.resolution_hz;
    const double t_ns = static_cast<double>(start_ns) + (static_cast<double>(tick) + 0.5) * tick_ns;
    return fake_matrix.level_at(enable_, static_cast<int64_t>(t_ns));
  }

  BoardDescription board_;
  WiredRobot robot_{board_};
  int enable_ = -1;
  bool started_ = false;
};

/// The largest deviation of a static duty's high time from what it should be, and the edges of the
/// levels.
Json measure_duties(uint32_t frequency_hz) {
  Bench bench(frequency_hz);
  int64_t worst = 0;
  int64_t edges_of_levels = 0;
  const auto period = static_cast<double>(bench.period_ticks());
  for (const double part : {10 / period, 0.5, 0.99, 1.0, 0.0, 1.0 / INT16_MAX}) {
    const auto duty_q15 = static_cast<int16_t>(part * INT16_MAX + 0.5);
    bench.drive(kSettle * 5, duty_q15);
    const Wave wave = bench.period();
    const bool is_level = duty_q15 == 0 || duty_q15 == INT16_MAX;
    if (is_level) edges_of_levels += wave.edges;
    const auto wanted = static_cast<int64_t>(part * period);
    worst = std::max(worst, std::abs(wave.high_ticks - wanted));
    // A duty that is wanted shows something.
    if (duty_q15 != 0 && wave.high_ticks == 0) worst = bench.period_ticks();
  }
  return Json{}
      .put("frequency_hz", frequency_hz)
      .put("period_us", 1e6 * period / fake_matrix.pwm.resolution_hz)
      .put("started", bench.is_started())
      .put("worst_ticks", worst)
      .put("edges_of_levels", edges_of_levels);
}

/// Changes of duty in one direction: how often the pin shows more than the larger of both.
Json measure_changes(uint32_t frequency_hz, int changes) {
  Bench bench(frequency_hz);
  int wrong = 0;
  // A period keeps the duty that it began with, and one of 2 ms lasts for two steps.
  int16_t before[2]{};
  uint32_t seed = 1;
  for (int i = 0; i < changes; ++i) {
    seed = seed * 1'664'525 + 1'013'904'223;
    const auto duty_q15 = static_cast<int16_t>(1000 + (seed >> 16) % 31'000);
    const double most = std::max({before[0], before[1], duty_q15}) / static_cast<double>(INT16_MAX);
    // A step of a slow PWM shows a part of its period only.
    const double step = frequency_hz >= 1000 ? most : std::min(1.0, 2 * most);
    wrong += bench.driven(true, duty_q15) > step + 0.03;
    before[i % 2] = duty_q15;
  }
  return Json{}.put("frequency_hz", frequency_hz).put("changes", changes).put("wrong", wrong);
}

/// Reverses from nearly full duty to a little: the most that a period of the new direction shows,
/// and how much of the old one comes after it.
Json measure_reversals(uint32_t frequency_hz, int reversals) {
  constexpr int16_t kMuch = 30'000;
  constexpr int16_t kLittle = 3'000;
  Bench bench(frequency_hz);
  const int steps_in_period = std::max(1, static_cast<int>(1000 / frequency_hz));
  double most = 0;
  double wrong_way = 0;
  double afterwards = 0;
  for (int i = 0; i < reversals; ++i) {
    bench.drive(kSettle * 5 + i % 7, kMuch);
    std::vector<double> steps;
    for (int step = 0; step < kSettle * 5; ++step)
      steps.push_back(bench.driven(false, static_cast<int16_t>(-kLittle)));
    for (size_t first = 0; first + static_cast<size_t>(steps_in_period) <= steps.size(); ++first) {
      double sum = 0;
      for (int step = 0; step < steps_in_period; ++step)
        sum += steps[first + static_cast<size_t>(step)];
      most = std::max(most, sum / steps_in_period);
    }
    afterwards = steps.back() + steps[steps.size() - 2];
    // One more, from little to much: nothing of the old direction is left.
    bench.driven(true, kMuch);
    for (int step = 0; step < kSettle; ++step) wrong_way += bench.driven(false, kMuch);
  }
  return Json{}
      .put("frequency_hz", frequency_hz)
      .put("reversals", reversals)
      .put("wanted_part", kLittle / static_cast<double>(INT16_MAX))
      .put("most_part", most)
      .put("wrong_way_part", wrong_way)
      .put("drives_afterwards", afterwards > 0);
}

}  // namespace

std::string measure_pwm(int times) {
  std::vector<Json> duties;
  std::vector<Json> changes;
  std::vector<Json> reversals;
  for (const uint32_t frequency_hz : {20'000u, 500u}) {
    duties.push_back(measure_duties(frequency_hz));
    changes.push_back(measure_changes(frequency_hz, 10'000 * times));
    reversals.push_back(measure_reversals(frequency_hz, 20 * times));
  }
  return Json{}.put("duties", duties).put("changes", changes).put("reversals", reversals).text();
}

}  // namespace wheelwire::hil
