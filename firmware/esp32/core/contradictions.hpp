// Parameters that are each within their bounds and still contradict each other, or the board: the
// only place where such rules are written.
#pragma once

#include "parameters.hpp"

namespace wheelwire {

/// Flags of `contradiction`. `max_pwm_hz`: what the board's power stage can switch; 0: not known.
inline uint32_t contradictions(const Parameters& parameters, uint32_t max_pwm_hz) {
  const auto of = [&parameters](ParameterId id) { return parameters.get(id); };
  using enum ParameterId;
  constexpr float kTau = 6.2831853f;
  const float rate_hz = of(kControlRateHz);
  // Of one encoder at max_velocity_mps.
  const float ticks_hz = of(kMaxVelocityMps) / (kTau * of(kWheelRadius)) * of(kCountsPerRevolution);
  uint32_t flags = 0;
  if (of(kOverrunLimitUs) * rate_hz < 1.5e6f) flags |= contradiction::kOverrunLimit;
  if (max_pwm_hz != 0 && of(kPwmFrequencyHz) > static_cast<float>(max_pwm_hz))
    flags |= contradiction::kPwmFrequency;
  if (of(kStreamRateHz) > rate_hz) flags |= contradiction::kStreamRate;
  if (of(kSupplyDropV) >= of(kNominalSupplyV) || of(kSupplyDropV) >= of(kUnmeasuredSupplyV))
    flags |= contradiction::kSupplyDrop;
  if (ticks_hz >= rate_hz * static_cast<float>(kCounterLimit / 2))
    flags |= contradiction::kTickRate;
  // A level of one channel lasts two ticks; by half of that encoders may deviate.
  if (of(kGlitchFilterNs) * ticks_hz >= 1e9f) flags |= contradiction::kGlitchFilter;
  return flags;
}

}  // namespace wheelwire
