// The host's end of the line.
#pragma once

#include <cstdint>
#include <string>

#include "descriptor.hpp"
#include "uart.hpp"

namespace wheelwire::sim {

class HostPort {
 public:
  HostPort(Descriptor&& end, std::string name) : end_(std::move(end)), name_(std::move(name)) {}
  virtual ~HostPort() = default;

  const std::string& name() const { return name_; }
  int descriptor() const { return end_.get(); }
  /// The rate that the host has set; 0 if it has hung up or the port has no rate.
  virtual uint32_t host_baud() const { return 0; }
  /// The host is gone for good.
  virtual bool ended() const { return false; }

  /// What the host has sent.
  virtual Bytes read() = 0;
  /// What does not fit is lost.
  virtual void write(const Bytes& data) = 0;

 private:
  Descriptor end_;
  std::string name_;
};

}  // namespace wheelwire::sim
