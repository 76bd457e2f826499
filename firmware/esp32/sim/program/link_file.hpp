// A symbolic link to the pseudo-terminal, at the path that the user asked for.
#pragma once

#include <string>

namespace wheelwire::sim {

class LinkFile {
 public:
  /// Replaces another link at `path`, but never a file. Throws std::runtime_error.
  LinkFile(std::string path, std::string target);
  LinkFile(const LinkFile&) = delete;
  LinkFile& operator=(const LinkFile&) = delete;
  /// Removes the link, unless another process has replaced it.
  ~LinkFile();

 private:
  std::string path_;
  std::string target_;
};

}  // namespace wheelwire::sim
