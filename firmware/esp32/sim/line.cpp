#include "line.hpp"

#include <algorithm>

namespace wheelwire::sim {

namespace {

constexpr double kBitsPerByte = 10.0;
constexpr uint32_t kRomBaud = 115200;

size_t take(std::deque<uint8_t>& queue, uint8_t* out, size_t capacity) {
  const size_t count = std::min(capacity, queue.size());
  const auto end = queue.begin() + static_cast<std::ptrdiff_t>(count);
  std::copy(queue.begin(), end, out);
  queue.erase(queue.begin(), end);
  return count;
}

}  // namespace

size_t Line::read(uint8_t* out, size_t capacity) {
  if (tap_ == nullptr) return take(receive_, out, capacity);
  const auto zero = std::find(receive_.begin(), receive_.end(), uint8_t{0});
  const auto chunk = static_cast<size_t>(zero - receive_.begin()) + 1;
  const size_t size = take(receive_, out, std::min(chunk, capacity));
  tap_->on_read(out, size);
  return size;
}

bool Line::write(const uint8_t* data, size_t size) {
  if (size > kSendCapacity - send_.size()) return false;
  send_.insert(send_.end(), data, data + size);
  if (tap_ != nullptr) tap_->on_write(data, size);
  return true;
}

void Line::host_write(const uint8_t* data, size_t size) {
  const size_t room = kHostCapacity - std::min(kHostCapacity, wire_to_device_.size());
  const size_t taken = std::min(size, room);
  wire_to_device_.insert(wire_to_device_.end(), data, data + taken);
  lost_to_device_ += size - taken;
}

size_t Line::host_read(uint8_t* out, size_t capacity) { return take(to_host_, out, capacity); }

/// How many of the queued bytes arrive within `seconds`.
size_t Line::wire_share(double seconds, size_t queued, double& credit) const {
  if (baud_ == 0) return queued;
  credit += seconds * baud_ / kBitsPerByte;
  const size_t whole = std::min(queued, static_cast<size_t>(credit));
  // Time in which the wire was idle is not credited.
  credit = whole == queued ? 0.0 : credit - static_cast<double>(whole);
  return whole;
}

void Line::carry(double seconds, bool listening) {
  size_t arriving = wire_share(seconds, wire_to_device_.size(), credit_to_device_);
  for (; arriving > 0; --arriving) {
    if (listening && receive_.size() < kReceiveCapacity) {
      receive_.push_back(wire_to_device_.front());
    } else {
      ++lost_to_device_;
    }
    wire_to_device_.pop_front();
  }
  size_t leaving = wire_share(seconds, send_.size(), credit_to_host_);
  for (; leaving > 0; --leaving) {
    deliver_to_host(send_.front());
    send_.pop_front();
  }
}

double Line::until_idle() const {
  const double to_device = seconds_for(wire_to_device_.size(), credit_to_device_);
  const double to_host = seconds_for(send_.size(), credit_to_host_);
  return to_device > 0.0 && to_host > 0.0 ? std::min(to_device, to_host)
                                          : std::max(to_device, to_host);
}

double Line::seconds_for(size_t queued, double credit) const {
  if (baud_ == 0 || queued == 0) return 0.0;
  return (static_cast<double>(queued) - credit) * kBitsPerByte / baud_;
}

void Line::deliver_to_host(uint8_t byte) {
  if (to_host_.size() < kHostCapacity) {
    to_host_.push_back(byte);
  } else {
    ++lost_to_host_;
  }
}

void Line::reset() {
  receive_.clear();
  send_.clear();
}

void Line::emit_from_rom(const Bytes& text) {
  const Bytes received = baud_ == 0 ? text : resample(text, kRomBaud, baud_);
  for (const uint8_t byte : received) deliver_to_host(byte);
}

}  // namespace wheelwire::sim
