// The whole device in virtual time, and a host that sends exactly what a test says.
#pragma once

#include <cmath>
#include <vector>

#include "framing.hpp"
#include "simulator.hpp"

namespace wheelwire::test {

class SimRobot {
 public:
  explicit SimRobot(double mass_kg = 0.8, double slope_rad = 0.0) {
    sim::PlantModel model = simulator.board.plant.model();
    model.mass_kg = mass_kg;
    simulator.board.plant.configure(model);
    tilt(slope_rad);
    run_ms(100);
  }

  void tilt(double slope_rad) {
    sim::PlantModel model = simulator.board.plant.model();
    model.slope_rad = slope_rad;
    simulator.board.plant.configure(model);
  }

  /// Opens a session, synchronises the clock, and arms the robot as a program that connects does.
  SimRobot& open() {
    hello();
    arm();
    return *this;
  }
  /// As a library that reconnects by itself: nothing arms.
  void hello() {
    nonce_ = nonce_ * 2654435761U + 1;
    command_seq_ = request_id_ = 0;
    send(Hello{nonce_, schema::kVersion, schema::kHash});
    run_ms(5);
    send(Ping{session(), 1, 0});
    run_ms(5);
  }
  /// A zero setpoint, and a stop that leaves the wheels free.
  void arm() {
    send(velocity(0.0f, 0.0f));
    run_ms(5);
    send(stop(StopMode::kCoast));
    run_ms(5);
  }

  uint32_t session() const { return nonce_ ^ simulator.boot_id(); }
  SetWheelVelocity velocity(float left_mps, float right_mps, uint64_t life_us = 300'000) {
    return {session(), ++command_seq_, simulator.board.device_us() + life_us, left_mps, right_mps};
  }
  Stop stop(StopMode mode = StopMode::kConfigured) {
    return {session(), ++request_id_, command_seq_, mode};
  }
  void set(ParameterId id, float value) {
    send(ParameterSet{session(), ++request_id_, static_cast<uint8_t>(id), value});
    run_ms(5);
  }
  void clear_estop() {
    send(ClearEstop{session(), ++request_id_});
    run_ms(5);
  }
  template <typename Message>
  void send(const Message& message) {
    uint8_t body[Message::kSize];
    message.encode(body);
    std::vector<uint8_t> frame(kMaxFrame);
    frame.resize(encode_frame(Message::kId, seq_++, body, sizeof body, frame.data()));
    simulator.board.line.host_write(frame.data(), frame.size());
  }

  void run_ms(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) {
      simulator.advance(1'000'000);
      uint8_t bytes[256];
      while (simulator.board.line.host_read(bytes, sizeof bytes) != 0) {
      }
    }
  }
  /// Commands it every 20 ms.
  void drive(float left_mps, float right_mps, int milliseconds) {
    for (int ms = 0; ms < milliseconds; ms += 20) {
      send(velocity(left_mps, right_mps));
      run_ms(20);
    }
  }

  bool brakes() const {
    const auto bridges = simulator.board.bridges();
    return bridges[sim::kLeft].shorted() > 0.5 && bridges[sim::kRight].shorted() > 0.5;
  }
  /// Forward, of the robot's middle.
  double speed_mps() const {
    const sim::Plant& plant = simulator.board.plant;
    return (plant.speed_mps(sim::kLeft) + plant.speed_mps(sim::kRight)) / 2.0;
  }
  double distance_m() const { return simulator.board.plant.pose().x_m; }
  SupervisorState state() const { return simulator.state(); }

  sim::Simulator simulator{1};

 private:
  uint32_t nonce_ = 0x1234;
  uint32_t command_seq_ = 0;
  uint16_t request_id_ = 0;
  uint16_t seq_ = 0;
};

}  // namespace wheelwire::test
