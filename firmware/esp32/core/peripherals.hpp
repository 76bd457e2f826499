// The peripherals on a board, and their rules. Nothing else checks them: the chip uses this for
// lists written to it, and computers use it through the C interface.
#pragma once

#include "board_rules.hpp"
#include "sensor_tables.hpp"

namespace wheelwire {

struct PeripheralList {
  uint8_t count = 0;
  Peripheral entries[kMostPeripherals]{};

  constexpr const Peripheral* begin() const { return entries; }
  constexpr const Peripheral* end() const { return entries + count; }
};

/// Number of values of Place, with NONE.
constexpr size_t kPlaces = static_cast<size_t>(Place::kRight) + 1;

/// What an analogue input's divider divides by at most, in thousandths.
constexpr uint16_t kLargestDivider = 20'000;

/// What is wrong with a list: the values for the sentence of `fault`.
struct PeripheralIssue {
  PeripheralFault fault = PeripheralFault::kNone;
  int channel = -1;  ///< Index of the entry; -1: the fault is of none.
  int pin = -1;      ///< GPIO; -1: of none.
  uint32_t value = 0;
  uint32_t limit = 0;
};

// nullptr if it is not a known sensor of this kind.
constexpr const ImuTable* imu_table_of(SensorChip chip) { return row_of(kImuTables, chip); }
constexpr const PowerTable* power_table_of(SensorChip chip) { return row_of(kPowerTables, chip); }
constexpr const RangeTable* range_table_of(SensorChip chip) { return row_of(kRangeTables, chip); }

constexpr bool is_digital_input(PeripheralKind kind) {
  return kind == PeripheralKind::kBumper || kind == PeripheralKind::kCliff ||
         kind == PeripheralKind::kStageFault;
}

constexpr bool is_on_bus(PeripheralKind kind) {
  return kind == PeripheralKind::kImu || kind == PeripheralKind::kPower;
}

/// Time between measurements of one sensor; 0 without sensors. Range sensors measure in turn, so
/// that none hears another's sound.
constexpr uint32_t range_round_us(const PeripheralList& list) {
  uint32_t round_us = 0;
  for (const Peripheral& entry : list)
    if (entry.kind == PeripheralKind::kRange) round_us += range_table_of(entry.chip)->period_us;
  return round_us;
}

/// An analogue input's number, from 0.
constexpr size_t analog_index(const Peripheral& entry) { return entry.value_b - 1u; }

/// A computer's buses are its kernel's. A chip names one by its number, in place of its first pin.
constexpr bool has_numbered_buses(Chip chip) { return chip == Chip::kLinux; }

/// Types that a computer cannot read, because it has neither a timer that captures edges nor an
/// ADC.
constexpr bool needs_microcontroller(PeripheralKind kind) {
  return kind == PeripheralKind::kRange || kind == PeripheralKind::kAnalog;
}

/// Whether a battery acts on the robot. Without bounds it is only measured.
constexpr bool is_guarded(const Peripheral& battery) {
  return battery.value_a != 0 || battery.value_b != 0 || battery.value_c != 0;
}

/// Its address on the bus.
constexpr uint8_t address_of(const Peripheral& entry) {
  if (entry.address != 0) return entry.address;
  if (const ImuTable* const imu = imu_table_of(entry.chip)) return imu->address;
  const PowerTable* const power = power_table_of(entry.chip);
  return power != nullptr ? power->address : 0;
}

/// Checks a list against the board that it is for; `report` is called with each PeripheralIssue.
template <typename Report>
class PeripheralCheck {
 public:
  constexpr PeripheralCheck(const PeripheralList& list, const BoardDescription& board,
                            const ChipTable& chip, Report& report)
      : list_(list),
        board_(board),
        chip_(chip),
        memory_(memory_pins(chip, board.module)),
        report_(report) {}

  constexpr void run() {
    for (channel_ = 0; channel_ < list_.count; ++channel_) {
      const Peripheral& entry = list_.entries[channel_];
      check_kind(entry);
      check_twice(entry);
    }
  }

 private:
  constexpr void tell(PeripheralFault fault, int pin = -1, uint32_t value = 0, uint32_t limit = 0) {
    report_(PeripheralIssue{.fault = fault,
                            .channel = static_cast<int>(channel_),
                            .pin = pin,
                            .value = value,
                            .limit = limit});
  }

  constexpr void check_kind(const Peripheral& entry) {
    if (static_cast<size_t>(entry.place) >= kPlaces) tell(PeripheralFault::kCode);
    if (has_numbered_buses(board_.chip) && needs_microcontroller(entry.kind))
      return tell(PeripheralFault::kNotOnThisChip);
    switch (entry.kind) {
      case PeripheralKind::kImu:
        check_bus(entry);
        if (imu_table_of(entry.chip) == nullptr) tell(PeripheralFault::kChip);
        return check_orientation(entry);
      case PeripheralKind::kPower:
        check_bus(entry);
        if (power_table_of(entry.chip) == nullptr) tell(PeripheralFault::kChip);
        if (entry.value_a == 0) tell(PeripheralFault::kShunt, -1, 0, kLargestShunt / 10);
        return;
      case PeripheralKind::kBattery:
        return check_battery(entry);
      case PeripheralKind::kBumper:
        if (!is_front(entry.place) && !is_rear(entry.place)) tell(PeripheralFault::kPlace);
        // It closes to ground: when open, or with a broken wire, the pull-up makes it high.
        if ((entry.flags & peripheralflag::kTriggeredLow) != 0)
          tell(PeripheralFault::kNormallyOpen);
        return check_input(entry, true);
      case PeripheralKind::kCliff:
      case PeripheralKind::kStageFault:
        return check_input(entry, false);
      case PeripheralKind::kRange:
        return check_range(entry);
      case PeripheralKind::kAnalog:
        return check_analog(entry);
      case PeripheralKind::kNone:
        break;
    }
    tell(PeripheralFault::kKind);
  }

  constexpr void check_orientation(const Peripheral& entry) {
    const auto forward = static_cast<uint8_t>(entry.forward);
    const auto up = static_cast<uint8_t>(entry.up);
    if (forward > 5 || up > 5) {
      tell(PeripheralFault::kCode);
    } else if (forward % 3 == up % 3) {
      tell(PeripheralFault::kOrientation);
    }
  }

  constexpr void check_battery(const Peripheral& entry) {
    const bool fall =
        entry.value_a > entry.value_b && entry.value_b > entry.value_c && entry.value_c > 0;
    if (!fall && is_guarded(entry)) tell(PeripheralFault::kLevels);
    bool is_measured = board_.battery >= 0;
    for (size_t i = 0; i < list_.count; ++i)
      is_measured = is_measured || list_.entries[i].kind == PeripheralKind::kPower;
    if (!is_measured) tell(PeripheralFault::kNoBattery);
  }

  constexpr void check_range(const Peripheral& entry) {
    check_driven_pin(entry.pin_a);
    check_pin(entry.pin_b);
    if (entry.pin_a >= 0 && entry.pin_a == entry.pin_b)
      tell(PeripheralFault::kPinTaken, entry.pin_b);
    if (range_table_of(entry.chip) == nullptr) tell(PeripheralFault::kChip);
    if (entry.place == Place::kNone) tell(PeripheralFault::kPlace);
    size_t before = 0;
    for (size_t i = 0; i < channel_; ++i)
      if (list_.entries[i].kind == PeripheralKind::kRange) ++before;
    if (before >= kMostRanges) tell(PeripheralFault::kTooManyRanges, -1, 0, kMostRanges);
  }

  constexpr void check_analog(const Peripheral& entry) {
    if (check_pin(entry.pin_a) && !(chip_.adc & mask_of(entry.pin_a)))
      tell(PeripheralFault::kNoAdc, entry.pin_a);
    if (entry.value_a < 1000 || entry.value_a > kLargestDivider)
      tell(PeripheralFault::kDivider, -1, entry.value_a, kLargestDivider);
    if (entry.value_b < 1 || entry.value_b > kMostAnalog) tell(PeripheralFault::kCode);
  }

  constexpr void check_input(const Peripheral& entry, bool needs_pull_up) {
    if (!check_pin(entry.pin_a)) return;
    const bool is_pulled =
        (entry.flags & (peripheralflag::kPullUp | peripheralflag::kPullDown)) != 0;
    if (is_pulled && (chip_.input_only & mask_of(entry.pin_a)))
      tell(PeripheralFault::kNoPull, entry.pin_a);
    if (needs_pull_up && (entry.flags & peripheralflag::kPullDown) != 0)
      tell(PeripheralFault::kNoPull, entry.pin_a);
  }

  constexpr void check_bus(const Peripheral& entry) {
    if (entry.address > 0x77) tell(PeripheralFault::kCode);
    const bool has_number = entry.pin_a >= 0 && entry.pin_b == -1;
    if (has_numbered_buses(board_.chip) != has_number && entry.pin_a >= 0)
      return tell(PeripheralFault::kBus);
    if (has_numbered_buses(board_.chip)) return check_numbered_bus(entry);
    check_driven_pin(entry.pin_a);
    check_driven_pin(entry.pin_b);
    if (entry.pin_c != -1) check_pin(entry.pin_c);
    if (entry.pin_a >= 0 && entry.pin_a == entry.pin_b)
      tell(PeripheralFault::kPinTaken, entry.pin_b);
    if (entry.pin_c != -1 && (entry.pin_c == entry.pin_a || entry.pin_c == entry.pin_b))
      tell(PeripheralFault::kPinTaken, entry.pin_c);
  }

  constexpr void check_numbered_bus(const Peripheral& entry) {
    if (entry.pin_a < 0) return tell(PeripheralFault::kPinMissing);
    if (entry.pin_c != -1) return tell(PeripheralFault::kNotOnThisChip, entry.pin_c);
    if (entry.pin_a != kHeaderBus) return;
    for (const int pin : kHeaderBusPins)
      if (is_of_board(pin) || is_of_another(pin)) tell(PeripheralFault::kPinTaken, pin);
  }

  constexpr void check_driven_pin(int pin) {
    if (check_pin(pin) && (chip_.input_only & mask_of(pin)))
      tell(PeripheralFault::kPinInputOnly, pin);
  }

  /// False if the chip has no such pin at all.
  constexpr bool check_pin(int pin) {
    if (pin < 0) {
      tell(PeripheralFault::kPinMissing);
      return false;
    }
    const auto fault = fault_of_place<PeripheralFault>(chip_, memory_, pin);
    if (fault != PeripheralFault::kNone) tell(fault, pin);
    if (fault == PeripheralFault::kPinAbsent) return false;
    if (is_of_board(pin) || is_of_another(pin)) tell(PeripheralFault::kPinTaken, pin);
    return true;
  }

  constexpr bool is_of_board(int pin) const {
    for (size_t i = 0; i < kBoardPinCount; ++i)
      if (board_.pin(static_cast<BoardPin>(i)) == pin) return true;
    return false;
  }

  /// Chips may share a bus: its two pins, and each with an address of its own.
  constexpr bool is_of_another(int pin) const {
    const Peripheral& entry = list_.entries[channel_];
    for (size_t i = 0; i < channel_; ++i) {
      const Peripheral& other = list_.entries[i];
      const bool shares = is_on_bus(entry.kind) && is_on_bus(other.kind) &&
                          entry.pin_a == other.pin_a && entry.pin_b == other.pin_b;
      if (shares && (has_numbered_buses(board_.chip) || pin == entry.pin_a || pin == entry.pin_b))
        continue;
      if (is_of(other, pin)) return true;
    }
    return false;
  }

  constexpr bool is_of(const Peripheral& entry, int pin) const {
    if (is_on_bus(entry.kind) && has_numbered_buses(board_.chip))
      return entry.pin_a == kHeaderBus && (pin == kHeaderBusPins[0] || pin == kHeaderBusPins[1]);
    return pin == entry.pin_a || pin == entry.pin_b || pin == entry.pin_c;
  }

  constexpr void check_twice(const Peripheral& entry) {
    for (size_t i = 0; i < channel_; ++i) {
      const Peripheral& other = list_.entries[i];
      const bool is_same = entry.kind == other.kind &&
                           (entry.kind == PeripheralKind::kAnalog ? entry.value_b == other.value_b
                                                                  : entry.place == other.place);
      const bool same_address = is_on_bus(entry.kind) && is_on_bus(other.kind) &&
                                entry.pin_a == other.pin_a && entry.pin_b == other.pin_b &&
                                address_of(entry) == address_of(other);
      if (is_same || same_address) return tell(PeripheralFault::kTwice);
    }
  }

  /// On the header of every Raspberry Pi.
  static constexpr int kHeaderBus = 1;
  static constexpr int kHeaderBusPins[] = {2, 3};

  const PeripheralList& list_;
  const BoardDescription& board_;
  const ChipTable& chip_;
  PinMask memory_;
  Report& report_;
  size_t channel_ = 0;
};

/// Calls `report` with each PeripheralIssue; with none for a list that can be used with the board,
/// whose own issues are not looked at.
template <typename Report>
constexpr void check_peripherals(const PeripheralList& list, const BoardDescription& board,
                                 Report&& report) {
  const ChipTable* const chip = table_of(board.chip);
  if (list.count == 0) return;
  if (chip == nullptr) {
    report(PeripheralIssue{.fault = PeripheralFault::kNotOnThisChip, .channel = 0});
  } else {
    PeripheralCheck(list, board, *chip, report).run();
  }
}

/// The first thing that is wrong; `fault` is kNone for a list that can be used.
constexpr PeripheralIssue first_issue(const PeripheralList& list, const BoardDescription& board) {
  PeripheralIssue first;
  check_peripherals(list, board, [&first](const PeripheralIssue& issue) {
    if (first.fault == PeripheralFault::kNone) first = issue;
  });
  return first;
}

}  // namespace wheelwire
