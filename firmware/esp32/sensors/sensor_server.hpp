// Sensors, inputs and reflexes of a device: reads its peripherals, and serves the messages of the
// group SENSOR. See protocol/SPEC.md, "Sensors".
#pragma once

#include "message_server.hpp"
#include "sensor_hub.hpp"

namespace wheelwire {

class SensorServer final : public SensorMessages, public SensorObserver {
 public:
  /// `port`: nullptr where nothing is read, as in a re-run. `divider`: what measures the battery;
  /// nullptr: the board does not. All must outlive it.
  SensorServer(const PeripheralList& list, SensorPort* port, BatterySense* divider);

  void attach(MessageServer& server) override { server_ = &server; }
  bool is_active() const override { return is_active_; }
  void start_at_stop() override { hub_.start_at_stop(); }
  uint8_t update(uint64_t now_us) override {
    return hub_.update(divider_ != nullptr ? divider_->millivolts() : uint16_t{0}, now_us);
  }
  void serve(const Frame& frame, uint16_t request_id, uint64_t now_us) override;
  void stream(uint64_t now_us) override;
  void fit_to_line(uint32_t state_hz, uint64_t now_us) override;
  void end_session() override { streams_ = {}; }
  uint32_t held() const override { return is_active_ ? hub_.held() : 0; }

  void on_sensor_event(SensorEventCode code, size_t channel, uint16_t value,
                       uint64_t now_us) override;
  void on_reading(size_t channel, const ImuReading& reading, uint16_t sample) override;
  void on_reading(size_t channel, const RangeReading& reading, uint16_t sample) override;

 private:
  /// What a host has asked for, and when the next of each is due.
  struct Streams {
    uint16_t asked_hz = 0;   // Rate of the IMU; 0: nothing is sent.
    uint16_t imu_hz = 0;     // What the line carries in addition to the states.
    uint8_t infos_left = 0;  // Channels whose SensorInfo is to be sent, from the last one on.
    uint64_t next_imu_us = 0;
    uint64_t next_power_us = 0;
    uint64_t next_inputs_us = 0;
    uint64_t inputs_us = 0;  // When they were last sent,
    Inputs digital{};        // and what,
    uint16_t analog_mv[kMostAnalog]{};
  };

  void send_info(size_t channel, uint64_t now_us);
  void send_power(uint64_t now_us);
  void send_inputs(uint64_t now_us);
  Inputs digital_inputs() const;
  bool has_analog_moved() const;

  BatterySense* divider_;
  bool is_active_;
  MessageServer* server_ = nullptr;
  SensorHub hub_{*this};
  Streams streams_;
};

}  // namespace wheelwire
