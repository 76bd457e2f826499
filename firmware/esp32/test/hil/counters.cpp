// Quadrature through the counters' limits, and spikes that the filter must not let through.
#include "encoder.hpp"
#include "json.hpp"
#include "rows.hpp"
#include "stage_boards.hpp"
#include "wired_robot.hpp"

namespace wheelwire::hil {
namespace {

constexpr int32_t kFar = 100'000;
constexpr int64_t kEdgeUs = 5;  ///< 200 000 edges a second.
constexpr int64_t kSpikeNs = 500;
/// How many edges come between two reads: as many as in a control period.
constexpr int32_t kBetweenReads = 200;

/// The left wheel, with a signal generator in the place of its encoder.
class Wheel {
 public:
  Wheel() : board_(test::board_of(Stage::kEnableIn1In2)) {
    fake_matrix = {};
    fake_pcnt.clear();
    fake_time_us = 1'000'000;
    Parameters parameters;
    started_ = encoders_.start(board_,
                               static_cast<uint32_t>(parameters.get(ParameterId::kGlitchFilterNs)));
    set(kLevels[0]);
    read();
    total_ = TickTotal{encoders_.latch().left};
  }

  bool is_started() const { return started_; }
  int32_t read() { return total_.update(encoders_.latch().left, false), total_.ticks(); }

  /// Moves by this many edges, up or down.
  void turn(int32_t edges) {
    const int32_t step = edges < 0 ? -1 : 1;
    for (int32_t i = 0; i != edges; i += step) {
      position_ += step;
      fake_time_us += kEdgeUs;
      set(kLevels[position_ & 3]);
      if (position_ % kBetweenReads == 0) read();
    }
    fake_time_us += 10 * kEdgeUs;
    read();
  }

  /// An edge of one input, within a pulse on the other one that is too short to be an edge. Alone a
  /// pulse would add a tick and take it away again; so it makes four of one.
  void turn_in_spike(bool up) {
    fake_time_us += 10 * kEdgeUs;
    const Levels before = kLevels[position_ & 3];
    position_ += up ? 1 : -1;
    const Levels after = kLevels[position_ & 3];
    const bool turns_a = before.a != after.a;
    const int other = turns_a ? board_.left_encoder_b : board_.left_encoder_a;
    const bool level = turns_a ? before.b : before.a;
    const int64_t t_ns = 1000 * fake_time_us;
    set(other, !level, t_ns);
    set(turns_a ? board_.left_encoder_a : board_.left_encoder_b, turns_a ? after.a : after.b,
        t_ns + kSpikeNs / 2);
    set(other, level, t_ns + kSpikeNs);
    fake_time_us += 10 * kEdgeUs;
    read();
  }

  int32_t error() { return read() - position_; }

 private:
  struct Levels {
    bool a;
    bool b;
  };
  static constexpr Levels kLevels[] = {{false, false}, {true, false}, {true, true}, {false, true}};

  void set(const Levels& levels) {
    set(board_.left_encoder_a, levels.a, 1000 * fake_time_us);
    set(board_.left_encoder_b, levels.b, 1000 * fake_time_us);
  }
  static void set(int pin, bool level, int64_t t_ns) {
    for (FakePcntUnit& unit : fake_pcnt) unit.set(pin, level, t_ns);
  }

  BoardDescription board_;
  Encoders encoders_;
  TickTotal total_;
  int32_t position_ = 0;
  bool started_ = false;
};

}  // namespace

std::string measure_counters(int times) {
  Wheel far;
  int32_t error = 0;
  const auto note = [&] { error = error != 0 ? error : far.error(); };
  for (int i = 0; i < times; ++i) {
    for (const int32_t edges : {kFar, -2 * kFar, kFar}) {
      far.turn(edges);
      note();
    }
  }
  Wheel limit;
  int32_t error_at_limit = 0;
  limit.turn(kCounterLimit - 2);
  for (int i = 0; i < 100 * times; ++i) {
    limit.turn(4);
    limit.turn(-4);
    if (limit.error() != 0) error_at_limit = limit.error();
  }
  Wheel spiked;
  const int spikes = 100 * times;
  for (int i = 0; i < spikes; ++i) {
    spiked.turn_in_spike(i % 3 != 0);
  }
  return Json{}
      .put("started", far.is_started() && limit.is_started() && spiked.is_started())
      .put("error_ticks", error)
      .put("turns_at_limit", 100 * times)
      .put("error_at_limit_ticks", error_at_limit)
      .put("spikes", spikes)
      .put("error_of_spikes_ticks", spiked.error())
      .text();
}

}  // namespace wheelwire::hil
