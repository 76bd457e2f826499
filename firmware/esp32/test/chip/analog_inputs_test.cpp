// Battery and analogue inputs on one ADC.
#include "adc.hpp"
#include "check.hpp"

using namespace wheelwire;

namespace {

PeripheralList analog_at(std::initializer_list<int8_t> pins) {
  PeripheralList list{.count = 1};
  list.entries[0] = {.kind = PeripheralKind::kBattery};
  for (const int8_t pin : pins)
    list.entries[list.count++] = {.kind = PeripheralKind::kAnalog, .pin_a = pin, .value_a = 2000};
  return list;
}

}  // namespace

TEST(a_battery_and_analogue_inputs_share_the_unit) {
  fake_adc = {};
  fake_adc.millivolts = {{34, 1850}, {35, 900}, {36, 0}};
  Adc adc;
  Battery battery;
  AnalogInputs inputs;
  CHECK(battery.start({.battery = 34, .battery_divider_permille = 4000}, adc));
  CHECK(inputs.start(analog_at({35, 36}), adc));
  CHECK(fake_adc.units == 1);
  inputs.measure();
  AnalogReading reading;
  CHECK(!inputs.take(0, reading));  // It is the battery.
  CHECK(inputs.take(1, reading) && reading.pin_mv == 900);
  CHECK(inputs.take(2, reading) && reading.pin_mv == 0);
  CHECK(!inputs.take(1, reading) && !inputs.take(2, reading));
  CHECK(battery.measure_millivolts() == 7400);
  // What cannot be measured has no reading.
  fake_adc.fails = true;
  inputs.measure();
  CHECK(!inputs.take(1, reading));
  fake_adc.fails = false;
  inputs.measure();
  CHECK(inputs.take(1, reading));
}

TEST(the_unit_is_not_taken_for_nothing) {
  fake_adc = {};
  Adc adc;
  AnalogInputs inputs;
  CHECK(inputs.start(analog_at({}), adc));
  inputs.measure();
  CHECK(fake_adc.units == 0 && fake_adc.reads == 0);
}

TEST(one_that_does_not_start_is_reported_and_the_others_are_read) {
  fake_adc = {};
  fake_adc.millivolts = {{35, 900}};
  Adc adc;
  AnalogInputs inputs;
  CHECK(!inputs.start(analog_at({25, 35}), adc));  // GPIO 25 is of ADC2.
  inputs.measure();
  AnalogReading reading;
  CHECK(!inputs.take(1, reading));
  CHECK(inputs.take(2, reading) && reading.pin_mv == 900);
}
