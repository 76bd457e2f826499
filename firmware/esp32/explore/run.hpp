// One scenario carried out on the simulated robot, with every rule checked at every step.
#pragma once

#include <array>
#include <deque>
#include <optional>

#include "coverage.hpp"
#include "host.hpp"
#include "operation.hpp"
#include "random.hpp"
#include "rules.hpp"

namespace wheelwire::explore {

class Run final : public sim::LineTap, public sim::StoreWatch, public sim::FlashWatch {
 public:
  /// Uses the scenario's seed and exceptions, but not its operations: these follow one by one.
  Run(const Scenario& scenario, Coverage& coverage);
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;

  /// False once a rule is broken, or the run can judge nothing more.
  bool apply(const Operation& operation);

  const std::optional<Finding>& finding() const { return judge_.finding(); }
  sim::Simulator& simulator() { return simulator_; }
  Witness& witness() { return witness_; }
  double seconds() const { return static_cast<double>(simulator_.board.now()) * 1e-9; }

  void on_read(const uint8_t* data, size_t size) override;
  void on_write(const uint8_t* data, size_t size) override;
  sim::WriteFate fate_of_write(const sim::Store& store, int slot) override;
  void on_flash() override;

 private:
  /// On its way to the device.
  struct Delayed {
    sim::Nanoseconds due;
    Bytes bytes;
  };
  /// What befalls the next frame from a host.
  enum class Impairment { kNone, kLost, kDoubled, kDelayed, kBit, kCut };

  void run_for(double us);
  void advance_to(sim::Nanoseconds end);
  void call(bool stepped);
  void settle(bool call_ended);
  void note_reset();
  void reset(ResetReason reason);
  void pass_answers();

  void message(const Operation& operation);
  void setpoint(const Operation& operation);
  void hold(const Operation& operation);
  void open(Host& host, bool arms);
  void drive_with_gaps(const Operation& operation);
  void change_robot(const Operation& operation);
  void change_plant(const Operation& operation);
  void configure(const Operation& operation, Host& host);
  void touch(const Operation& operation);
  void wire(int board);
  void compare_boards();
  void disturb(bool lasts = true);
  void send(const Bytes& bytes);
  template <typename Message>
  void send_request(Host& host, Message message, int ahead = 1, int session = 0);
  uint32_t session_of(Host& host, int session);
  Host& host_of(const Operation& operation);

  bool ended() const { return judge_.finding().has_value() || witness_.lost_track(); }

  sim::Simulator simulator_;
  /// By StoredBlock.
  std::array<sim::Store*, kStoredBlocks> stores_{&simulator_.board.configuration_store,
                                                 &simulator_.board.store,
                                                 &simulator_.board.latch_store};
  Witness witness_{simulator_};
  World world_;
  Judge judge_;
  Coverage& coverage_;
  std::array<Host, 2> hosts_;
  WireDecoder to_device_;
  WireDecoder from_device_;
  std::array<WireDecoder, 2> to_host_;
  std::deque<Delayed> delayed_;
  Impairment impairment_ = Impairment::kNone;
  uint32_t impaired_at_ = 0;
  uint64_t impaired_us_ = 0;
  int cut_in_ = -1;  ///< Writes until the power goes; -1: never.
  sim::WriteFate cut_fate_ = sim::WriteFate::kUntouched;
  bool dead_ = false;  ///< The power went in the middle of what the firmware was doing.
  bool started_ = false;
  uint32_t boot_id_;
};

}  // namespace wheelwire::explore
