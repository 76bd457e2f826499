// The UART at rest, and while flash is written with the cache off.
#include "esp_task_wdt.h"
#include "json.hpp"
#include "nvs.h"
#include "rows.hpp"
#include "virtual_chip.hpp"

namespace wheelwire::hil {
namespace {

constexpr int64_t kStartUs = 200'000;
constexpr int64_t kPingUs = 1'000;
constexpr int64_t kTrafficUs = 10'000;
constexpr int64_t kSaveUs = 1'000'000;  ///< Between two.
/// What an erasure of a sector may take, by the flash's data sheet.
constexpr int64_t kEraseUs = 400'000;

}  // namespace

std::string measure_line(int times) {
  VirtualChip chip;
  const uint32_t pings = static_cast<uint32_t>(10'000 * times);
  const uint32_t saves = static_cast<uint32_t>(20 * times);
  uint32_t lost = 0;
  uint32_t saved = 0;
  int64_t saved_us = 0;
  int64_t pause_at_rest_us = 0;
  bool has_begun = false;
  bool saves_now = false;
  int resets = 0;
  // Only what is in RAM goes on: the host, and the UART's interrupt.
  fake_on_commit = [&] {
    for (int64_t us = 0; us < kEraseUs; us += 100) {
      fake_time_us += 100;
      chip.host().advance();
    }
    // A task hangs during this: the watchdog must have been given more time.
    if (int64_t{1000} * fake_task_watchdog.timeout_ms < kEraseUs) ++resets;
  };
  const End end = chip.run([&] {
    HostEnd& host = chip.host();
    if (chip.since_start_us() < kStartUs) return;
    host.sends_setpoints = false;
    if (!has_begun) {
      has_begun = true;
      host.heard_us = fake_time_us;
    }
    if (!saves_now) {
      host.pings_every_us = host.pings < pings ? kPingUs : 0;
      // The last answers are under way.
      if (host.pings < pings || fake_time_us < host.heard_us + 10 * kPingUs) return;
      lost = host.pings - host.pongs;
      pause_at_rest_us = host.longest_pause_us;
      host.longest_pause_us = 0;
      host.pings_every_us = kTrafficUs;
      saves_now = true;
      saved_us = fake_time_us;
    }
    if (fake_time_us < saved_us + kSaveUs) return;
    saved_us = fake_time_us;
    if (saved++ == saves) chip.stop();
    host.save();
  });
  fake_on_commit = nullptr;
  const HostEnd& host = chip.host();
  return Json{}
      .put("pings", pings)
      .put("lost", lost)
      .put("longest_at_rest_ms", static_cast<double>(pause_at_rest_us) / 1e3)
      .put("saves", saves)
      .put("saved", host.acks)
      .put("longest_pause_ms", static_cast<double>(host.longest_pause_us) / 1e3)
      .put("resets", end == End::kDone ? resets : resets + 1)
      .text();
}

}  // namespace wheelwire::hil
