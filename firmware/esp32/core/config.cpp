#include "config.hpp"

namespace wheelwire {
namespace {

using enum ParameterId;

constexpr float kPi = 3.14159265f;

uint32_t to_us(float seconds) { return static_cast<uint32_t>(to_fixed(seconds * 1e6f)); }

/// A gain in duty per m/s as q15 duty per um/s, scaled by 2^fraction_bits.
int32_t to_gain(float duty_per_mps, int fraction_bits) {
  return to_fixed(duty_per_mps * (static_cast<float>(kFullDuty) * 1e-6f) *
                  static_cast<float>(1ull << fraction_bits));
}

/// At least 1: with a slew limit of 0 a setpoint would never be reached.
int32_t to_step(float per_step) {
  const int32_t step = to_fixed(per_step);
  return step > 0 ? step : 1;
}

/// Log2 of the control steps in a quarter of a second.
int32_t memory_shift(float period_s) {
  int32_t shift = 0;
  while (static_cast<float>(2 << shift) * period_s < 0.26f) ++shift;
  return shift;
}

int32_t to_q16(float value) { return to_fixed(value * 65536.0f); }
int32_t to_mv(float volts) { return to_fixed(volts * 1000.0f); }

}  // namespace

ControlConfig make_config(const Parameters& parameters) {
  const float period_s = 1.0f / parameters.get(kControlRateHz);
  const float um_per_tick =
      2e6f * kPi * parameters.get(kWheelRadius) / parameters.get(kCountsPerRevolution);
  const int32_t drop_mv = to_mv(parameters.get(kSupplyDropV));
  return {
      .period_us = to_us(period_s),
      .um_per_tick_q10 = to_fixed(um_per_tick * 1024.0f),
      .velocity_window_us = static_cast<uint32_t>(parameters.get(kVelocityWindowUs)),
      .gains =
          {
              .proportional_q24 = to_gain(parameters.get(kProportionalGain), 24),
              .integral_q32 = to_gain(parameters.get(kIntegralGain) * period_s, 32),
              .feedforward_q24 = to_gain(parameters.get(kVelocityFeedforward), 24),
              .acceleration_q24 = to_gain(parameters.get(kAccelerationFeedforward) / period_s, 24),
              .delay_steps = to_fixed(parameters.get(kVelocityWindowUs) * 0.65e-6f / period_s),
              .static_q15 = to_q15(parameters.get(kStaticFeedforward)),
              .margin_q15 = to_q15(parameters.get(kPlausibilityMargin)),
              .limit_q15 = to_q15(parameters.get(kMaxDuty)),
              .slew_umps = to_step(parameters.get(kMaxAccelerationMps2) * period_s * 1e6f),
              .memory_shift = memory_shift(period_s),
          },
      .path =
          {
              .path_q16 = to_q16(parameters.get(kPathGain)),
              .heading_q16 = to_q16(parameters.get(kHeadingGain)),
              .catch_up_q15 = to_q15(parameters.get(kPathCatchUp)),
              .limit_um = to_umps(parameters.get(kPathErrorLimitM)),
          },
      .faults =
          {
              .stall_duty_q15 = to_q15(parameters.get(kStallDuty)),
              .stall_time_us = to_us(parameters.get(kStallTimeS)),
              .reversal_duty_q15 = to_q15(parameters.get(kReversalDuty)),
              .reversal_umps = to_umps(parameters.get(kReversalVelocityMps)),
          },
      .plausibility_time_us = to_us(parameters.get(kPlausibilityTimeS)),
      .supply =
          {
              .nominal_mv = to_mv(parameters.get(kNominalSupplyV)) - drop_mv,
              .drop_mv = drop_mv,
              .unmeasured_mv = to_mv(parameters.get(kUnmeasuredSupplyV)),
          },
      .max_velocity_umps = to_umps(parameters.get(kMaxVelocityMps)),
      .velocity_slew_umps = to_step(parameters.get(kMaxAccelerationMps2) * period_s * 1e6f),
      .duty_slew_q15 =
          to_step(parameters.get(kMaxDutyRatePerS) * period_s * static_cast<float>(kFullDuty)),
      .left_motor_inverted = parameters.is_on(kLeftMotorInverted),
      .right_motor_inverted = parameters.is_on(kRightMotorInverted),
      .left_encoder_inverted = parameters.is_on(kLeftEncoderInverted),
      .right_encoder_inverted = parameters.is_on(kRightEncoderInverted),
      .motors_swapped = parameters.is_on(kMotorsSwapped),
      .encoders_swapped = parameters.is_on(kEncodersSwapped),
      .stop_mode = static_cast<StopMode>(parameters.get(kStopMode)),
      .estop_mode = static_cast<StopMode>(parameters.get(kEstopMode)),
      .brake_time_us = to_us(parameters.get(kBrakeTimeS)),
      .ttl_max_us = to_us(parameters.get(kTtlMaxS)),
      .rearm_gap_us = greater(to_us(parameters.get(kRearmGapS)), to_us(parameters.get(kTtlMaxS))),
      .rolling_umps = to_umps(parameters.get(kRollingVelocityMps)),
      .overrun_limit_us = static_cast<uint32_t>(parameters.get(kOverrunLimitUs)),
      .estop_input_enabled = parameters.is_on(kEstopInputEnabled),
  };
}

}  // namespace wheelwire
