// Everything in the simulation that can be set or read, by name: one table for the C interface, the
// command line and the help text.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "libfwsim.h"
#include "simulator.hpp"

namespace wheelwire::sim {

struct Variable {
  std::string name;
  const char* unit;
  std::string doc;
  double minimum;
  double maximum;
  bool whole = false;  ///< Takes whole numbers only.
  std::function<double(const Simulator&)> get{};
  /// Empty if read-only. Returns false if the value is inconsistent with the others.
  std::function<bool(Simulator&, double)> set{};
};

enum class VariableStatus {
  kOk = FWSIM_OK,
  kUnknownName = FWSIM_UNKNOWN_NAME,
  kReadOnly = FWSIM_READ_ONLY,
  kOutOfRange = FWSIM_OUT_OF_RANGE
};

/// In the order of the help text.
const std::vector<Variable>& variables();

/// Changes nothing unless it returns kOk.
VariableStatus set_variable(Simulator& simulator, const std::string& name, double value);
VariableStatus get_variable(const Simulator& simulator, const std::string& name, double& value);

}  // namespace wheelwire::sim
