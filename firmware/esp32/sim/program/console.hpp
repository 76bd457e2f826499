// Standard input by lines and standard output by lines, neither of which may hold time up.
#pragma once

#include <deque>
#include <optional>
#include <string>

namespace wheelwire::sim {

class Console {
 public:
  /// Reads what is there; to be called when there is something.
  void receive();
  std::optional<std::string> next_line();
  bool ended() const { return ended_; }

  /// Queues a line for standard output.
  void print(const std::string& line);
  /// A line that is only worth something now: dropped while earlier ones wait for the reader.
  void print_if_idle(const std::string& line);
  /// Writes what the reader takes, without waiting.
  void flush();

 private:
  std::string input_;
  bool ended_ = false;
  std::deque<std::string> output_;
};

}  // namespace wheelwire::sim
