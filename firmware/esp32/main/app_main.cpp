// Start-up. All memory is static; the IDF's drivers allocate what they need in here, or as the
// tasks begin.
#include "adc.hpp"
#include "control_task.hpp"
#include "device.hpp"
#include "drive_watchdog.hpp"
#include "either_line.hpp"
#include "esp_attr.h"
#include "esp_core_dump.h"
#include "housekeeping.hpp"
#include "identity.hpp"
#include "image_board.hpp"
#include "latch_memory.hpp"
#include "line.hpp"
#include "nvs_store.hpp"
#include "partition_flash.hpp"
#include "pins.hpp"
#include "recorder_keeper.hpp"
#include "sdkconfig.h"
#include "sensor_server.hpp"
#include "sensors.hpp"
#include "soc/soc_caps.h"
#include "task_watchdog.hpp"
#include "twin_store.hpp"

#if CONFIG_WHEELWIRE_SIMULATED_PLANT
#include "simulated_robot.hpp"
using Machine = wheelwire::SimulatedRobot;
#else
#include "wired_robot.hpp"
using Machine = wheelwire::WiredRobot;
#endif

#if CONFIG_WHEELWIRE_SELF_TEST
#include "self_test_line.hpp"
#endif

namespace wheelwire {
namespace {

// Earlier firmware used the same keys, so its blocks are found and refused.
NvsStore slots[kStoredBlocks][2]{{NvsStore{"board.0"}, NvsStore{"board.1"}},
                                 {NvsStore{"parameters.0"}, NvsStore{"parameters.1"}},
                                 {NvsStore{"latch.0"}, NvsStore{"latch.1"}}};
TwinStore configuration_store{slots[0][0], slots[0][1]};
TwinStore store{slots[1][0], slots[1][1]};
TwinStore latch_store{slots[2][0], slots[2][1]};
RtcLatchMemory latches;
PartitionFlash recorder_flash;
/// Start-up code leaves it as it is, so that what was recorded outlives a panic and a watchdog.
__NOINIT_ATTR RecorderMemory recorder_memory;
const Configuration kImageConfiguration{.board = kImageBoard, .peripherals = {}};
ActiveConfiguration configuration{&configuration_store, kImageBoard.chip, &kImageConfiguration};
ParameterSpec specs[kParameterCount];
Adc adc;
Battery battery;
Sensors sensors;
DeadMan dead_man;
SharedState shared_state;
LatestBattery latest_battery{shared_state};
Housekeeping housekeeping{battery, sensors.analog(), shared_state};

/// Some peripherals need parameters before they start. The device loads them again.
Parameters stored_parameters() {
  Parameters parameters{specs};
  parameters.load(store);
  return parameters;
}

uint32_t capabilities(bool has_battery) {
  const bool has_core_dump = esp_core_dump_image_check() == ESP_OK;
  return Machine::kCapabilities | capability::kRestart | (has_battery ? capability::kBattery : 0) |
         (has_core_dump ? capability::kCoreDump : 0);
}

/// Decides which board is active. False: its pins cannot be set up.
bool choose_board() {
  configuration.start();
  platform_specs(kImageBoard.chip, specs);
  if (configuration.is_confirmed()) apply_board(configuration.board(), specs);
  return take_pins(configuration.state(), configuration.board());
}

/// The line to the host. It is unknown while the image's own board is active, or no board.
Line& choose_line() {
  static UartLine uart;
#if SOC_USB_SERIAL_JTAG_SUPPORTED
  static UsbLine usb;
  static EitherLine either{uart, usb};
  switch (configuration.state()) {
    case ConfigurationState::kTrial:
    case ConfigurationState::kStored:
      if (configuration.board().line == BoardLine::kUsb) return usb;
      return uart;
    case ConfigurationState::kDamaged:
    case ConfigurationState::kBuiltIn:
      return either;
  }
#endif
  return uart;
}

void start() {
  const bool could_float = float_pins();
  for (auto& block : slots)
    for (NvsStore& slot : block) slot.start();
  configuration_store.record(store, latch_store);
  const bool has_pins = choose_board() && could_float;
  Line& line = choose_line();
  const bool has_board = configuration.is_confirmed();
  const bool has_line = line.start();
  static Machine machine{configuration.board()};
  bool has_sensors = sensors.start(configuration.peripherals());
  const bool has_machine = !has_board || (has_pins && machine.start(stored_parameters()));
  // Its entropy source is the ADC, so this comes before others take that.
  Identity identity = make_identity();
  const bool has_battery = has_board && battery.start(configuration.board(), adc);
  has_sensors = sensors.start_analog(configuration.peripherals(), adc) && has_sensors;
  identity.capabilities = capabilities(has_battery);

  // Up to here it was the bootloader's watchdog. Configured before the dead-man starts: that one
  // disarms it from another core as long as no control step runs, and would re-enable its write
  // protection half-way through the configuration.
  prepare_drive_watchdog();
  const bool is_watched = start_task_watchdog() && dead_man.watch_from_this_core();

#if CONFIG_WHEELWIRE_SELF_TEST
  static SelfTest self_test{configuration.board(), machine.left_motor, machine.right_motor,
                            shared_state};
  static SelfTestLine host_line{line, self_test};
  MotorPort& left_motor = self_test.left_motor;
  MotorPort& right_motor = self_test.right_motor;
#else
  Line& host_line = line;
  MotorPort& left_motor = machine.left_motor;
  MotorPort& right_motor = machine.right_motor;
#endif
  static Device device{{.left_motor = left_motor,
                        .right_motor = right_motor,
                        .encoders = machine.encoders,
                        .line = host_line,
                        .store = store,
                        .latches = latches,
                        .latch_store = latch_store,
                        .estop = machine.estop,
                        .battery = latest_battery,
                        .configuration = &configuration_store},
                       identity,
                       specs,
                       configuration};
  // A robot that cannot drive safely still reports why.
  if (!(has_line && has_machine && has_sensors && is_watched)) device.report_driver_failure();

  static SensorServer sensor_server{configuration.peripherals(), &sensors,
                                    has_battery ? &latest_battery : nullptr};
  device.sense(sensor_server);
  device.offer(housekeeping);
#if CONFIG_WHEELWIRE_SELF_TEST
  self_test.start();
#endif

  static RecorderKeeper recorder{recorder_memory, recorder_flash, origin_of(identity),
                                 identity.reset_reason, configuration.fingerprint()};
  const bool can_record = recorder_flash.start(RecorderKeeper::kFlashSize);
  static ControlTask control{device, host_line, dead_man, shared_state,
                             can_record ? &recorder : nullptr};
  housekeeping.start(has_battery, has_board ? configuration.board().led : -1);
  control.start();
}

}  // namespace
}  // namespace wheelwire

extern "C" void app_main() { wheelwire::start(); }
