// Gives a black box's inputs to the same core again, and compares what comes of them with what was
// recorded: every transition, refusal and duty, and each state. Of another core, which may compute
// other duties, only what it did is compared: transitions, refusals and writes to flash.
#pragma once

#include <optional>

#include "box_reader.hpp"
#include "configuration.hpp"
#include "core_hash.hpp"
#include "device.hpp"
#include "given_ports.hpp"
#include "sensor_server.hpp"

namespace wheelwire {

/// Where a re-run is not what was recorded.
struct BoxDifference {
  uint32_t step = 0;  ///< Counted from 1; 0: before the first one.
  uint64_t t_us = 0;
  char field[120] = "";
  double recorded = 0;
  double computed = 0;
};

class Rerun final : public Recorder {
 public:
  enum class Outcome : uint8_t { kSame, kDiffers, kEmpty, kOtherCore, kUnreadable };

  /// Which core's boxes are run: another one's state may have other fields.
  enum class Accept : uint8_t { kThisCore, kAnyCore };

  /// `memory`: as for BoxReader.
  explicit Rerun(const uint32_t* memory, Accept accept = Accept::kThisCore);

  Outcome run();

  // After a run:
  const BoxDifference& difference() const { return difference_; }
  uint32_t steps() const { return steps_; }
  uint64_t first_us() const { return first_us_; }
  uint64_t last_us() const { return last_us_; }

  void note_state(MessageServer&, Robot&) override {}  // Each is compared where the box has it.
  void note_step(const StepNote& note) override;
  void note_message(uint8_t, const uint8_t*, size_t, uint64_t) override { advance(); }
  void note_hang_up(uint64_t) override { advance(); }
  void note_failure(uint32_t) override { advance(); }
  void note_stall() override { advance(); }
  void note_reflexes(uint8_t) override { advance(); }
  void note_contact(bool open) override;
  void note_store(bool done, uint32_t faults) override;
  void note_parameters(Parameters& parameters, ControlConfig& config,
                       uint32_t& contradictions) override;
  void note_transition(SupervisorEvent event, SupervisorState before, SupervisorState after,
                       uint32_t faults) override;
  void note_refusal(uint8_t message_id, RefusalCode code) override;

 private:
  struct Motor final : MotorPort {
    void drive(int16_t) override {}
    void brake() override {}
    void coast() override {}
  };
  struct Line final : ByteStream {
    size_t read(uint8_t*, size_t) override { return 0; }
    bool write(const uint8_t*, size_t) override { return true; }
    uint32_t bytes_per_second() const override { return 0; }
  };
  /// What became of a write is in the box.
  struct Store final : BlockStore {
    explicit Store(Rerun& rerun) : rerun_(rerun) {}
    size_t load(uint8_t*, size_t) override { return 0; }
    bool save(const uint8_t*, size_t) override { return rerun_.write_was_done(); }
    bool format() override { return rerun_.write_was_done(); }
    bool repair() override { return rerun_.write_was_done(); }
    uint32_t faults() override { return rerun_.recorded_store_faults(); }
    Rerun& rerun_;
  };
  /// Only whether there is one decides what is refused.
  struct Archive final : BoxArchive {
    void describe(BoxValue&) const override {}
    size_t read(uint32_t, uint32_t, uint8_t*, size_t) override { return 0; }
    void count(LedgerValue&, uint64_t) const override {}
  };
  /// The same for these: an answer changes only what counts as a repeat.
  struct Platform final : PlatformMessages {
    void serve(MessageServer& server, const Frame&, uint16_t request_id) override {
      server.answer_afresh(request_id, MemoryValue{});
    }
  };
  struct Contact final : EstopInput {
    explicit Contact(Rerun& rerun) : rerun_(rerun) {}
    bool is_open() override { return rerun_.contact_changes() != rerun_.contact_; }
    Rerun& rerun_;
  };

  void advance() {
    has_next_ = reader_.next(next_);
    reads_ = 0;
  }
  void restore();
  void carry_out();
  void carry_out_step();
  void carry_out_message();
  void compare_state();
  void finish_step() {
    if (!is_pending_) return;
    is_pending_ = false;
    device_->finish_step(now_us_);
  }
  bool take(box::Kind kind);
  void differ(const char* field, double recorded, double computed);
  void compare(const char* field, double recorded, double computed) {
    if (recorded != computed) differ(field, recorded, computed);
  }
  bool is_this_core() const { return reader_.origin().core == kCoreHash; }
  bool write_was_done() const;
  uint32_t recorded_store_faults() const;
  /// Whether it is the next read of the contact that finds another level.
  bool contact_changes() const;

  BoxReader reader_;
  Accept accept_;
  BoxEntry next_{};
  bool has_next_ = false;
  Outcome outcome_ = Outcome::kSame;
  BoxDifference difference_;
  uint32_t steps_ = 0;
  uint64_t now_us_ = 0;
  uint64_t first_us_ = 0;
  uint64_t last_us_ = 0;
  bool is_pending_ = false;  // The second half of the step at now_us_ is still to come.
  bool contact_ = false;
  uint32_t reads_ = 0;  // Of the contact, since the last record.
  Motor motor_;
  GivenEncoders encoders_;
  Line line_;
  Store store_{*this};
  NoLatches latches_;
  Archive archive_;
  Platform platform_;
  Contact estop_{*this};
  GivenBattery battery_;
  std::optional<ActiveConfiguration> configuration_;
  std::optional<SensorServer> sensors_;
  std::optional<Device> device_;
};

}  // namespace wheelwire
