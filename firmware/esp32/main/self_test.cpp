#include "self_test.hpp"

#include <initializer_list>

#include "esp_attr.h"
#include "esp_cpu.h"
#include "esp_rom_sys.h"
#include "fail_core.hpp"
#include "freertos/FreeRTOS.h"
#include "freertos/task.h"
#include "gpio_pin.hpp"

namespace wheelwire {
namespace {

constexpr int kCores = CONFIG_FREERTOS_NUMBER_OF_CORES;
constexpr uint32_t kStackBytes = 3072;
/// Below the control task, above all others of the firmware.
constexpr UBaseType_t kPriority = configMAX_PRIORITIES - 2;
constexpr uint32_t kPollMs = 5;
/// Until the Ack is on the line.
constexpr uint32_t kAckMs = 20;
constexpr uint32_t kMinEdgeUs = 4;
/// More than any encoder's filter.
constexpr uint32_t kSpikeRestUs = 40;
/// How many edges come before other tasks of this core run again.
constexpr int32_t kEdgesAtOnce = 2000;

StackType_t stacks[CONFIG_FREERTOS_NUMBER_OF_CORES][kStackBytes];
StaticTask_t task_memory[CONFIG_FREERTOS_NUMBER_OF_CORES];

/// Start-up code leaves it as it is.
struct LastFailure {
  uint32_t magic;
  uint8_t failure;
  uint8_t core;
  uint64_t failed_us;
};
constexpr uint32_t kMagic = 0x5e1f'7e57;
__NOINIT_ATTR LastFailure noted;

/// As it was at the start, and with it the last pulse before.
LastFailure last;
uint64_t last_fall_us;

struct TaskOrder {
  SelfTest* self;
  int core;
};
TaskOrder tasks[CONFIG_FREERTOS_NUMBER_OF_CORES];

bool is_encoder(const BoardDescription& board, int pin) {
  return pin >= 0 && (pin == board.left_encoder_a || pin == board.left_encoder_b ||
                      pin == board.right_encoder_a || pin == board.right_encoder_b);
}

bool is_output(const BoardDescription& board, int pin) {
  return pin >= 0 && pin < 64 && (stage_pins(board) & mask_of(pin)) != 0;
}

template <typename Message>
SelfTestAnswer answer(const Message& message) {
  static_assert(Message::kSize <= kMaxBody);
  SelfTestAnswer answer;
  answer.id = Message::kId;
  answer.size = Message::kSize;
  message.encode(answer.body);
  return answer;
}

/// With the two fields of its question.
template <typename Message>
SelfTestAnswer answer(Message message, uint32_t session_id, uint16_t request_id) {
  message.session_id = session_id;
  message.request_id = request_id;
  return answer(message);
}

/// Half a spike: 250 ns.
void wait_in_spike() {
  const uint32_t cycles = esp_rom_get_cpu_ticks_per_us() / 4;
  const uint32_t begin = esp_cpu_get_cycle_count();
  while (esp_cpu_get_cycle_count() - begin < cycles) {
  }
}

/// Two outputs in the place of an encoder's. A leads on the way up.
class PlayedEncoder {
 public:
  PlayedEncoder(int a, int b) : pins_{a, b} {}

  void turn(int32_t step) {
    position_ += step;
    for (const int input : {0, 1}) set(input, level(input));
  }
  /// One edge up, within a pulse on the other input that is too short to be an edge. Counted, each
  /// would be three down.
  void turn_in_spike() {
    const int turned = position_ & 1;
    const int other = 1 - turned;
    portDISABLE_INTERRUPTS();
    set(other, !level(other));
    wait_in_spike();
    ++position_;
    set(turned, level(turned));
    wait_in_spike();
    set(other, level(other));
    portENABLE_INTERRUPTS();
  }

 private:
  bool level(int input) const {
    static constexpr bool kLevels[][2] = {
        {false, false}, {true, false}, {true, true}, {false, true}};
    return kLevels[position_ & 3][input];
  }
  void set(int input, bool level) { set_level(pins_[input], level); }

  int pins_[2];
  int32_t position_ = 0;
};

}  // namespace

void SelfTest::start() {
  last = noted.magic == kMagic ? noted : LastFailure{};
  last_fall_us = last.magic == kMagic ? PulseWatch::last_fall_us() : 0;
  noted = {};
  for (int core = 0; core < kCores; ++core) {
    tasks[core] = {this, core};
    xTaskCreateStaticPinnedToCore(run, "self test", kStackBytes, &tasks[core], kPriority,
                                  stacks[core], &task_memory[core], core);
  }
}

void SelfTest::run(void* order) {
  const TaskOrder& task = *static_cast<const TaskOrder*>(order);
  for (;;) {
    task.self->work(task.core);
    vTaskDelay(pdMS_TO_TICKS(kPollMs));
  }
}

void SelfTest::work(int core) {
  Order& order = orders_[core];
  switch (order.is_due) {
    case SelfTestFail::kId:
      vTaskDelay(pdMS_TO_TICKS(kAckMs));
      esp_rom_delay_us(order.fail.delay_us);
      noted = {.magic = kMagic,
               .failure = static_cast<uint8_t>(order.fail.failure),
               .core = static_cast<uint8_t>(core),
               .failed_us = now_us()};
      fail_core(order.fail.failure);
      break;
    case SelfTestTurn::kId:
      turn_encoder(order.turn);
      turns_ = false;
      break;
    case SelfTestWatch::kId: {
      const int pin = order.watch.edge_pin;
      pulses_.start(pin, order.watch.level_pin, board_.encoder_pulls == EncoderPulls::kInternal);
      break;
    }
    default:
      return;
  }
  order.is_due = 0;
}

void SelfTest::turn_encoder(const SelfTestTurn& request) {
  PlayedEncoder encoder{request.pin_a, request.pin_b};
  for (int i = 0; i < request.spikes; ++i) {
    encoder.turn_in_spike();
    esp_rom_delay_us(kSpikeRestUs);
  }
  const int32_t step = request.edges < 0 ? -1 : 1;
  for (int32_t at = 0; at != request.edges; at += step) {
    encoder.turn(step);
    esp_rom_delay_us(request.edge_us);
    if (at % kEdgesAtOnce == 0) vTaskDelay(1);
  }
}

SelfTestAnswer SelfTest::serve(const Frame& frame, uint32_t session_id, uint16_t request_id) {
  if (frame.id == GroupGet::kId) {
    const GroupInfo info{.group = static_cast<Group>(kSelfTestGroup), .hash = kSelfTestHash};
    return answer(info, session_id, request_id);
  }
  const RefusalCode refusal = carry_out(frame);
  if (refusal != RefusalCode::kNone)
    return answer(Refuse{session_id, frame.id, refusal, request_id});
  if (frame.id == SelfTestWatch::kId) return answer(report(), session_id, request_id);
  if (frame.id == SelfTestLastGet::kId) {
    const SelfTestLast message{.failure = static_cast<Failure>(last.failure),
                               .core = last.core,
                               .failed_us = last.failed_us,
                               .last_fall_us = last_fall_us};
    return answer(message, session_id, request_id);
  }
  return answer(Ack{session_id, request_id, frame.id});
}

RefusalCode SelfTest::carry_out(const Frame& frame) {
  if (frame.id == SelfTestAllow::kId) return allow(SelfTestAllow::decode(frame.body));
  if (!is_allowed_) return RefusalCode::kNotSupported;
  switch (frame.id) {
    case SelfTestFail::kId:
      return fail(SelfTestFail::decode(frame.body));
    case SelfTestTurn::kId:
      return turn(SelfTestTurn::decode(frame.body));
    case SelfTestWatch::kId:
      return watch(SelfTestWatch::decode(frame.body));
    case SelfTestLastGet::kId:
      return RefusalCode::kNone;
  }
  return RefusalCode::kNotSupported;
}

RefusalCode SelfTest::allow(const SelfTestAllow& request) {
  if (request.permission != kSelfTestPermission) return RefusalCode::kOutOfRange;
  is_allowed_ = true;
  return RefusalCode::kNone;
}

RefusalCode SelfTest::fail(const SelfTestFail& request) {
  if (request.core >= kCores || request.failure == Failure::kNone ||
      request.failure > Failure::kFreeze)
    return RefusalCode::kOutOfRange;
  if (orders_[request.core].is_due != 0) return RefusalCode::kNotStopped;
  orders_[request.core].fail = request;
  orders_[request.core].is_due = SelfTestFail::kId;
  return RefusalCode::kNone;
}

RefusalCode SelfTest::turn(const SelfTestTurn& request) {
  if (!is_output(board_, request.pin_a) || !is_output(board_, request.pin_b) ||
      request.edge_us < kMinEdgeUs)
    return RefusalCode::kOutOfRange;
  if (orders_[0].is_due != 0 ||
      state_.supervisor.load(std::memory_order_relaxed) == SupervisorState::kDriving)
    return RefusalCode::kNotStopped;
  left_motor.coast();
  right_motor.coast();
  turns_ = true;
  orders_[0].turn = request;
  orders_[0].is_due = SelfTestTurn::kId;
  return RefusalCode::kNone;
}

RefusalCode SelfTest::watch(const SelfTestWatch& request) {
  if (!is_encoder(board_, request.edge_pin) || !is_encoder(board_, request.level_pin) ||
      request.core >= kCores)
    return RefusalCode::kOutOfRange;
  if (pulses_.is_started() || orders_[request.core].is_due != 0) return RefusalCode::kNone;
  orders_[request.core].watch = request;
  orders_[request.core].is_due = SelfTestWatch::kId;
  return RefusalCode::kNone;
}

SelfTestReport SelfTest::report() {
  const Pulses pulses = pulses_.take();
  return {.resolution_hz = pulses_.resolution_hz(),
          .rises = pulses.rises,
          .falls = pulses.falls,
          .least_period = pulses.least_period,
          .most_period = pulses.most_period,
          .least_high = pulses.least_high,
          .most_high = pulses.most_high,
          .most_high_other = pulses.most_high_other,
          .last_fall_us = PulseWatch::last_fall_us(),
          .turns = turns_};
}

}  // namespace wheelwire
