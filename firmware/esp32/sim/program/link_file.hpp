// A symbolic link to the pseudo-terminal, at the path that the user asked for.
#pragma once

#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>

namespace wheelwire::sim {

namespace fs = std::filesystem;

class LinkFile {
 public:
  /// Replaces another link at `path`, but never a file. Throws std::runtime_error.
  LinkFile(std::string path, std::string target)
      : path_(std::move(path)), target_(std::move(target)) {
    std::error_code error;
    const fs::file_status status = fs::symlink_status(path_, error);
    if (fs::exists(status) && !fs::is_symlink(status)) {
      throw std::runtime_error(path_ + " exists and is not a link; choose another path");
    }
    const std::string fresh = path_ + "." + std::to_string(::getpid());
    fs::create_symlink(target_, fresh, error);
    if (!error) fs::rename(fresh, path_, error);
    if (error) {
      std::error_code ignored;
      fs::remove(fresh, ignored);
      throw std::runtime_error("cannot make the link " + path_ + ": " + error.message());
    }
  }

  LinkFile(const LinkFile&) = delete;
  LinkFile& operator=(const LinkFile&) = delete;

  /// Removes the link, unless another process has replaced it.
  ~LinkFile() {
    std::error_code error;
    if (fs::read_symlink(path_, error) == target_ && !error) fs::remove(path_, error);
  }

 private:
  std::string path_;
  std::string target_;
};

}  // namespace wheelwire::sim
