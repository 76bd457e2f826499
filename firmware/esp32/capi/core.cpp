// The C interface of the core. It is linked against libc alone, without a C++ runtime.
#include <stdlib.h>

#include <new>
#include <optional>

#include "configuration.hpp"
#include "device.hpp"
#include "host_sensors.hpp"
#include "ports.hpp"
#include "power_stage.hpp"
#include "recorder_keeper.hpp"
#include "sensor_server.hpp"

using namespace wheelwire;
using namespace wheelwire::capi;

/// The C++ runtime's handler for a call of a pure virtual function.
extern "C" [[noreturn]] __attribute__((visibility("hidden"))) void __cxa_pure_virtual() { abort(); }

namespace {

/// Apart from the core, for few cores have one.
struct CoreRecorder {
  static_assert(WHEELWIRE_RECORDER_SIZE == RecorderKeeper::kFlashSize);

  CoreRecorder(const uint8_t* content, wheelwire_write forward, void* context)
      : flash(content, forward, context) {}

  void start(const Identity& identity, uint32_t board) {
    keeper.emplace(memory, flash, origin_of(identity), identity.reset_reason, board);
    keeper->start();
  }

  RecorderFlash flash;
  RecorderMemory memory{};
  std::optional<RecorderKeeper> keeper;  // From the start on.
};

}  // namespace

struct wheelwire_sensors {
  explicit wheelwire_sensors(const PeripheralList& list) : port(list) {}

  HostSensors port;
};

struct wheelwire_core {
  wheelwire_core(const wheelwire_identity& given, const uint8_t* block, size_t size,
                 wheelwire_save save, void* context)
      : identity{}, store(block, size, save, context) {
    identity.boot_id = given.boot_id;
    identity.reset_reason = static_cast<ResetReason>(given.reset_reason);
    identity.board = static_cast<Chip>(given.board);
    identity.board_id = given.board_id;
    identity.capabilities = given.capabilities;
    identity.version_major = WHEELWIRE_VERSION_MAJOR;
    identity.version_minor = WHEELWIRE_VERSION_MINOR;
    identity.version_patch = WHEELWIRE_VERSION_PATCH;
    identity.git_hash = WHEELWIRE_GIT_HASH;
    platform_specs(identity.board, specs);
  }

  Hal hal() {
    return {.left_motor = *left_motor,
            .right_motor = *right_motor,
            .encoders = encoders,
            .line = line,
            .store = store.parameters(),
            .latches = latches,
            .latch_store = no_store,
            .estop = contact,
            .battery = battery};
  }

  void read(const wheelwire_inputs& inputs) {
    encoders.counts = {.t_us = inputs.now_us,
                       .left = left_counter.update(inputs.left_ticks),
                       .right = right_counter.update(inputs.right_ticks),
                       .left_illegal = inputs.left_illegal,
                       .right_illegal = inputs.right_illegal};
    contact.open = inputs.contact_open != 0;
    battery.mv = inputs.battery_mv;
    if (sensors != nullptr) sensors->port.begin_step(inputs.now_us, inputs.levels);
  }

  /// What the caller has given cannot be changed by a host.
  void start_device() {
    if (!given_configuration) {
      device.emplace(hal(), identity, specs);
      return;
    }
    configuration.emplace(nullptr, given_configuration->board.chip, &*given_configuration,
                          ActiveConfiguration::BuiltIn::kConfirmed);
    configuration->start();
    device.emplace(hal(), identity, specs, *configuration);
    if (sensors == nullptr) return;
    sensor_server.emplace(configuration->peripherals(), &sensors->port, nullptr);
    device->sense(*sensor_server);
  }

  void write(wheelwire_outputs& outputs) const {
    outputs = {};
    outputs.left = left_pins.inputs();
    outputs.right = right_pins.inputs();
    if (!device) return;
    outputs.deadline_us = device->deadline_us();
    outputs.period_us = device->control_period_us();
    outputs.faults = device->faults();
    outputs.state = static_cast<uint8_t>(device->state());
  }

  Identity identity;
  ParameterSpec specs[kParameterCount];
  Pins left_pins;
  Pins right_pins;
  std::optional<PowerStage> left_motor{std::in_place, left_pins};
  std::optional<PowerStage> right_motor{std::in_place, right_pins};
  TickCounter left_counter;
  TickCounter right_counter;
  GivenEncoders encoders;
  Line line;
  Store store;
  LatchRecord latches;
  NoStore no_store;  // The caller's record is enough.
  GivenContact contact;
  GivenBattery battery;
  std::optional<Configuration> given_configuration;  // Once it was given.
  wheelwire_sensors* sensors = nullptr;
  std::optional<ActiveConfiguration> configuration;
  std::optional<SensorServer> sensor_server;
  CoreRecorder* recorder = nullptr;
  bool failed = false;
  std::optional<Device> device;  // From wheelwire_core_start() on.
};

uint32_t wheelwire_abi(void) { return WHEELWIRE_ABI; }

uint32_t wheelwire_schema_hash(void) { return schema::kHash; }

wheelwire_core* wheelwire_core_create(const wheelwire_identity* identity, const uint8_t* block,
                                      size_t size, wheelwire_save save, void* context) {
  void* const memory = malloc(sizeof(wheelwire_core));
  if (memory == nullptr) return nullptr;
  return new (memory) wheelwire_core(*identity, block, size, save, context);
}

void wheelwire_core_destroy(wheelwire_core* core) {
  if (core != nullptr) free(core->recorder);
  free(core);
}

uint8_t wheelwire_core_board(wheelwire_core* core, const uint8_t* packed, size_t size) {
  Configuration configuration;
  BoardFault fault = BoardFault::kDamaged;
  if (Configuration::decode(packed, size, configuration))
    fault = first_issue(configuration.board).fault;
  if (fault != BoardFault::kNone) return static_cast<uint8_t>(fault);
  const StageTable& stage = *table_of(configuration.board.stage);
  core->left_motor.emplace(core->left_pins, stage);
  core->right_motor.emplace(core->right_pins, stage);
  apply_board(configuration.board, core->specs);
  core->given_configuration = configuration;
  return 0;
}

size_t wheelwire_sensors_size(void) { return sizeof(wheelwire_sensors); }

wheelwire_sensors* wheelwire_sensors_create(void* memory, const uint8_t* packed, size_t size) {
  Configuration configuration;
  if (!Configuration::decode(packed, size, configuration)) return nullptr;
  return new (memory) wheelwire_sensors(configuration.peripherals);
}

uint64_t wheelwire_sensors_poll(wheelwire_sensors* sensors, int bus, uint64_t now_us,
                                wheelwire_transfer transfer, void* context) {
  return sensors->port.poll(bus, now_us, transfer, context);
}

uint8_t wheelwire_core_sense(wheelwire_core* core, wheelwire_sensors* sensors) {
  if (!core->given_configuration) return static_cast<uint8_t>(PeripheralFault::kNotOnThisChip);
  const PeripheralFault fault =
      first_issue(sensors->port.list(), core->given_configuration->board).fault;
  if (fault == PeripheralFault::kNone) core->sensors = sensors;
  return static_cast<uint8_t>(fault);
}

uint8_t wheelwire_core_preset(wheelwire_core* core, uint8_t parameter, float value) {
  const auto id = static_cast<ParameterId>(parameter);
  const RefusalCode refusal = Parameters(core->specs).set(id, value);
  if (refusal == RefusalCode::kNone) core->specs[parameter - 1].default_value = value;
  return static_cast<uint8_t>(refusal);
}

void wheelwire_core_latches(wheelwire_core* core, const uint8_t* record, size_t size,
                            wheelwire_save save, void* context) {
  core->latches.use(record, size, save, context);
}

int wheelwire_core_recorder(wheelwire_core* core, const uint8_t* content, wheelwire_write write,
                            void* context) {
  void* const memory = malloc(sizeof(CoreRecorder));
  if (memory == nullptr) return 0;
  free(core->recorder);
  core->recorder = new (memory) CoreRecorder(content, write, context);
  return 1;
}

void wheelwire_core_start(wheelwire_core* core, const wheelwire_inputs* inputs,
                          wheelwire_outputs* outputs) {
  core->left_counter.start(inputs->left_ticks);
  core->right_counter.start(inputs->right_ticks);
  core->read(*inputs);
  core->start_device();
  if (core->failed) core->device->report_driver_failure();
  core->device->start(inputs->now_us);
  if (core->recorder != nullptr) {
    core->recorder->start(core->identity,
                          core->configuration ? core->configuration->fingerprint() : 0);
    core->device->record(core->recorder->keeper->black_box());
    core->device->offer(*core->recorder->keeper);
  }
  core->write(*outputs);
}

void wheelwire_core_step(wheelwire_core* core, const wheelwire_inputs* inputs,
                         wheelwire_outputs* outputs) {
  core->read(*inputs);
  if (core->device) {
    core->device->step(inputs->now_us);
    if (core->recorder != nullptr) core->recorder->keeper->step(*core->device, inputs->now_us);
  }
  core->write(*outputs);
}

void wheelwire_core_service(wheelwire_core* core, uint64_t now_us, wheelwire_outputs* outputs) {
  if (core->device) core->device->service_link(now_us);
  core->write(*outputs);
}

void wheelwire_core_hang_up(wheelwire_core* core, uint64_t now_us, wheelwire_outputs* outputs) {
  core->line.received.clear();
  core->line.to_send.clear();
  if (core->device) core->device->hang_up(now_us);
  core->write(*outputs);
}

float wheelwire_core_value(const wheelwire_core* core, uint8_t parameter) {
  const auto id = static_cast<ParameterId>(parameter);
  return core->device && Parameters::exists(id) ? core->device->parameter(id) : 0.0f;
}

void wheelwire_core_fail(wheelwire_core* core) {
  core->failed = true;
  if (core->device) core->device->report_driver_failure();
}

size_t wheelwire_core_feed(wheelwire_core* core, const uint8_t* data, size_t size) {
  const size_t room = core->line.received.room();
  if (size > room) size = room;
  core->line.received.put(data, size);
  return size;
}

size_t wheelwire_core_take(wheelwire_core* core, uint8_t* out, size_t capacity) {
  return core->line.to_send.take(out, capacity);
}
