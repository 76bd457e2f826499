// How long the motors stay on once nothing extends the drive: expired setpoints, frozen cores.
#include <algorithm>

#include "json.hpp"
#include "rows.hpp"
#include "virtual_chip.hpp"

namespace wheelwire::hil {
namespace {

constexpr int64_t kIntervalUs = 300'000;

double ms(int64_t us) { return static_cast<double>(us) / 1e3; }

/// The longest time from a setpoint's deadline to the end of the drive.
Json measure_expiries(int count) {
  VirtualChip chip;
  int64_t longest_us = 0;
  int seen = 0;
  bool drove = false;
  int64_t next_us = 0;
  chip.run([&] {
    HostEnd& host = chip.host();
    if (chip.since_start_us() < kDriveUs) return;
    host.duty_q15 = kDuty_q15;
    if (next_us == 0) next_us = fake_time_us + kIntervalUs;
    // Not at the same phase of the control period each time.
    if (fake_time_us > next_us + 100 * (seen % 10)) host.sends_setpoints = false;
    if (chip.drives()) drove = true;
    if (host.sends_setpoints || !drove || chip.drives()) {
      if (!host.sends_setpoints && fake_time_us > host.deadline_us + 1'000'000) chip.stop();
      return;
    }
    longest_us = std::max(longest_us, fake_time_us - host.deadline_us);
    drove = false;
    host.sends_setpoints = true;
    next_us = fake_time_us + kIntervalUs;
    if (++seen == count) chip.stop();
  });
  return Json{}.put("count", seen).put("longest_ms", ms(longest_us));
}

/// From the last control step of a core that stops to the end of the drive.
Json measure_freeze(int core, int64_t phase_us) {
  VirtualChip chip;
  int64_t stepped_us = 0;
  bool drove = false;
  const End end = chip.run([&] {
    chip.host().duty_q15 = chip.since_start_us() > kDriveUs ? kDuty_q15 : int16_t{0};
    if (chip.since_start_us() < 2 * kDriveUs + phase_us) return;
    stepped_us = chip.stepped_us();
    drove = chip.drives();
    chip.hang(core);
  });
  return Json{}
      .put("core", core)
      .put("drove", drove)
      .put("is_back", end == End::kReset)
      .put("released_ms", ms(chip.released_us() - stepped_us));
}

}  // namespace

std::string measure_stops(int times) {
  std::vector<Json> freezes;
  for (const int core : {0, 1})
    for (int i = 0; i < 5 * times; ++i) freezes.push_back(measure_freeze(core, 200 * (i % 5)));
  return Json{}.put("expiries", measure_expiries(100 * times)).put("freezes", freezes).text();
}

}  // namespace wheelwire::hil
