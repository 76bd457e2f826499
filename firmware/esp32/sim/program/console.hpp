// Standard input and output, line by line. They must not delay simulated time.
#pragma once

#include <deque>
#include <optional>
#include <string>

namespace wheelwire::sim {

class Console {
 public:
  /// Reads what is available. Call when the input is readable.
  void receive();
  std::optional<std::string> next_line();
  bool ended() const { return ended_; }

  /// Queues a line for standard output.
  void print(const std::string& line);
  /// Queues a line that is of use only now: dropped while earlier ones wait for the reader.
  void print_if_idle(const std::string& line);
  /// Writes as much as the reader takes, without blocking.
  void flush();

 private:
  std::string input_;
  bool ended_ = false;
  std::deque<std::string> output_;
};

}  // namespace wheelwire::sim
