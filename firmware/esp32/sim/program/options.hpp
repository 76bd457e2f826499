// The command line of wheelwire-fwsim.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace wheelwire::sim {

struct Options {
  std::string link;
  std::string lock;          ///< To lock in place of `link`, if the link is made elsewhere.
  std::string announcement;  ///< Empty: a line of JSON.
  std::string store;
  int socket = -1;  ///< A descriptor in place of the pseudo-terminal.
  int parent = -1;  ///< Id of a process; when it ends, so does this one.
  uint64_t seed = 0;
  double truth_hz = 0.0;
  bool exit_with_stdin = false;
  bool help = false;
  std::vector<std::pair<std::string, double>> settings;  ///< Variables, in the order given.
  std::vector<std::pair<int, double>> presets;           ///< Defaults by a parameter's id.
};

/// Throws std::invalid_argument with what is wrong.
Options parse_options(int argc, char** argv);

std::string help_text();

/// A whole string as a number. Throws std::invalid_argument.
double parse_number(const std::string& text);

}  // namespace wheelwire::sim
