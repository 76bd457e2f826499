// One scenario carried out on the simulated robot, with every rule checked at every step.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "host.hpp"
#include "operation.hpp"
#include "peripheral_lists.hpp"
#include "random.hpp"
#include "reset_reason.hpp"
#include "rules.hpp"
#include "shipped_boards.hpp"
#include "variables.hpp"

namespace wheelwire::explore {

/// How often each transition and each refusal was seen: its table and its words, by a tab.
using Coverage = std::map<std::string, uint64_t>;

class Run final : public sim::LineTap, public sim::StoreWatch, public sim::FlashWatch {
 public:
  /// Of a scenario with this seed; its operations follow one by one.
  explicit Run(uint64_t seed)
      : simulator_(seed),
        hosts_{Host(static_cast<uint32_t>(sim::mix(seed))),
               Host(static_cast<uint32_t>(sim::mix(seed + 1)))},
        boot_id_(simulator_.boot_id()) {
    simulator_.board.line.set_tap(this);
    for (sim::Store* const store : stores_) store->watch = this;
    simulator_.board.recorder_flash.watch = this;
  }

  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  /// False once a rule is broken, or the run can judge nothing more.
  bool apply(const Operation& operation) {
    carry_out(operation);
    return !ended();
  }

  const std::optional<Finding>& finding() const { return judge_.finding(); }
  sim::Simulator& simulator() { return simulator_; }
  Witness& witness() { return witness_; }
  const Coverage& coverage() const { return coverage_; }
  double seconds() const { return static_cast<double>(simulator_.board.now()) * 1e-9; }

  void on_read(const uint8_t* data, size_t size) override {
    if (dead_) return;
    settle(false);
    to_device_.feed(data, size, [this](const Seen& seen) {
      judge_.before_message();
      witness_.note_state();
      witness_.reads(seen);
      world_.handled = true;
    });
  }

  void on_write(const uint8_t* data, size_t size) override {
    if (dead_) return;
    from_device_.feed(data, size, [this](const Seen& seen) {
      judge_.accuse(witness_.sends(seen));
      if (seen.id == WheelState::kId) judge_.on_state(seen.as<WheelState>());
      if (seen.id == Event::kId) {
        const auto event = seen.as<Event>();
        if (event.code == EventCode::kSupervisor)
          ++coverage_["transition\t" + name_of(event.before) + " " + name_of(event.cause)];
        judge_.on_event(event);
      }
      if (seen.id == Refuse::kId) {
        const auto refuse = seen.as<Refuse>();
        ++coverage_["refusal\t" + name_of_message(refuse.message_id) + " " + name_of(refuse.code)];
      }
    });
  }

  sim::WriteFate fate_of_write(const sim::Store& store, int slot) override {
    using enum sim::WriteFate;
    if (dead_) return kUntouched;
    const auto place = std::find(stores_.begin(), stores_.end(), &store);
    const auto block = static_cast<StoredBlock>(place - stores_.begin());
    world_.writes_flash = true;
    if (block == StoredBlock::kLatches) judge_.flash_only_at_rest(true);
    if (slot == kFormat) {
      witness_.formats();
      return kDone;
    }
    if (cut_in_ == 0) {
      cut_in_ = -1;
      dead_ = true;
      witness_.cut_at_write(block, slot, cut_fate_);
      return cut_fate_;
    }
    if (cut_in_ > 0) --cut_in_;
    witness_.writes(block, slot);
    return kDone;
  }

  void on_flash() override {
    if (dead_) return;
    world_.writes_flash = true;
    judge_.flash_only_at_rest(false);
  }

 private:
  static constexpr double kOpenUs = 3'000;
  static constexpr double kArmingUs = 100'000;

  static int16_t q15(double duty) {
    if (!std::isfinite(duty)) return INT16_MIN;
    return static_cast<int16_t>(std::clamp(std::lround(duty * 32767.0), -32768L, 32767L));
  }

  static uint64_t whole(double value) { return value > 0.0 ? static_cast<uint64_t>(value) : 0; }

  static sim::Side side_of(double value) {
    return static_cast<sim::Side>(whole(value) % sim::kSides.size());
  }

  static const BoardDescription& shipped(double value) {
    return sim::kShippedBoards[whole(value) % std::size(sim::kShippedBoards)].board;
  }

  template <typename Code>
  static Code code_of(double value) {
    return static_cast<Code>(static_cast<uint8_t>(whole(value)));
  }

  /// What befalls the next frame from a host.
  enum class Impairment { kNone, kLost, kDoubled, kDelayed, kBit, kCut };

  // --- time -------------------------------------------------------------------------------------

  void run_for(double us) {
    const sim::Nanoseconds end =
        simulator_.board.now() + static_cast<sim::Nanoseconds>(std::min(us, 60e6) * 1e3);
    do {
      sim::Nanoseconds next = std::min(end, simulator_.next_event());
      while (!delayed_.empty() && delayed_.begin()->first <= simulator_.board.now()) {
        const Bytes bytes = delayed_.extract(delayed_.begin()).mapped();
        simulator_.board.line.host_write(bytes.data(), bytes.size());
      }
      if (!delayed_.empty()) next = std::min(next, delayed_.begin()->first);
      advance_to(std::max(next, simulator_.board.now()));
    } while (simulator_.board.now() < end && !ended());
  }

  void advance_to(sim::Nanoseconds end) {
    const uint64_t steps = simulator_.control_steps();
    simulator_.advance(end - simulator_.board.now());
    call(simulator_.control_steps() != steps);
  }

  /// The firmware has done something, or time has passed.
  void call(bool stepped) {
    if (dead_) {
      dead_ = false;
      witness_.forgets_task();
      reset(ResetReason::kPowerOn);
      return;
    }
    settle(true);
    if (simulator_.boot_id() != boot_id_) {
      // It restarted by itself, or the supply browned out.
      note_reset();
      return;
    }
    if (!started_ && simulator_.state() != SupervisorState::kBoot) {
      started_ = true;
      judge_.accuse(witness_.starts());
      compare_boards();
      judge_.after_start();
      return;
    }
    if (!started_) return;
    if (stepped) witness_.steps();
    judge_.after_call(stepped);
    witness_.notes_stop();
    if (witness_.last_state != simulator_.state() || stepped) witness_.note_state();
    pass_answers();
  }

  void note_reset() {
    boot_id_ = simulator_.boot_id();
    witness_.resets(sim::loses_memory(simulator_.reset_reason()));
    to_device_.forget();
    from_device_.forget();
    started_ = false;
    if (simulator_.state() != SupervisorState::kBoot) call(false);
  }

  void reset(ResetReason reason) {
    simulator_.reset(reason);
    note_reset();
  }

  void pass_answers() {
    uint8_t bytes[256];
    while (const size_t size = simulator_.board.line.host_read(bytes, sizeof bytes)) {
      to_hosts_.feed(bytes, size, [this](const Seen& seen) {
        for (Host& host : hosts_) host.receive(seen);
      });
    }
  }

  /// The firmware has handled what it read. At the end of a call it may have done more: it reads no
  /// more than so many bytes in a step.
  void settle(bool call_ended) {
    if (!witness_.task) return;
    judge_.accuse(witness_.settles());
    if (!call_ended) judge_.after_message();
    witness_.note_state();
    witness_.forgets_task();
  }

  void send(const Bytes& bytes) {
    if (bytes.empty()) return;
    Bytes sent = bytes;
    const Impairment how = impairment_;
    impairment_ = Impairment::kNone;
    switch (how) {
      case Impairment::kNone:
        break;
      case Impairment::kLost:
        return;
      case Impairment::kDoubled:
        sent.insert(sent.end(), bytes.begin(), bytes.end());
        break;
      case Impairment::kDelayed:
        delayed_.emplace(
            simulator_.board.now() + static_cast<sim::Nanoseconds>(impaired_us_ * 1000), sent);
        return;
      case Impairment::kBit:
        sent[impaired_at_ / 8 % sent.size()] ^= static_cast<uint8_t>(1U << impaired_at_ % 8);
        break;
      case Impairment::kCut:
        sent.erase(sent.begin() + static_cast<std::ptrdiff_t>(impaired_at_ % sent.size()));
        break;
    }
    simulator_.board.line.host_write(sent.data(), sent.size());
  }

  Host& host_of(const Operation& operation) {
    return hosts_[whole(operation.values[0]) % hosts_.size()];
  }

  uint32_t session_of(Host& host, int session) {
    if (session == 1) return hosts_[0].session_id() ^ hosts_[1].session_id() ^ host.session_id();
    return session == 2 ? host.session_id() + 1 : host.session_id();
  }

  template <typename Message>
  void send_request(Host& host, Message message, int ahead = 1, int session = 0) {
    message.session_id = session_of(host, session);
    message.request_id = host.request_id(ahead);
    send(host.frame(message));
  }

  /// Its arguments behind the host are the request's fields, each as wide as the others.
  void request(const Operation& operation, Host& host) {
    const KindSpec& spec = kKinds[operation.kind];
    Bytes body(static_cast<size_t>(body_size(spec.request)));
    uint8_t* out = body.data();
    wire::put(out, host.session_id());
    wire::put(out, host.request_id(1));
    const size_t fields = spec.count() - 1;
    const auto left = static_cast<size_t>(body.data() + body.size() - out);
    const size_t width = fields == 0 ? 0 : left / fields;
    for (size_t i = 1; i <= fields; ++i)
      for (size_t byte = 0; byte < width; ++byte)
        *out++ = static_cast<uint8_t>(whole(operation.values[i]) >> 8 * byte);
    send(host.frame(spec.request, body));
  }

  /// As a program that connects: a zero setpoint arms the robot, and a stop leaves its wheels free.
  /// Not as a library that reconnects by itself.
  void open(double host, bool arms) {
    carry_out(make("hello"_op, {host, 1}));
    run_for(kOpenUs);
    carry_out(make("ping"_op, {host}));
    run_for(kOpenUs);
    if (!arms) return;
    carry_out(make("velocity"_op, {host, 0, 0, kArmingUs, 1}));
    carry_out(make("stop"_op, {host, static_cast<double>(StopMode::kCoast)}));
    run_for(kOpenUs);
  }

  void carry_out(const Operation& operation) {
    Host& host = host_of(operation);
    sim::SimulatedBoard& board = simulator_.board;
    const auto& values = operation.values;
    const auto integer = [&](size_t i) { return static_cast<int>(values[i]); };
    switch (operation.kind) {
      case "run"_op:
        return run_for(values[0]);
      case "service"_op:
        if (simulator_.state() == SupervisorState::kBoot) return;
        simulator_.service_link();
        return call(false);
      case "hold"_op:
        return hold(operation);
      case "gaps"_op:
        return drive_with_gaps(operation);
      case "open"_op:
        return open(values[0], values[1] == 0.0);
      case "hello"_op:
        if (values[1] != 0.0) host.renew_nonce();
        return send(
            host.frame(Hello{host.nonce(), static_cast<uint16_t>(schema::kVersion + integer(2)),
                             schema::kHash + static_cast<uint32_t>(integer(3))}));
      case "ping"_op:
        return send(host.frame(Ping{session_of(host, integer(1)), 1, 0}));
      case "velocity"_op:
      case "duty"_op:
        return setpoint(operation);
      case "stop"_op:
        return send(host.frame(Stop{session_of(host, integer(3)), 1, host.command_seq(integer(2)),
                                    code_of<StopMode>(values[1])}));
      case "estop"_op:
        return send(host.frame(Estop{host.session_id(), 1}));
      case "clear_estop"_op:
        return send_request(host, ClearEstop{}, integer(1), integer(2));
      case "clear_fault"_op:
        return send_request(host, ClearFault{}, integer(1), integer(2));
      case "set"_op:
        return send_request(host,
                            ParameterSet{.parameter = code_of<uint8_t>(values[1]),
                                         .value = static_cast<float>(values[2])},
                            integer(3), integer(4));
      case "trial"_op:
        return send_request(host, ParameterTrial{.action = code_of<TrialAction>(values[1]),
                                                 .timeout_s = static_cast<float>(values[2])});
      case "configure"_op:
        return configure(operation, host);
      case "confirm"_op: {
        const uint32_t meant =
            witness_.configuration().fingerprint() + static_cast<uint32_t>(integer(1));
        return send_request(host, ConfigurationConfirm{.fingerprint = meant});
      }
      case "repeat"_op:
        return send(host.repeated(whole(values[1])));
      case "noise"_op: {
        sim::Random random(whole(values[1]));
        Bytes bytes(std::min<size_t>(whole(values[0]), 4000));
        for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random.next());
        board.line.host_write(bytes.data(), bytes.size());
        return;
      }
      case "impair"_op:
        impairment_ = static_cast<Impairment>(whole(values[0]) % 6);
        impaired_at_ = static_cast<uint32_t>(whole(values[1]));
        impaired_us_ = whole(values[2]);
        return;
      case "sensor"_op:
        return touch(operation);
      case "reset"_op:
        return reset(code_of<ResetReason>(std::min(values[0], 7.0)));
      case "power_cut"_op:
        cut_in_ = static_cast<int>(values[0]);
        cut_fate_ = values[1] == 0.0   ? sim::WriteFate::kUntouched
                    : values[1] == 1.0 ? sim::WriteFate::kDone
                                       : sim::WriteFate::kLost;
        return;
      case "store_fails"_op: {
        sim::Store* const stores[] = {&board.store, &board.configuration_store, &board.latch_store};
        stores[std::min<uint64_t>(whole(values[0]), 2)]->failing = values[1] != 0.0;
        return;
      }
      case "store_unreadable"_op:
        (values[1] == 0.0   ? board.store.unreadable
         : values[1] == 1.0 ? board.configuration_store.unreadable
                            : board.flash.faults) =
            static_cast<uint32_t>(whole(values[0])) &
            (fault::kStoreFull | fault::kStoreNewer | fault::kStoreUnreadable);
        return reset(ResetReason::kPowerOn);
      case "damage"_op: {
        const size_t block = whole(values[0]) % kStoredBlocks;
        const auto damage = static_cast<sim::Damage>(whole(values[1]) % 3);
        witness_.damages(static_cast<StoredBlock>(block), damage);
        stores_[block]->damage(damage);
        return reset(ResetReason::kPowerOn);
      }
      case "driver_fails"_op:
        simulator_.set_driver_failed(values[0] != 0.0);
        if (values[0] != 0.0 && started_) witness_.drivers_fail();
        return;
      case "wire"_op:
        simulator_.board_unwritten = values[1] != 0.0;
        values[0] < 0.0 ? board.wire_as_active() : board.wire(shipped(values[0]));
        board.set_floating_level(values[2] != 0.0);
        return reset(ResetReason::kPowerOn);
      default:
        if (kKinds[operation.kind].request != 0) return request(operation, host);
        return change_world(operation);
    }
  }

  void setpoint(const Operation& operation) {
    Host& host = host_of(operation);
    const auto& values = operation.values;
    const auto life_us = static_cast<int64_t>(values[3]);
    const auto expiry_us = static_cast<uint64_t>(
        std::max<int64_t>(0, static_cast<int64_t>(simulator_.board.device_us()) + life_us));
    const uint32_t session = session_of(host, static_cast<int>(values[5]));
    const uint32_t seq = host.command_seq(static_cast<int>(values[4]));
    if (operation.kind == "duty"_op) {
      send(host.frame(SetDuty{session, seq, expiry_us, q15(values[1]), q15(values[2])}));
    } else {
      send(host.frame(SetWheelVelocity{session, seq, expiry_us, static_cast<float>(values[1]),
                                       static_cast<float>(values[2])}));
    }
  }

  /// What a program does that drives: a setpoint every now and then.
  void hold(const Operation& operation) {
    const auto& values = operation.values;
    const double every_us = std::clamp(values[4], 1e3, 1e6);
    for (double left_us = std::min(values[3], 20e6); left_us > 0.0 && !ended();
         left_us -= every_us) {
      setpoint({.kind = values[5] != 0.0 ? "duty"_op : "velocity"_op,
                .values = {values[0], values[1], values[2], 2.5 * every_us, 1, 0}});
      run_for(std::min(every_us, left_us));
    }
  }

  /// As hold(), with an encoder that loses all edges for a while, again and again.
  void drive_with_gaps(const Operation& operation) {
    const auto& values = operation.values;
    const sim::Side side = side_of(values[3]);
    sim::EncoderModel& model = simulator_.board.encoders[side].model;
    const double of_us = std::clamp(values[5], 1e3, 1e6);
    const double lost_us = std::clamp(values[4], 0.0, of_us);
    const sim::PlantModel& plant = simulator_.board.plant.model();
    disturb();
    // What the firmware is known to notice.
    world_.loses_in_gaps[side] = lost_us >= 0.7 * of_us && of_us >= 10e3 && of_us <= 30e3 &&
                                 std::abs(values[1]) >= 0.2 && plant.bridge.supply_v == 7.4 &&
                                 plant.supply_ohm == 0.0 && plant.slope_rad == 0.0 &&
                                 witness_.value(ParameterId::kMaxDuty) == 1.0f;
    world_.has_gaps[side] = lost_us > 0.0;
    double since_setpoint_us = 50e3;
    for (double left_us = std::min(values[2], 20e6); left_us > 0.0 && !ended(); left_us -= of_us) {
      if (since_setpoint_us >= 50e3) {
        setpoint({.kind = "velocity"_op,
                  .values = {values[0], values[1], values[1], 50e3 + 3 * of_us, 1, 0}});
        since_setpoint_us = 0.0;
      }
      model.lost = 1.0;
      run_for(lost_us);
      model.lost = 0.0;
      run_for(of_us - lost_us);
      since_setpoint_us += of_us;
    }
    world_.loses_in_gaps[side] = world_.has_gaps[side] = false;
    disturb();
  }

  /// Board -1: the active one.
  void configure(const Operation& operation, Host& host) {
    Configuration wanted{.board = witness_.board(),
                         .peripherals = kListed[whole(operation.values[2]) % kLists]};
    if (operation.values[1] >= 0.0) wanted.board = shipped(operation.values[1]);
    const auto damage = static_cast<int>(operation.values[3]);
    if (damage == 2) wanted.board.left_encoder_a = wanted.board.left_encoder_b;
    if (damage == 3) wanted.board.stage = static_cast<Stage>(kStages);
    uint8_t body[BoardSet::kSize] = {};
    wanted.board.encode(body + BoardSet::kSize - BoardDescription::kSize);
    send_request(host, BoardSet::decode(body));
    const PeripheralList& list = wanted.peripherals;
    for (uint8_t i = 0; i < list.count; ++i) {
      uint8_t entry[PeripheralSet::kSize];
      PeripheralSet{.channel = damage == 4 ? static_cast<uint8_t>(kMostPeripherals) : i}.encode(
          entry);
      list.entries[i].encode(entry + PeripheralSet::kSize - Peripheral::kSize);
      send_request(host, PeripheralSet::decode(entry));
    }
    send_request(host,
                 ConfigurationWrite{.peripheral_count = list.count,
                                    .fingerprint = wanted.fingerprint() + (damage == 1 ? 1 : 0)});
  }

  void disturb() {
    world_.disturbed_us = static_cast<uint64_t>(simulator_.board.now() / 1000);
    world_.ever_disturbed = true;
  }

  void touch(const Operation& operation) {
    sim::Sensors& sensors = simulator_.board.sensors;
    // Earlier triggers count for a while.
    witness_.notes_touch();
    bool* const inputs[] = {&sensors.bumpers[static_cast<size_t>(Place::kFrontLeft)],
                            &sensors.bumpers[static_cast<size_t>(Place::kFrontRight)],
                            &sensors.bumpers[static_cast<size_t>(Place::kRear)],
                            &sensors.cliffs[static_cast<size_t>(Place::kFront)],
                            &sensors.stage_fault};
    static_assert(std::size(inputs) == static_cast<size_t>(Sensed::kCount));
    *inputs[whole(operation.values[0]) % std::size(inputs)] = operation.values[1] != 0.0;
    witness_.notes_touch();
  }

  /// An operation that sets variables of the simulator, `*` those of the side that comes first.
  struct Setting {
    Kind kind;
    std::array<const char*, 3> variables;
  };
  static constexpr Setting kSettings[] = {
      {"baud"_op, {"baud_rate"}},
      {"contact"_op, {"estop_open"}},
      {"boot_time"_op, {"boot_time_us"}},
      {"late"_op, {"control_delay_us"}},
      {"clock"_op, {"clock_ppm"}},
      {"supply"_op, {"supply_v", "supply_ohm", "brownout_v"}},
      {"battery"_op, {"battery_v"}},
      {"slope"_op, {"slope_rad"}},
      {"free"_op, {"wheels_free"}},
      {"load"_op, {"*.load_nm"}},
      {"push"_op, {"*.hand_turns"}},
      {"blocked"_op, {"*.blocked"}},
      {"motor"_op, {"*.motor_reversed", "*.motor_open", "*.motor_scale"}},
      {"encoder"_op, {"*.encoder_dead", "*.encoder_reversed", "*.stuck_channel"}},
      {"lost_edges"_op, {"*.encoder_lost", "*.encoder_error_ticks"}},
      {"swaps"_op, {"motors_swapped", "encoders_swapped"}},
      {"counts"_op, {"counts_per_revolution"}},
  };

  void change_world(Operation operation) {
    const Kind kind = operation.kind;
    if (kind == "late"_op || kind >= "supply"_op) disturb();
    if (kind == "push"_op) world_.turned_by_hand_us = world_.disturbed_us;
    if (kind == "encoder"_op || kind == "swaps"_op) world_.changed_encoders = true;
    if (kind == "motor"_op && operation.values[3] == 0.0) operation.values[3] = 1.0;
    const auto setting = std::ranges::find(kSettings, kind, &Setting::kind);
    const bool is_of_side = *setting->variables[0] == '*';
    const char* const side = side_of(operation.values[0]) == sim::kLeft ? "left" : "right";
    for (size_t i = 0; i < setting->variables.size() && setting->variables[i] != nullptr; ++i) {
      const std::string name = setting->variables[i];
      sim::set_variable(simulator_, is_of_side ? side + name.substr(1) : name,
                        operation.values[is_of_side ? i + 1 : i]);
    }
  }

  /// Whether the firmware believes in the board that is there. Without one it sees no wheel.
  void compare_boards() {
    world_.wired_as_believed = witness_.configuration_state != ConfigurationState::kDamaged &&
                               (simulator_.board.is_wired_as_active() ||
                                checksum(simulator_.board.wired()) == checksum(witness_.board()));
  }

  bool ended() const { return judge_.finding().has_value() || witness_.lost_track; }

  sim::Simulator simulator_;
  /// By StoredBlock.
  std::array<sim::Store*, kStoredBlocks> stores_{&simulator_.board.configuration_store,
                                                 &simulator_.board.store,
                                                 &simulator_.board.latch_store};
  Witness witness_{simulator_};
  World world_;
  Judge judge_{simulator_, witness_, world_};
  Coverage coverage_;
  std::array<Host, 2> hosts_;
  WireDecoder to_device_;
  WireDecoder from_device_;
  WireDecoder to_hosts_;
  std::multimap<sim::Nanoseconds, Bytes> delayed_;  ///< On their way to the device.
  Impairment impairment_ = Impairment::kNone;
  uint32_t impaired_at_ = 0;
  uint64_t impaired_us_ = 0;
  int cut_in_ = -1;  ///< Writes until the power goes; -1: never.
  sim::WriteFate cut_fate_ = sim::WriteFate::kUntouched;
  bool dead_ = false;  ///< The power went in the middle of what the firmware was doing.
  bool started_ = false;
  uint32_t boot_id_;
};

}  // namespace wheelwire::explore
