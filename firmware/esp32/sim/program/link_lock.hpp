// A path for a link belongs to one simulator at a time, while its port is unplugged, too.
#pragma once

#include <string>

#include "descriptor.hpp"

namespace wheelwire::sim {

class LinkLock {
 public:
  /// Locks `link`.lock, which names this process. The kernel unlocks it however the process ends.
  /// Throws std::runtime_error, naming the other process, when one holds it.
  explicit LinkLock(const std::string& link);
  LinkLock(const LinkLock&) = delete;
  LinkLock& operator=(const LinkLock&) = delete;
  ~LinkLock();

 private:
  std::string path_;
  Descriptor file_;
};

}  // namespace wheelwire::sim
