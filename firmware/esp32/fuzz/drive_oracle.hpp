// An oracle for the fuzzer: whether the wheels may be driven, derived from the bytes that the
// firmware read. It shares the decoder with the firmware and nothing else.
#pragma once

#include <algorithm>
#include <cmath>

#include "framing.hpp"
#include "parameters.hpp"

namespace wheelwire::fuzz {

class DriveOracle {
 public:
  explicit DriveOracle(uint32_t boot_id) : boot_id_(boot_id), decoder_(body_size) {}

  void read(const uint8_t* data, size_t size, uint64_t now_us) {
    Frame frame;
    for (size_t i = 0; i < size; ++i) {
      if (decoder_.feed(data[i], frame)) take(frame, now_us);
    }
  }

  /// Some setpoint of the open session has not expired, and neither a stop nor a new session came
  /// after it.
  bool valid(uint64_t now_us) const { return now_us < latest_us_; }
  /// How many setpoints the firmware may have accepted.
  uint32_t granted() const { return granted_; }
  /// No deadline lies beyond it, nor that of a setpoint that was voided at once.
  uint64_t furthest_us() const { return furthest_us_; }
  /// How many requests to keep the values of a trial were read.
  uint32_t keeps() const { return keeps_; }
  /// How many requests to begin one were read.
  uint32_t begins() const { return begins_; }
  /// How many messages were read that may change or save parameters, or begin a trial of them.
  uint32_t changes() const { return changes_; }
  /// No trial of parameters lasts beyond it.
  uint64_t trial_until_us() const { return trial_until_us_; }
  /// The open session's; 0 while there is none.
  uint32_t session_id() const { return session_id_; }

 private:
  void take(const Frame& frame, uint64_t now_us) {
    switch (frame.id) {
      case Hello::kId:
        return on(Hello::decode(frame.body));
      case Stop::kId:
        return on(Stop::decode(frame.body));
      case Estop::kId:
        latched_ = true;
        return void_all();
      case ClearEstop::kId:
        if (ours(ClearEstop::decode(frame.body).session_id)) latched_ = false;
        return;
      case Ping::kId:
        synchronised_ |= ours(Ping::decode(frame.body).session_id);
        return;
      case ParameterSet::kId:
      case ParameterSave::kId:
      case ParameterReset::kId:
        ++changes_;
        return;
      case ParameterTrial::kId:
        return on(ParameterTrial::decode(frame.body), now_us);
      case SetWheelVelocity::kId: {
        const auto setpoint = SetWheelVelocity::decode(frame.body);
        if (std::isfinite(setpoint.left_mps) && std::isfinite(setpoint.right_mps))
          on(setpoint, now_us);
        return;
      }
      case SetDuty::kId:
        return on(SetDuty::decode(frame.body), now_us);
    }
  }

  void on(const Hello& hello) {
    const bool agreed =
        hello.protocol_version == schema::kVersion && hello.schema_hash == schema::kHash;
    if (!agreed || (open_ && hello.nonce == nonce_)) return;
    open_ = true;
    nonce_ = hello.nonce;
    session_id_ = hello.nonce ^ boot_id_;
    synchronised_ = false;
    trial_until_us_ = 0;
    newest_command_ = 0;
    void_all();
  }

  void on(const ParameterTrial& request, uint64_t now_us) {
    if (!ours(request.session_id)) return;
    if (request.action == TrialAction::kKeep) ++keeps_;
    if (request.action == TrialAction::kBegin) {
      ++begins_;
      ++changes_;
    }
    trial_until_us_ = std::max(trial_until_us_, now_us + kLongestTrial_us);
  }

  void on(const Stop& stop) {
    if (ours(stop.session_id)) newest_command_ = std::max(newest_command_, stop.command_seq);
    void_all();
  }

  template <typename Setpoint>
  void on(const Setpoint& setpoint, uint64_t now_us) {
    if (!ours(setpoint.session_id) || setpoint.command_seq <= newest_command_) return;
    newest_command_ = setpoint.command_seq;
    if (!synchronised_ || latched_ || setpoint.expiry_us <= now_us) return;
    ++granted_;
    latest_us_ = std::min(setpoint.expiry_us, now_us + kLongestLife_us);
    furthest_us_ = std::max(furthest_us_, latest_us_);
  }

  void void_all() { latest_us_ = 0; }
  bool ours(uint32_t session_id) const { return open_ && session_id == session_id_; }

  // The upper bound of ttl_max_s, which a host can set.
  static constexpr uint64_t kLongestLife_us = 5'000'000;
  static constexpr uint64_t kLongestTrial_us = 60'000'000;
  static_assert(kParameters[static_cast<size_t>(ParameterId::kTtlMaxS) - 1].maximum == 5.0f);

  uint32_t boot_id_;
  FrameDecoder decoder_;
  bool open_ = false;
  bool synchronised_ = false;
  bool latched_ = false;
  uint32_t nonce_ = 0;
  uint32_t session_id_ = 0;
  uint32_t newest_command_ = 0;
  uint64_t latest_us_ = 0;
  uint64_t furthest_us_ = 0;
  uint32_t granted_ = 0;
  uint32_t keeps_ = 0;
  uint32_t begins_ = 0;
  uint32_t changes_ = 0;
  uint64_t trial_until_us_ = 0;
};

}  // namespace wheelwire::fuzz
