// Saved data, in files that outlast the program.
#pragma once

#include <string>

#include "board.hpp"
#include "storage.hpp"

namespace wheelwire::sim {

class File final : public Storage {
 public:
  explicit File(std::string path) : path_(std::move(path)) {}
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  ~File() override;

  Bytes read() override;
  bool write(size_t offset, const uint8_t* data, size_t size) override;
  bool replace(const Bytes& bytes) override;

 private:
  std::string path_;
  int descriptor_ = -1;  ///< For what is written in place.
};

/// Stores the parameters in this file. The board, its peripherals, a latched e-stop and the
/// recorder's data go to files next to it.
void use_files(SimulatedBoard& board, const std::string& path);

}  // namespace wheelwire::sim
