// A symbolic link to the pseudo-terminal, at the path that the user asked for.
#pragma once

#include <string>

namespace wheelwire::sim {

class LinkFile {
 public:
  /// Takes the place of another link at `path`, never of a file. Throws std::runtime_error.
  LinkFile(std::string path, std::string target);
  LinkFile(const LinkFile&) = delete;
  LinkFile& operator=(const LinkFile&) = delete;
  /// Removes the link, unless it is somebody else's by now.
  ~LinkFile();

 private:
  std::string path_;
  std::string target_;
};

}  // namespace wheelwire::sim
