#include "run.hpp"

#include <algorithm>
#include <cmath>

#include "boards.hpp"
#include "peripheral_lists.hpp"
#include "reset_reason.hpp"

namespace wheelwire::explore {

namespace {

constexpr double kOpenUs = 3'000;
constexpr uint64_t kArmingUs = 100'000;

int16_t q15(double duty) {
  if (!std::isfinite(duty)) return INT16_MIN;
  return static_cast<int16_t>(std::clamp(std::lround(duty * 32767.0), -32768L, 32767L));
}

uint64_t whole(double value) { return value > 0.0 ? static_cast<uint64_t>(value) : 0; }

sim::Side side_of(double value) {
  return static_cast<sim::Side>(whole(value) % sim::kSides.size());
}

template <typename Code>
Code code_of(double value) {
  return static_cast<Code>(static_cast<uint8_t>(whole(value)));
}

}  // namespace

Run::Run(const Scenario& scenario, Coverage& coverage)
    : simulator_(scenario.seed),
      judge_(simulator_, witness_, world_, scenario.excepted),
      coverage_(coverage),
      hosts_{Host(static_cast<uint32_t>(sim::mix(scenario.seed))),
             Host(static_cast<uint32_t>(sim::mix(scenario.seed + 1)))},
      boot_id_(simulator_.boot_id()) {
  simulator_.board.line.set_tap(this);
  for (sim::Store* const store : stores_) store->watch = this;
  simulator_.board.recorder_flash.watch = this;
}

// --- time ----------------------------------------------------------------------------------------

void Run::run_for(double us) {
  const sim::Nanoseconds end =
      simulator_.board.now() + static_cast<sim::Nanoseconds>(std::min(us, 60e6) * 1e3);
  do {
    sim::Nanoseconds next = std::min(end, simulator_.next_event());
    while (!delayed_.empty() && delayed_.front().due <= simulator_.board.now()) {
      const Bytes bytes = delayed_.front().bytes;
      delayed_.pop_front();
      simulator_.board.line.host_write(bytes.data(), bytes.size());
    }
    if (!delayed_.empty()) next = std::min(next, delayed_.front().due);
    advance_to(std::max(next, simulator_.board.now()));
  } while (simulator_.board.now() < end && !ended());
}

void Run::advance_to(sim::Nanoseconds end) {
  const uint64_t steps = simulator_.control_steps();
  simulator_.advance(end - simulator_.board.now());
  call(simulator_.control_steps() != steps);
}

/// The firmware has done something, or time has passed.
void Run::call(bool stepped) {
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
    coverage_.count("board", name_of(witness_.board()) + ", " + name_of(simulator_.board.wired()) +
                                 ", " + name_of(witness_.configuration_state()));
    judge_.after_start();
    return;
  }
  if (!started_) return;
  const char* const battery = stepped ? witness_.steps() : nullptr;
  if (battery != nullptr) coverage_.count("battery", battery);
  judge_.after_call(stepped);
  witness_.notes_stop();
  if (witness_.last_state() != simulator_.state() || stepped) witness_.note_state();
  pass_answers();
}

void Run::note_reset() {
  const ResetReason reason = simulator_.reset_reason();
  boot_id_ = simulator_.boot_id();
  coverage_.count("reset", name_of(reason) + " " + name_of(witness_.last_state()));
  witness_.resets(sim::loses_memory(reason));
  to_device_.forget();
  from_device_.forget();
  started_ = false;
  if (simulator_.state() != SupervisorState::kBoot) call(false);
}

void Run::reset(ResetReason reason) {
  simulator_.reset(reason);
  note_reset();
}

void Run::pass_answers() {
  uint8_t bytes[256];
  while (const size_t size = simulator_.board.line.host_read(bytes, sizeof bytes)) {
    for (size_t i = 0; i < hosts_.size(); ++i)
      to_host_[i].feed(bytes, size, [&](const Seen& seen) { hosts_[i].receive(seen); });
  }
}

// --- the line ------------------------------------------------------------------------------------

void Run::on_read(const uint8_t* data, size_t size) {
  if (dead_) return;
  settle(false);
  to_device_.feed(data, size, [this](const Seen& seen) {
    judge_.before_message();
    witness_.note_state();
    witness_.reads(seen);
    world_.handled = true;
  });
}

/// The firmware has handled what it read. At the end of a call it may have done more: it reads no
/// more than so many bytes in a step.
void Run::settle(bool call_ended) {
  if (!witness_.task()) return;
  judge_.accuse(witness_.settles());
  const Task& task = *witness_.task();
  if (task.carried_out)
    coverage_.count("carried out", name_of_message(task.message.id) + " " + name_of(task.before));
  if (!call_ended) judge_.after_message();
  witness_.note_state();
  witness_.forgets_task();
}

void Run::on_write(const uint8_t* data, size_t size) {
  if (dead_) return;
  from_device_.feed(data, size, [this](const Seen& seen) {
    judge_.accuse(witness_.sends(seen));
    if (seen.id == WheelState::kId) judge_.on_state(seen.as<WheelState>());
    if (seen.id == Event::kId) {
      const auto event = seen.as<Event>();
      if (event.code == EventCode::kSupervisor)
        coverage_.count("transition", name_of(event.before) + " " + name_of(event.cause));
      judge_.on_event(event);
    }
    if (seen.id == Refuse::kId) {
      const auto refuse = seen.as<Refuse>();
      coverage_.count("refusal", name_of_message(refuse.message_id) + " " + name_of(refuse.code));
    }
  });
}

void Run::send(const Bytes& bytes) {
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
    case Impairment::kDelayed: {
      const sim::Nanoseconds due =
          simulator_.board.now() + static_cast<sim::Nanoseconds>(impaired_us_ * 1000);
      const auto later = std::find_if(delayed_.begin(), delayed_.end(),
                                      [due](const Delayed& other) { return other.due > due; });
      delayed_.insert(later, {due, sent});
      return;
    }
    case Impairment::kBit:
      sent[impaired_at_ / 8 % sent.size()] ^= static_cast<uint8_t>(1U << impaired_at_ % 8);
      break;
    case Impairment::kCut:
      sent.erase(sent.begin() + static_cast<std::ptrdiff_t>(impaired_at_ % sent.size()));
      break;
  }
  simulator_.board.line.host_write(sent.data(), sent.size());
}

// --- flash ---------------------------------------------------------------------------------------

sim::WriteFate Run::fate_of_write(const sim::Store& store, int slot) {
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

void Run::on_flash() {
  if (dead_) return;
  world_.writes_flash = true;
  judge_.flash_only_at_rest(false);
}

// --- operations ----------------------------------------------------------------------------------

bool Run::apply(const Operation& operation) {
  const auto& values = operation.values;
  switch (operation.kind) {
    case "run"_op:
      run_for(values[0]);
      break;
    case "service"_op:
      if (simulator_.state() == SupervisorState::kBoot) break;
      simulator_.service_link();
      call(false);
      break;
    case "hold"_op:
      hold(operation);
      break;
    case "gaps"_op:
      drive_with_gaps(operation);
      break;
    default:
      if (operation.kind >= "open"_op && operation.kind <= "repeat"_op) {
        message(operation);
      } else {
        change_robot(operation);
      }
  }
  return !ended();
}

Host& Run::host_of(const Operation& operation) {
  return hosts_[whole(operation.values[0]) % hosts_.size()];
}

uint32_t Run::session_of(Host& host, int session) {
  if (session == 1) return hosts_[0].session_id() ^ hosts_[1].session_id() ^ host.session_id();
  return session == 2 ? host.session_id() + 1 : host.session_id();
}

template <typename Message>
void Run::send_request(Host& host, Message message, int ahead, int session) {
  message.session_id = session_of(host, session);
  message.request_id = host.request_id(ahead);
  send(host.frame(message));
}

/// As a program that connects: a zero setpoint arms the robot, and a stop leaves its wheels free.
/// Not as a library that reconnects by itself.
void Run::open(Host& host, bool arms) {
  host.renew_nonce();
  send(host.frame(Hello{host.nonce(), schema::kVersion, schema::kHash}));
  run_for(kOpenUs);
  send(host.frame(Ping{host.session_id(), 1, 0}));
  run_for(kOpenUs);
  if (!arms) return;
  const uint64_t expiry_us = simulator_.board.device_us() + kArmingUs;
  send(host.frame(SetWheelVelocity{host.session_id(), host.command_seq(1), expiry_us, 0.0f, 0.0f}));
  send(host.frame(Stop{host.session_id(), 1, host.command_seq(0), StopMode::kCoast}));
  run_for(kOpenUs);
}

void Run::message(const Operation& operation) {
  Host& host = host_of(operation);
  const auto& values = operation.values;
  const auto integer = [&](size_t i) { return static_cast<int>(values[i]); };
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(whole(values[i])); };
  switch (operation.kind) {
    case "open"_op:
      return open(host, values[1] == 0.0);
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
    case "stream_rate"_op:
      return send_request(host, SetStreamRate{.rate_hz = static_cast<uint16_t>(whole(values[1]))});
    case "get"_op:
      return send_request(host, ParameterGet{.parameter = byte(1)});
    case "set"_op:
      return send_request(
          host, ParameterSet{.parameter = byte(1), .value = static_cast<float>(values[2])},
          integer(3), integer(4));
    case "save"_op:
      return send_request(host, ParameterSave{.parameter = byte(1)});
    case "reset_parameters"_op:
      return send_request(host, ParameterReset{});
    case "list"_op:
      return send_request(host, ParameterList{.parameter_index = byte(1)});
    case "link_counters"_op:
      return send_request(host, LinkCountersGet{});
    case "control_counters"_op:
      return send_request(host, ControlCountersGet{});
    case "trial"_op:
      return send_request(host, ParameterTrial{.action = code_of<TrialAction>(values[1]),
                                               .timeout_s = static_cast<float>(values[2])});
    case "group"_op:
      return send_request(host, GroupGet{.group = code_of<Group>(values[1])});
    case "contradictions"_op:
      return send_request(host, ContradictionsGet{});
    case "hold_get"_op:
      return send_request(host, HoldGet{});
    case "restart"_op:
      return send_request(host, Restart{});
    case "configuration_get"_op:
      return send_request(host, ConfigurationGet{});
    case "configure"_op:
      return configure(operation, host);
    case "confirm"_op: {
      const uint32_t meant =
          witness_.configuration().fingerprint() + static_cast<uint32_t>(integer(1));
      return send_request(host, ConfigurationConfirm{.fingerprint = meant});
    }
    case "box_get"_op:
      return send_request(host, BoxGet{.age = byte(1)});
    case "box_read"_op:
      return send_request(host, BoxRead{.number = static_cast<uint32_t>(whole(values[1])),
                                        .offset = static_cast<uint32_t>(whole(values[2]))});
    case "ledger"_op:
      return send_request(host, LedgerGet{});
    case "unsaved"_op:
      return send_request(host, UnsavedGet{});
    case "memory"_op:
      return send_request(host, MemoryGet{});
    case "sensor_stream"_op:
      return send_request(host, SensorStream{.rate_hz = static_cast<uint16_t>(whole(values[1]))});
    case "peripheral_get"_op:
      return send_request(host, PeripheralGet{.channel = byte(1)});
    case "repeat"_op:
      return send(host.repeated(whole(values[1])));
    default:
      return;
  }
}

void Run::setpoint(const Operation& operation) {
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
void Run::hold(const Operation& operation) {
  const auto& values = operation.values;
  const double every_us = std::clamp(values[4], 1e3, 1e6);
  for (double left_us = std::min(values[3], 20e6); left_us > 0.0 && !ended(); left_us -= every_us) {
    setpoint({.kind = values[5] != 0.0 ? "duty"_op : "velocity"_op,
              .values = {values[0], values[1], values[2], 2.5 * every_us, 1, 0}});
    run_for(std::min(every_us, left_us));
  }
}

/// As hold(), with an encoder that loses all edges for a while, again and again.
void Run::drive_with_gaps(const Operation& operation) {
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
void Run::configure(const Operation& operation, Host& host) {
  const auto& boards = shipped_boards();
  Configuration wanted{.board = witness_.board(),
                       .peripherals = kListed[whole(operation.values[2]) % kLists]};
  if (operation.values[1] >= 0.0) wanted.board = boards[whole(operation.values[1]) % boards.size()];
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

void Run::disturb(bool lasts) {
  world_.disturbed_us = static_cast<uint64_t>(simulator_.board.now() / 1000);
  world_.ever_disturbed = world_.ever_disturbed || lasts;
}

void Run::change_robot(const Operation& operation) {
  const auto& values = operation.values;
  sim::SimulatedBoard& board = simulator_.board;
  switch (operation.kind) {
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
    case "baud"_op:
      board.line.set_baud(static_cast<uint32_t>(whole(values[0])));
      return;
    case "contact"_op:
      board.estop.open = values[0] != 0.0;
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
      using enum StoredBlock;
      constexpr StoredBlock kBlocks[] = {kParameterValues, kConfiguration, kLatches};
      const StoredBlock block = kBlocks[std::min<uint64_t>(whole(values[0]), kStoredBlocks - 1)];
      stores_[static_cast<size_t>(block)]->failing = values[1] != 0.0;
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
    case "boot_time"_op:
      simulator_.boot_time_us = std::min<uint64_t>(whole(values[0]), 1'000'000);
      return;
    case "late"_op:
      disturb();
      simulator_.delay_control(std::min<uint64_t>(whole(values[0]), 5'000'000));
      return;
    case "clock"_op:
      board.clock.set_ppm(std::clamp(values[0], -10'000.0, 10'000.0), board.now());
      return;
    case "wire"_op:
      simulator_.board_unwritten = values[1] != 0.0;
      wire(static_cast<int>(values[0]));
      board.set_floating_level(values[2] != 0.0);
      return reset(ResetReason::kPowerOn);
    case "battery"_op:
      disturb();
      board.battery.volts = std::clamp(values[0], 0.0, 60.0);
      return;
    case "lost_edges"_op: {
      disturb();
      sim::EncoderModel& model = board.encoders[side_of(values[0])].model;
      model.lost = std::clamp(values[1], 0.0, 1.0);
      model.edge_error_ticks = std::clamp(values[2], 0.0, 0.45);
      return;
    }
    case "encoder"_op: {
      disturb();
      world_.changed_encoders = true;
      sim::EncoderModel& model = board.encoders[side_of(values[0])].model;
      model.dead = values[1] != 0.0;
      model.reversed = values[2] != 0.0;
      model.stuck = static_cast<int>(whole(values[3]) % 3);
      return;
    }
    case "counts"_op:
      disturb();
      board.counts_per_revolution = static_cast<int>(std::clamp(values[0], 4.0, 200'000.0));
      return;
    default:
      return change_plant(operation);
  }
}

void Run::touch(const Operation& operation) {
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

void Run::change_plant(const Operation& operation) {
  disturb();
  const auto& values = operation.values;
  sim::Plant& plant = simulator_.board.plant;
  sim::PlantModel model = plant.model();
  sim::WheelModel& wheel = model.wheels[side_of(values[0])];
  switch (operation.kind) {
    case "supply"_op:
      model.bridge.supply_v = std::clamp(values[0], 0.0, 60.0);
      model.supply_ohm = std::clamp(values[1], 0.0, 20.0);
      simulator_.board.brownout_v = std::clamp(values[2], 0.0, 60.0);
      break;
    case "slope"_op:
      model.slope_rad = std::clamp(values[0], -0.5, 0.5);
      break;
    case "free"_op:
      model.wheels_free = values[0] != 0.0;
      break;
    case "load"_op:
      wheel.load_nm = std::clamp(values[1], -1.0, 1.0);
      break;
    case "push"_op:
      plant.turn_by_hand(side_of(values[0]),
                         std::clamp(values[1], -100.0, 100.0) * 6.28318530717958647692);
      world_.turned_by_hand_us = world_.disturbed_us;
      return;
    case "blocked"_op:
      wheel.blocked = values[1] != 0.0;
      break;
    case "motor"_op:
      wheel.motor_reversed = values[1] != 0.0;
      wheel.motor_open = values[2] != 0.0;
      wheel.motor_scale = std::clamp(values[3] == 0.0 ? 1.0 : values[3], 0.5, 2.0);
      break;
    case "swaps"_op:
      world_.changed_encoders = true;
      model.motors_swapped = values[0] != 0.0;
      simulator_.board.wiring.swapped = values[1] != 0.0;
      break;
    default:
      return;
  }
  if (sim::is_physical(model)) plant.configure(model);
}

void Run::wire(int board) {
  if (board < 0) return simulator_.board.wire_as_active();
  const auto& boards = shipped_boards();
  simulator_.board.wire(boards[static_cast<size_t>(board) % boards.size()]);
}

/// Whether the firmware believes in the board that is there. Without one it sees no wheel.
void Run::compare_boards() {
  world_.wired_as_believed = witness_.configuration_state() != ConfigurationState::kDamaged &&
                             (simulator_.board.is_wired_as_active() ||
                              checksum(simulator_.board.wired()) == checksum(witness_.board()));
}

}  // namespace wheelwire::explore
