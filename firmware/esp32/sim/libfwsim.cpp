#include "libfwsim.h"

#include <cstring>
#include <vector>

#include "bare_robot.hpp"
#include "file.hpp"
#include "simulator.hpp"
#include "variables.hpp"

using namespace wheelwire;
using namespace wheelwire::sim;

struct fwsim : Simulator {
  using Simulator::Simulator;
};

struct fwsim_robot : BareRobot {
  using BareRobot::BareRobot;
};

namespace {

constexpr Nanoseconds kMicrosecond = 1000;
constexpr int64_t kLongestAdvanceUs = INT64_MAX / kMicrosecond / 1000;

}  // namespace

fwsim* fwsim_create(uint64_t seed) { return new fwsim(seed); }

void fwsim_destroy(fwsim* sim) { delete sim; }

int fwsim_use_store(fwsim* sim, const char* path) {
  if (sim == nullptr || path == nullptr) return FWSIM_BAD_ARGUMENT;
  use_files(sim->board, path);
  return FWSIM_OK;
}

int fwsim_preset(fwsim* sim, int parameter, float value) {
  if (sim == nullptr) return FWSIM_BAD_ARGUMENT;
  return sim->preset(parameter, value) ? FWSIM_OK : FWSIM_OUT_OF_RANGE;
}

int fwsim_set(fwsim* sim, const char* name, double value) {
  if (sim == nullptr || name == nullptr) return FWSIM_BAD_ARGUMENT;
  return static_cast<int>(set_variable(*sim, name, value));
}

int fwsim_get(const fwsim* sim, const char* name, double* value) {
  if (sim == nullptr || name == nullptr || value == nullptr) return FWSIM_BAD_ARGUMENT;
  return static_cast<int>(get_variable(*sim, name, *value));
}

int fwsim_advance_us(fwsim* sim, int64_t duration_us) {
  if (sim == nullptr || duration_us < 0 || duration_us > kLongestAdvanceUs) {
    return FWSIM_BAD_ARGUMENT;
  }
  sim->advance(duration_us * kMicrosecond);
  return FWSIM_OK;
}

int fwsim_advance_to_bytes(fwsim* sim, int64_t step_us, int64_t count, int64_t* done) {
  if (sim == nullptr || done == nullptr || step_us < 1 || step_us > kLongestAdvanceUs ||
      count < 1) {
    return FWSIM_BAD_ARGUMENT;
  }
  *done = 0;
  do {
    sim->advance(step_us * kMicrosecond);
  } while (++*done < count && sim->board.line.host_waiting() == 0);
  return FWSIM_OK;
}

int fwsim_write(fwsim* sim, const uint8_t* data, size_t size) {
  if (sim == nullptr || (data == nullptr && size > 0)) return FWSIM_BAD_ARGUMENT;
  sim->board.line.host_write(data, size);
  return FWSIM_OK;
}

int fwsim_read(fwsim* sim, uint8_t* out, size_t capacity, size_t* size) {
  if (sim == nullptr || size == nullptr || (out == nullptr && capacity > 0)) {
    return FWSIM_BAD_ARGUMENT;
  }
  *size = sim->board.line.host_read(out, capacity);
  return FWSIM_OK;
}

int fwsim_box(fwsim* sim, uint8_t* out, size_t capacity, size_t* size) {
  if (sim == nullptr || size == nullptr || out == nullptr || capacity < kBoxImageSize) {
    return FWSIM_BAD_ARGUMENT;
  }
  const std::vector<uint32_t> image = sim->box_image();
  std::memcpy(out, image.data(), kBoxImageSize);
  *size = kBoxImageSize;
  return FWSIM_OK;
}

size_t fwsim_variable_count(void) { return variables().size(); }

int fwsim_describe(size_t index, fwsim_variable* description) {
  if (description == nullptr || index >= fwsim_variable_count()) return FWSIM_BAD_ARGUMENT;
  const Variable& variable = variables()[index];
  *description = {.name = variable.name.c_str(),
                  .unit = variable.unit,
                  .doc = variable.doc.c_str(),
                  .minimum = variable.minimum,
                  .maximum = variable.maximum,
                  .settable = variable.set != nullptr};
  return FWSIM_OK;
}

fwsim_robot* fwsim_robot_create(const uint8_t* board, size_t size, int counts_per_revolution,
                                int64_t now_ns) {
  Configuration configuration;
  if (board == nullptr || counts_per_revolution <= 0 ||
      !Configuration::decode(board, size, configuration)) {
    return nullptr;
  }
  return new fwsim_robot(configuration.board, counts_per_revolution, now_ns);
}

void fwsim_robot_destroy(fwsim_robot* robot) { delete robot; }

int fwsim_robot_set_pins(fwsim_robot* robot, const uint16_t* duty_q15, size_t count) {
  if (robot == nullptr || duty_q15 == nullptr || count > 64) return FWSIM_BAD_ARGUMENT;
  robot->set_pins(duty_q15, count);
  return (robot->drives() ? 1 : 0) | (robot->brakes() ? 2 : 0);
}

int fwsim_robot_advance(fwsim_robot* robot, int64_t end_ns, int64_t longest_ns,
                        const fwsim_edge** edges, size_t* count) {
  if (robot == nullptr || edges == nullptr || count == nullptr) return FWSIM_BAD_ARGUMENT;
  robot->skip_to(end_ns - longest_ns);
  const std::vector<fwsim_edge>& made = robot->advance_to(end_ns);
  *edges = made.data();
  *count = made.size();
  return FWSIM_OK;
}

void fwsim_robot_spin(fwsim_robot* robot, double ticks_per_s) {
  if (robot != nullptr) robot->spin(ticks_per_s);
}

int64_t fwsim_robot_ticks(fwsim_robot* robot, int side) {
  if (robot == nullptr || side < 0 || side > 1) return 0;
  return robot->encoder(static_cast<Side>(side)).ticks();
}

void fwsim_robot_kill_encoder(fwsim_robot* robot, int side) {
  if (robot == nullptr || side < 0 || side > 1) return;
  robot->encoder(static_cast<Side>(side)).model.dead = true;
}
