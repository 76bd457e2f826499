// Both lines at once, as long as no board says which one is wired.
#pragma once

#include "line.hpp"

namespace wheelwire {

/// A chip whose board was never written may have its UART or only its own USB on a socket. It
/// listens on both, and speaks on the one that was heard last.
class EitherLine final : public Line {
 public:
  EitherLine(Line& first, Line& second) : first_(first), second_(second), heard_(&first) {}

  /// One of them is enough.
  bool start() override {
    const bool first_started = first_.start();
    return second_.start() || first_started;
  }
  void notify(TaskHandle_t task, uint32_t bits) override {
    first_.notify(task, bits);
    second_.notify(task, bits);
  }
  void push() override {
    first_.push();
    second_.push();
  }

  size_t read(uint8_t* out, size_t capacity) override {
    const size_t size = heard_->read(out, capacity);
    if (size > 0) return size;
    Line& other = heard_ == &first_ ? second_ : first_;
    const size_t other_size = other.read(out, capacity);
    if (other_size > 0) heard_ = &other;
    return other_size;
  }
  bool write(const uint8_t* data, size_t size) override { return heard_->write(data, size); }
  uint32_t bytes_per_second() const override { return heard_->bytes_per_second(); }

 private:
  Line& first_;
  Line& second_;
  Line* heard_;
};

}  // namespace wheelwire
