// A link's path belongs to one simulator at a time, even while its port is unplugged.
#pragma once

#include <string>

#include "descriptor.hpp"

namespace wheelwire::sim {

class LinkLock {
 public:
  /// Locks `link`.lock, which holds this process's id. The kernel unlocks it however the process
  /// ends. Throws std::runtime_error, which names the other process, if one holds it.
  explicit LinkLock(const std::string& link);
  LinkLock(const LinkLock&) = delete;
  LinkLock& operator=(const LinkLock&) = delete;
  ~LinkLock();

 private:
  std::string path_;
  Descriptor file_;
};

}  // namespace wheelwire::sim
