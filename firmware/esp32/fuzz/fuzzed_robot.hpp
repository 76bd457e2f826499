// The whole firmware on fake hardware. After each call it must hold that
//
// - it drives only by a setpoint of the open session that has not expired, by the firmware's own
//   account and by that of `DriveOracle`, and only in the state DRIVING without a fault;
// - its deadline moves only when a setpoint is accepted, or is cleared with its session;
// - a trial of parameters changes nothing that is saved, and when it ends without a KEEP the
//   parameters are what they were and nothing is driven.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "device.hpp"
#include "fake_hal.hpp"
#include "memory_store.hpp"

namespace wheelwire::fuzz {

class FuzzedRobot {
 public:
  FuzzedRobot(uint32_t boot_id, MemoryStore& store)
      : oracle_(boot_id),
        store_(store),
        line_(oracle_),
        device_({left_, right_, encoders_, line_, store, latches_, latch_store_, estop_, battery_},
                identity(boot_id)) {
    device_.start(0);
    device_.offer(archive_);
  }

  uint64_t now_us() const { return now_us_; }
  uint32_t session_id() const { return oracle_.session_id(); }
  FakeLine& line() { return line_; }
  FakeEncoders& encoders() { return encoders_; }
  FakeEstop& estop() { return estop_; }

  void step() { step_after(device_.control_period_us()); }

  void step_after(uint32_t elapsed_us) {
    const Before before = now();
    now_us_ += elapsed_us;
    line_.now_us = encoders_.now_us = now_us_;
    device_.step(now_us_);
    check(before);
    if (!driven()) return;
    REQUIRE(oracle_.valid(now_us_));
    REQUIRE(now_us_ < device_.deadline_us());
    REQUIRE(device_.faults() == 0);
  }

  void service_link() {
    const Before before = now();
    device_.service_link(now_us_);
    check(before);
  }

 private:
  using Values = std::array<float, kParameterCount>;

  struct Before {
    uint64_t deadline_us;
    uint32_t granted;
    uint32_t keeps;
    uint32_t begins;
    uint32_t changes;
    bool on_trial;
    Values values;
    std::vector<uint8_t> saved;
  };

  static Identity identity(uint32_t boot_id) {
    Identity identity{};
    identity.boot_id = boot_id;
    return identity;
  }

  Before now() const {
    return {device_.deadline_us(), oracle_.granted(),  oracle_.keeps(), oracle_.begins(),
            oracle_.changes(),     device_.on_trial(), values(),        store_.block};
  }
  Values values() const {
    Values all;
    for (const ParameterSpec& spec : kParameters)
      all[static_cast<size_t>(spec.id) - 1] = device_.parameter(spec.id);
    return all;
  }
  bool driven() const { return left_.driven() || right_.driven(); }

  /// One call may read several requests. What is held to is what none of them may break.
  void check_trial(const Before& before) {
    const bool on_trial = device_.on_trial();
    const uint32_t changes = oracle_.changes() - before.changes;
    REQUIRE(!on_trial || now_us_ < oracle_.trial_until_us());
    if (before.on_trial && on_trial && changes <= 1) REQUIRE(store_.block == before.saved);
    if (on_trial && oracle_.begins() != before.begins) {
      // A trial may also have ended and another begun in one call.
      former_is_known_ = !before.on_trial && changes == 1;
      former_ = before.values;
    }
    if (!before.on_trial || on_trial || changes != 0 || oracle_.keeps() != before.keeps) return;
    REQUIRE(!former_is_known_ || values() == former_);
    REQUIRE(!driven() || oracle_.granted() > before.granted);
  }

  void check(const Before& before) {
    check_trial(before);
    REQUIRE(!driven() || device_.state() == SupervisorState::kDriving);
    const uint64_t deadline_us = device_.deadline_us();
    if (deadline_us == before.deadline_us || deadline_us == 0) return;
    REQUIRE(oracle_.granted() > before.granted);
    REQUIRE(deadline_us <= oracle_.furthest_us());
  }

  /// Nothing is read while the robot drives.
  struct Archive final : BoxArchive {
    explicit Archive(const Device& robot) : device(robot) {}
    void describe(BoxValue& value) const override {
      REQUIRE(device.state() != SupervisorState::kDriving);
      value.box_count = 1;
    }
    size_t read(uint32_t, uint32_t, uint8_t* out, size_t capacity) override {
      REQUIRE(device.state() != SupervisorState::kDriving);
      std::fill_n(out, capacity, uint8_t{0});
      return capacity;
    }
    void count(LedgerValue&, uint64_t) const override {
      REQUIRE(device.state() != SupervisorState::kDriving);
    }
    const Device& device;
  };

  DriveOracle oracle_;
  MemoryStore& store_;
  Values former_{};  // before the trial
  bool former_is_known_ = false;
  FakeMotor left_;
  FakeMotor right_;
  FakeEncoders encoders_;
  FakeLine line_;
  MemoryLatches latches_;
  MemoryStore latch_store_;
  FakeEstop estop_;
  FakeBattery battery_;
  Device device_;
  Archive archive_{device_};
  uint64_t now_us_ = 0;
};

}  // namespace wheelwire::fuzz
