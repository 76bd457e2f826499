#include "black_box.hpp"

#include <string.h>

#include "core_state.hpp"
#include "ledger.hpp"

namespace wheelwire {

using box::Kind;

namespace {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "as the words of a box are read");

/// Two's complement in so many bits.
template <int kBits>
constexpr uint32_t packed(int32_t value) {
  return static_cast<uint32_t>(value) & ((1u << kBits) - 1);
}

/// Makes a signed value non-negative, to pack it in kBits bits.
template <int kBits>
constexpr uint32_t offset(int32_t value) {
  return static_cast<uint32_t>(value + (1 << (kBits - 1)));
}

constexpr uint32_t duties(const StepNote& note) {
  return static_cast<uint16_t>(note.left_duty_q15) |
         static_cast<uint32_t>(static_cast<uint16_t>(note.right_duty_q15)) << 16;
}

/// Writes each number as one word, or as two, the low one first.
class StateWriter : public StateVisitor {
 public:
  StateWriter(uint32_t* out, uint32_t* end) : out_(out), end_(end) {}

  template <typename... Parts>
  void write(Parts&... parts) {
    (walk(*this, parts), ...);
  }
  /// Behind the last word; nullptr: there was no room for all.
  uint32_t* end() const { return fits_ ? out_ : nullptr; }

  // For `walk`.
  template <typename T>
  void number(T value) {
    put(static_cast<uint32_t>(value));
    if constexpr (sizeof(T) == 8) put(static_cast<uint32_t>(static_cast<uint64_t>(value) >> 32));
  }
  void number(float value) { put(__builtin_bit_cast(uint32_t, value)); }
  template <typename T>
  void keep(T* part) {
    put(part != nullptr);
  }
  template <typename T, uint32_t kCapacity>
  uint32_t resize(const Ring<T, kCapacity>& ring) {
    put(ring.size());
    return ring.size();
  }

 private:
  void put(uint32_t word) {
    if (out_ == end_) {
      fits_ = false;
      return;
    }
    *out_++ = word;
  }

  uint32_t* out_;
  uint32_t* end_;
  bool fits_ = true;
};

}  // namespace

void BlackBox::clear() {
  for (size_t i = 0; i < box::kSegments; ++i) memory_[i * box::kSegmentWords] = 0;
  at_ = 1;
  limit_ = end_ = 0;
  number_ = 0;
  triggered_ = closed_ = false;
  cause_ = BoxCause::kRequest;
}

bool BlackBox::keep_what_is_left(uint32_t& boot_id) {
  uint32_t newest = 0;
  for (size_t i = 0; i < box::kSegments; ++i) {
    const uint32_t* const head = memory_ + i * box::kSegmentWords;
    if (!box::is_head(head) || head[1] <= newest) continue;
    newest = head[1];
    boot_id = head[5];
  }
  if (newest != 0) close();
  return newest != 0;
}

// --- records -------------------------------------------------------------------------------------

/// Replaces the oldest segment, which is invalid while it has no magic number.
void BlackBox::begin_segment() {
  const auto start = static_cast<uint32_t>(number_ % box::kSegments * box::kSegmentWords);
  uint32_t* const head = memory_ + start;
  head[0] = 0;
  constexpr auto kSegmentWords = static_cast<uint32_t>(box::kSegmentWords);
  const uint32_t used = end_ == 0 ? 0 : at_ - (end_ - kSegmentWords);
  const uint32_t words[box::kHeadWords - 1] = {
      box::kBoxMagic,   ++number_,       origin_.core, origin_.release,
      origin_.git_hash, origin_.boot_id, used};
  check_ = 0;
  for (const uint32_t word : words) check_ = box::mix(check_, word);
  for (size_t i = 1; i < box::kHeadWords - 1; ++i) head[i] = words[i];
  head[box::kHeadWords - 1] = check_;
  head[0] = box::kBoxMagic;
  at_ = start + static_cast<uint32_t>(box::kHeadWords);
  end_ = start + kSegmentWords;
  limit_ = end_ - kReserveWords;
  is_first_ = true;
}

void BlackBox::note_state(MessageServer& server, Robot& robot) {
  begin_segment();
  uint32_t* const out = memory_ + at_ + 1;
  out[0] = (in_step_ ? box::kInStep : 0) | (open_ ? box::kOpenContact : 0);
  StateWriter writer(out + 1, memory_ + end_);
  writer.write(server, robot);
  // It always fits: a test fills it as far as it goes.
  if (writer.end() != nullptr) {
    const auto words = static_cast<size_t>(writer.end() - out);
    commit(Kind::kState, static_cast<uint32_t>(words), words);
  }
}

// --- steps ---------------------------------------------------------------------------------------

void BlackBox::note_step(const StepNote& note) {
  in_step_ = true;
  const uint64_t elapsed_us = note.now_us - last_.now_us;
  const uint64_t late_us = note.t_us - note.now_us;
  const int32_t left = note.left_counter - last_.left_counter;
  const int32_t right = note.right_counter - last_.right_counter;
  const int32_t battery = note.battery_mv - last_.battery_mv;
  const bool is_plain =
      elapsed_us >> box::kTimeBits == 0 && late_us >> box::kLatchBits == 0 &&
      (offset<box::kTickBits>(left) | offset<box::kTickBits>(right)) >> box::kTickBits == 0 &&
      offset<box::kBatteryBits>(battery) >> box::kBatteryBits == 0 &&
      note.left_illegal == last_.left_illegal && note.right_illegal == last_.right_illegal &&
      !is_first_ && !triggered_;
  if (!is_plain) return note_wide_step(note);
  last_.now_us = note.now_us;
  last_.left_counter = note.left_counter;
  last_.right_counter = note.right_counter;
  last_.battery_mv = note.battery_mv;
  put(Kind::kStep, low(late_us) | packed<box::kBatteryBits>(battery) << box::kLatchBits,
      low(elapsed_us) | packed<box::kTickBits>(left) << box::kTimeBits |
          packed<box::kTickBits>(right) << (box::kTimeBits + box::kTickBits),
      duties(note));
}

void BlackBox::note_wide_step(const StepNote& note) {
  if (triggered_) {
    put(Kind::kEnd, box::kEndWords, low(note.now_us), high(note.now_us), duties(note));
    return close();
  }
  last_ = note;
  const uint32_t counters = static_cast<uint16_t>(note.left_counter) |
                            static_cast<uint32_t>(static_cast<uint16_t>(note.right_counter)) << 16;
  if (put(Kind::kWideStep, box::kWideWords, low(note.now_us), high(note.now_us), low(note.t_us),
          high(note.t_us), counters, note.left_illegal, note.right_illegal,
          uint32_t{note.battery_mv}, duties(note)))
    is_first_ = false;
}

// --- what happens because of it ------------------------------------------------------------------

void BlackBox::note_message(uint8_t id, const uint8_t* body, size_t size, uint64_t now_us) {
  const size_t head = in_step_ ? 1 : 3;
  const size_t words = head + (size + 3) / 4;
  uint32_t* const out = begin(words);
  if (out == nullptr) return;
  out[0] = id | static_cast<uint32_t>(size) << 8 | (in_step_ ? box::kInStep : 0) << 16;
  if (!in_step_) {
    out[1] = low(now_us);
    out[2] = high(now_us);
  }
  out[words - 1] = 0;
  memcpy(out + head, body, size);
  commit(Kind::kMessage, static_cast<uint32_t>(words), words);
}

void BlackBox::note_contact(bool open) {
  if (open == open_) {
    ++reads_;
    return;
  }
  open_ = open;
  put(Kind::kContact, (open ? 1u : 0u) | reads_ << 1);
}

void BlackBox::note_parameters(Parameters& parameters, ControlConfig& config,
                               uint32_t& contradictions) {
  if (end_ == 0) return;
  uint32_t* const out = memory_ + at_ + 1;
  StateWriter writer(out, memory_ + end_);
  writer.write(parameters, config, contradictions);
  if (writer.end() == nullptr) return;
  const auto words = static_cast<size_t>(writer.end() - out);
  commit(Kind::kParameters, static_cast<uint32_t>(words), words);
}

void BlackBox::note_transition(SupervisorEvent event, SupervisorState before, SupervisorState after,
                               uint32_t faults) {
  put(Kind::kTransition,
      static_cast<uint32_t>(event) | static_cast<uint32_t>(before) << 4 |
          static_cast<uint32_t>(after) << 8,
      faults);
  if (ledger_ != nullptr) ledger_->count(event, before);
  is_current_ = false;
  if (event != SupervisorEvent::kFault && event != SupervisorEvent::kEstop) return;
  if (end_ == 0 || triggered_) return;
  triggered_ = is_current_ = true;
  cause_ = event == SupervisorEvent::kFault ? BoxCause::kFault : BoxCause::kEstop;
}

}  // namespace wheelwire
