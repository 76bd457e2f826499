// The host's end of the line.
#pragma once

#include <cstdint>
#include <string>

#include "uart.hpp"

namespace wheelwire::sim {

class HostPort {
 public:
  virtual ~HostPort() = default;

  virtual const std::string& name() const = 0;
  virtual int descriptor() const = 0;
  /// The rate that the host has set; 0 if it has hung up or the port has no rate.
  virtual uint32_t host_baud() const = 0;
  /// The host is gone for good.
  virtual bool ended() const = 0;

  /// What the host has sent.
  virtual Bytes read() = 0;
  /// What does not fit is lost.
  virtual void write(const Bytes& data) = 0;
};

}  // namespace wheelwire::sim
