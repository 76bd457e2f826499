// Standard input and output, line by line. They must not delay simulated time.
#pragma once

#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <deque>
#include <optional>
#include <string>

namespace wheelwire::sim {

class Console {
 public:
  /// Reads what is available. Call when the input is readable.
  void receive() {
    if (ended_) return;
    char buffer[4096];
    const ssize_t count = ::read(STDIN_FILENO, buffer, sizeof buffer);
    if (count < 0 && errno == EINTR) return;
    if (count <= 0) {
      ended_ = true;
      return;
    }
    input_.append(buffer, static_cast<size_t>(count));
  }

  std::optional<std::string> next_line() {
    const size_t end = input_.find('\n');
    if (end == std::string::npos) {
      // An endless line is not a command.
      if (input_.size() >= kMaxInput) input_.clear();
      return std::nullopt;
    }
    std::string line = input_.substr(0, end);
    input_.erase(0, end + 1);
    return line;
  }

  bool ended() const { return ended_; }

  /// Queues a line for standard output.
  void print(const std::string& line) {
    if (output_.size() < kMaxQueue) output_.push_back(line);
    flush();
  }

  /// Queues a line that is of use only now: dropped while earlier ones wait for the reader.
  void print_if_idle(const std::string& line) {
    flush();
    if (output_.empty()) print(line);
  }

  /// Writes as much as the reader takes, without blocking.
  /// A writable pipe takes a line shorter than PIPE_BUF whole, without blocking. All of ours are.
  void flush() {
    while (!output_.empty() && takes_output()) {
      const std::string& line = output_.front();
      const ssize_t written = ::write(STDOUT_FILENO, line.data(), line.size());
      if (written < 0 && errno == EINTR) continue;
      output_.pop_front();  // Without a reader the line is lost.
    }
  }

 private:
  static constexpr size_t kMaxInput = 4096;

  static constexpr size_t kMaxQueue = 4096;

  static bool takes_output() {
    pollfd entry{.fd = STDOUT_FILENO, .events = POLLOUT, .revents = 0};
    return ::poll(&entry, 1, 0) > 0;
  }

  std::string input_;
  bool ended_ = false;
  std::deque<std::string> output_;
};

}  // namespace wheelwire::sim
