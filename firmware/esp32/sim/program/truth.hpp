// The robot's true state as lines of JSON: at a rate, and whenever the drive changes.
#pragma once

#include <chrono>
#include <limits>

#include "console.hpp"
#include "json.hpp"
#include "simulator.hpp"

namespace wheelwire::sim {

class TruthStream {
 public:
  /// 0 Hz: none.
  explicit TruthStream(double rate_hz)
      : interval_(rate_hz > 0.0 ? static_cast<Nanoseconds>(1e9 / rate_hz) : 0) {}

  /// Call after every advance.
  void report(const Simulator& simulator, Console& console) {
    if (interval_ == 0) return;
    if (simulator.record().drive_changes != drive_changes_) {
      drive_changes_ = simulator.record().drive_changes;
      console.print(truth_line(simulator, "drive"));
    }
    const Nanoseconds now = simulator.board.now();
    if (now < next_) return;
    next_ = (now / interval_ + 1) * interval_;
    console.print_if_idle(truth_line(simulator, "truth"));
  }

  /// When the next periodic one is due.
  Nanoseconds due() const {
    return interval_ == 0 ? std::numeric_limits<Nanoseconds>::max() : next_;
  }

 private:
  /// On Linux the clock that Python's time.monotonic() reads.
  static uint64_t host_clock_us() {
    const auto now = std::chrono::steady_clock::now().time_since_epoch();
    return static_cast<uint64_t>(
        std::chrono::duration_cast<std::chrono::microseconds>(now).count());
  }

  static std::string truth_line(const Simulator& simulator, const char* event) {
    const Plant& plant = simulator.board.plant;
    const Record& record = simulator.record();
    return JsonLine(event)
        .add("host_us", host_clock_us())
        .add("t_us", static_cast<uint64_t>(simulator.board.now() / 1000))
        .add("device_us", simulator.board.device_us())
        .add("boot_id", uint64_t{simulator.boot_id()})
        .add("x_m", plant.pose().x_m)
        .add("y_m", plant.pose().y_m)
        .add("heading_rad", plant.pose().heading_rad)
        .add("distance_m", plant.distance_m())
        .add("left_mps", plant.speed_mps(kLeft))
        .add("right_mps", plant.speed_mps(kRight))
        .add("left_ticks", static_cast<double>(simulator.board.encoders[kLeft].ticks()))
        .add("right_ticks", static_cast<double>(simulator.board.encoders[kRight].ticks()))
        .add("drive_on", record.drive_on)
        .add("drive_removed_us", record.drive_removed_us)
        .add("deadline_us", record.deadline_us)
        .add("stands_still", record.stands_still)
        .add("standstill_us", record.standstill_us)
        .add("state", static_cast<uint64_t>(simulator.state()))
        .add("faults", uint64_t{simulator.faults()})
        .str();
  }

  Nanoseconds interval_;
  Nanoseconds next_ = 0;
  uint64_t drive_changes_ = 0;
};

}  // namespace wheelwire::sim
