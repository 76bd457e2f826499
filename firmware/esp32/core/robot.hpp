// The robot itself: parameters, supervisor, faults, and the wheels that follow the active setpoint.
// It has no link or messages: `MessageServer` turns messages into calls, and `Device` joins the
// two.
#pragma once

#include "config.hpp"
#include "drive.hpp"
#include "hal.hpp"
#include "latches.hpp"
#include "parameters.hpp"
#include "protocol.hpp"
#include "recorder.hpp"
#include "rolling.hpp"
#include "stop_action.hpp"
#include "supervisor.hpp"
#include "trial.hpp"

namespace wheelwire {

/// What a host asks of the wheels.
struct Setpoint {
  ControlMode mode;
  WheelPair wheels;    ///< um/s or q15, by the mode.
  uint64_t expiry_us;  ///< Device clock.
  uint32_t command_seq;
};

struct Transition {
  SupervisorEvent cause;
  SupervisorState before;
  SupervisorState after;
};

/// Called at each change of the supervisor's state, within the call that caused it. By then the
/// drive is off if the state no longer allows it.
class RobotObserver {
 public:
  virtual void on_transition(Transition transition, uint64_t now_us) = 0;
  /// A trial was not renewed in time. The previous parameters are active.
  virtual void on_trial_expired(uint64_t now_us) = 0;
  /// The robot rolls although nothing drives it.
  virtual void on_rolling(int32_t speed_umps, uint64_t now_us) = 0;
  /// Which sensors hold the robot, as flags of `held`.
  virtual uint32_t sensed() const = 0;

 protected:
  ~RobotObserver() = default;
};

/// What the robot has to know of the board that it is on.
struct BoardFacts {
  uint32_t checksum = 0;    ///< 0: not known.
  uint32_t max_pwm_hz = 0;  ///< Highest frequency of its power stage; 0: not known.
  /// Otherwise its inputs mean nothing, the e-stop contact among them.
  bool is_confirmed = true;
  bool on_trial = false;

  /// On another one the inputs of the power stage that brake may drive.
  bool may_brake() const { return is_confirmed && !on_trial; }
};

/// What is in flash, apart from the recorder.
enum class StoredBlock : uint8_t { kConfiguration, kParameterValues, kLatches };
constexpr size_t kStoredBlocks = 3;

class Robot {
 public:
  /// `specs`: see Parameters. `observer` is not called before start().
  Robot(const Hal& hal, RobotObserver& observer, const ParameterSpec* specs,
        const BoardFacts& board);

  /// Loads the parameters and leaves BOOT. Call once the hardware is ready.
  void start(ResetReason reason, uint64_t now_us);
  /// First half of a control step, before messages are read: latches encoders, detects faults.
  void begin_step(uint64_t now_us);
  /// Second half, after they are read: e-stop contact, deadline, outputs.
  void finish_step(uint64_t now_us);
  /// What the sensors forbid from the next control step on, as flags of `reflex`, with
  /// kBatteryAtStop.
  void note_reflexes(uint8_t reflexes);
  /// There are sensors that can stop the robot. Call it before the start: nothing drives before the
  /// first step has their state.
  void expect_sensors() { note_reflexes(reflex::kUnread); }
  /// Sets FAULT until the next reset, with these flags of `fault`: a motor or encoder peripheral
  /// did not start, or there is no board.
  void report_failure(uint32_t faults) {
    failures_ |= faults;
    if (recorder_ != nullptr) recorder_->note_failure(faults);
  }

  /// Call it with every setpoint that is refused, here or before it came here: it shows that a
  /// program goes on sending.
  void note_refused_setpoint(uint64_t now_us) { quiet_since_us_ = now_us; }
  /// Drives the wheels by this setpoint, for ttl_max at most. Returns kNone, or why not.
  RefusalCode obey(const Setpoint& setpoint, uint64_t now_us);
  /// Reverts a trial; nothing drives until the next setpoint.
  void end_session(SupervisorEvent event, StopCause cause, uint64_t now_us);
  /// The setpoints that follow are of this session.
  void begin_session(uint32_t session_id) { session_id_ = session_id; }
  /// `by_session`: it comes from the open session. Only such a Stop can weaken a stop, by naming a
  /// mode; any other stops at least as strongly as configured.
  void stop(StopMode mode, bool by_session, uint64_t now_us);
  void estop(EstopSource source, uint64_t now_us);
  /// The board that was on trial is confirmed.
  void note_board_confirmed() { board_.on_trial = false; }

  static constexpr ParameterId kAllParameters{0};

  // Each returns kNone, or why it was refused.
  RefusalCode clear_estop(uint64_t now_us);
  RefusalCode clear_fault(uint64_t now_us);
  RefusalCode set_parameter(ParameterId id, float value, uint64_t now_us);
  /// One, or kAllParameters.
  RefusalCode save_parameters(ParameterId id);
  RefusalCode reset_parameters(uint64_t now_us);
  /// Why the chip must not be stalled now, as by a write to flash.
  RefusalCode check_stopped() const;
  /// Why the board cannot be changed now: an e-stop is latched, or its contact is open. On an
  /// unconfirmed board neither counts, because it drives nothing.
  RefusalCode check_estop(uint64_t now_us);
  /// Whether the wheels stand: no recent ticks, and nothing has driven them for long enough that
  /// even a wheel with a dead encoder has run down. This takes as long after a start, because the
  /// robot may have been rolling before.
  bool is_at_rest(uint64_t now_us) const {
    return !supervisor_.may_drive() && drive_.is_still() && now_us - drove_us_ >= kRunDownUs;
  }
  /// Something was written to flash: the next control step may be late.
  void note_stall() { stalled_ = true; }
  /// As `note_stall`, with the result of the write.
  void note_write(bool done) {
    note_stall();
    if (recorder_ != nullptr) recorder_->note_store(done, hal_.store.faults());
  }
  RefusalCode try_parameters(TrialAction action, float timeout_s, uint64_t now_us);

  SupervisorState state() const { return supervisor_.state(); }
  /// Latched, as flags of `fault`.
  uint32_t faults() const { return faults_; }
  /// How often a fault was latched that was not latched already. Wraps.
  uint16_t faults_tripped() const { return faults_tripped_; }
  /// When the active setpoint expires, device clock; 0: there is none.
  uint64_t deadline_us() const { return setpoint_.expiry_us; }
  /// Number of the active setpoint; 0: there is none.
  uint32_t command_seq() const { return setpoint_.command_seq; }

  const Parameters& parameters() const { return parameters_; }
  /// Parameters that the next start would load with another value, as Parameters::unsaved.
  uint64_t unsaved_parameters() const { return parameters_.unsaved(hal_.store); }
  bool on_trial() const { return trial_.runs(); }
  /// Flags of `contradiction`: of the active values, and of the values last refused.
  uint32_t active_contradictions() const { return contradictions_; }
  uint32_t refused_contradictions() const { return refused_contradictions_; }
  /// Whether parameters are saved.
  Parameters::Load store_state() const { return store_state_; }
  /// The blocks of which the start found only one of two copies, as bits by StoredBlock.
  uint8_t lost_copies() const { return lost_copies_; }

  WheelPair commanded() const { return drive_.commanded(); }
  const Wheel& left() const { return drive_.left(); }
  const Wheel& right() const { return drive_.right(); }
  /// Counts by wheel, as latched by the last step.
  const EncoderCounts& encoder_counts() const { return counts_; }
  uint16_t battery_mv() const { return hal_.battery.millivolts(); }
  /// What the sensors forbid, as flags of `reflex`, with kBatteryAtStop.
  uint8_t reflexes() const { return reflexes_; }
  /// What keeps the robot from driving, but for sensors and configuration, as flags of `held`.
  uint32_t held(uint64_t now_us) const;
  /// Who latched the e-stop.
  EstopSource estop_source() const { return estop_source_; }
  /// What ended the last motion.
  const LastStop& last_stop() const { return latches_.stop(); }
  /// When, device clock; 0: before the start.
  uint64_t stop_us() const { return stop_us_; }
  /// Counts what is new about it. Wraps.
  uint8_t stop_news() const { return stop_news_; }
  /// Measures how far the robot rolls after that, until its wheels stand. Call it now and then.
  void follow_stop();
  /// nullptr: nothing is recorded.
  Recorder* recorder() const { return recorder_; }
  void record(Recorder& recorder) { recorder_ = &recorder; }

  uint32_t control_period_us() const { return config_.period_us; }
  uint64_t last_step_us() const { return last_step_us_; }
  /// Control steps that came more than half a period late. Wraps.
  uint32_t late_steps() const { return late_steps_; }
  /// The longest time from one step to the next.
  uint32_t longest_interval_us() const { return longest_interval_us_; }

 private:
  void note_step(uint64_t now_us, uint16_t battery_mv);
  uint32_t check_timing(uint64_t now_us);
  void trip(uint32_t faults, uint64_t now_us) {
    faults |= lasting_faults();
    if ((faults | faults_) != 0) latch_faults(faults, now_us);
  }
  void latch_faults(uint32_t faults, uint64_t now_us);
  bool contact_is_open();
  void check_contact(uint64_t now_us) {
    const bool is_open = contact_is_open();
    if (is_open != contact_open_) note_contact(is_open, now_us);
  }
  /// The contact acts when it opens: as long as it is open, the e-stop is latched.
  void note_contact(bool is_open, uint64_t now_us) {
    contact_open_ = is_open;
    if (is_open) estop(EstopSource::kContact, now_us);
  }
  bool is_latched() const { return setpoint_refusal(supervisor_.state()) != RefusalCode::kNone; }
  void actuate_within_reflexes(uint64_t now_us);
  void hold_off(uint64_t now_us);
  void hold_still(uint64_t now_us);
  void note_speed(uint64_t now_us);
  bool turns() const { return drive_.left().turns() || drive_.right().turns(); }
  RefusalCode standing_refusal(const Setpoint& setpoint, uint64_t now_us);
  bool stopped_by_sensors() const { return (reflexes_ & reflex::kStop) != 0; }
  /// Faults whose cause lasts. Unreadable saved parameters are one: the robot would drive with
  /// defaults that nobody chose for it.
  uint32_t lasting_faults() const { return store_faults_ | failures_; }
  void actuate(uint64_t now_us);
  void follow() {
    rolling_.reset();
    drive_.follow(setpoint_.mode, target_, config_);
  }
  /// Nothing drives, so the robot may roll.
  void keep_stopped(bool brakes, uint64_t now_us) {
    drive_.keep_stopped(brakes);
    note_speed(now_us);
  }
  void stand_still(uint64_t now_us);
  void sync_latches(bool brakes, uint64_t now_us);
  bool arm(const Setpoint& setpoint, uint64_t now_us);
  void disarm(uint8_t unarmed, uint64_t now_us);
  void note_forbidden() { drive_.note_reflexes(forbidden()); }
  /// What the sensors forbid, and which way the robot is not to go yet, as flags of `reflex`.
  uint8_t forbidden() const { return reflexes_ | unarmed_; }
  void note_latches();
  void begin_motion();
  void end_motion(StopCause cause, uint64_t now_us);
  StopCause cause_of(uint32_t new_faults) const;
  /// At least as strong as any other stop, unless it is set to coast.
  StopMode estop_mode() const {
    if (config_.estop_mode == StopMode::kCoast) return StopMode::kCoast;
    return config_.stop_mode == StopMode::kBrakeUntilDriven ? config_.stop_mode
                                                            : config_.estop_mode;
  }
  StopMode mode_at(uint32_t new_faults) const;
  template <typename Begin>
  void change_action(Begin begin);
  void begin_action(StopMode mode, bool may_weaken, uint64_t now_us);
  /// `cause`: of the end of the motion, if the event ends one.
  void apply(SupervisorEvent event, uint64_t now_us, StopCause cause = StopCause::kUnknown);
  void apply_parameters();
  void check_trial(uint64_t now_us);
  RefusalCode keep_trial();
  RefusalCode extend_trial(bool begins, float timeout_s, uint64_t now_us);
  WheelPair limited(const Setpoint& setpoint) const;
  RefusalCode conclude_save(bool saved);
  /// By StoredBlock; nullptr: there is none.
  BlockStore* store_of(size_t block);
  void repair_one(uint64_t now_us);

  static constexpr uint64_t kRunDownUs = 2'000'000;
  static constexpr uint64_t kSlowUs = 500'000;
  /// After a repair that failed: each one stalls the chip.
  static constexpr uint64_t kRepairIntervalUs = 10'000'000;
  /// In addition to the flags of `reflex` that mean a direction.
  static constexpr uint8_t kUnarmed = 0x80;

  // What each step uses comes first: RISC-V addresses only the first 2 KiB of an object directly.
  Hal hal_;
  RobotObserver& observer_;
  Recorder* recorder_ = nullptr;
  BoardFacts board_;
  Supervisor supervisor_;
  bool parameters_changed_ = false;  // and not active yet
  // Where the robot is not to go before a zero setpoint or a gap: towards a bumper that held the
  // drive off, as flags of `reflex`, or nowhere, after each start and each clear.
  uint8_t unarmed_ = kUnarmed;
  bool stalled_ = false;
  bool is_refused_ = false;    // A setpoint, because the robot is unarmed.
  bool moves_ = false;         // A setpoint that is not zero moves it.
  bool contact_open_ = false;  // When it was last looked at.
  uint8_t reflexes_ = 0;
  uint16_t faults_tripped_ = 0;
  uint32_t failures_ = 0;
  uint32_t store_faults_ = 0;
  uint32_t faults_ = 0;
  uint32_t contradictions_ = 0;
  uint64_t last_step_us_ = 0;
  uint32_t late_steps_ = 0;
  uint32_t longest_interval_us_ = 0;
  uint64_t drove_us_ = 0;         // When the drive was last removed, or the robot started.
  uint64_t quiet_since_us_ = 0;   // No setpoint came in this session since then.
  uint64_t not_slow_us_ = 0;      // When it last did anything but creep, without drive.
  uint64_t bumped_until_us_ = 0;  // Until then it brakes because it goes towards a bumper.
  Setpoint setpoint_{};           // with its expiry brought forward to what ttl_max allows
  WheelPair target_{};            // the setpoint's, within the limits and those of the reflexes
  EncoderCounts counts_{};
  StopAction stop_action_;
  RollingMonitor rolling_;
  ControlConfig config_;
  Drive drive_;
  LatchKeeper latches_;
  uint32_t refused_contradictions_ = 0;
  uint8_t lost_copies_ = 0;  // Bits by StoredBlock,
  uint8_t repairs_ = 0;      // and of those that must be rewritten.
  uint64_t next_repair_us_ = 0;
  EstopSource estop_source_ = EstopSource::kNone;
  uint32_t session_id_ = 0;
  uint32_t driver_ = 0;  // The session whose setpoint drives, or drove last.
  uint64_t stop_us_ = 0;
  int32_t stop_ticks_[2]{};  // Of both wheels, when it was stopped.
  uint8_t stop_news_ = 0;
  Parameters::Load store_state_ = Parameters::Load::kLoaded;
  Parameters parameters_;
  Trial trial_;
};

}  // namespace wheelwire
