// Repeats the calls on a simulator that a page recorded (web/src/recorder.ts), and writes the log
// that they make here: a line of JSON for each, with the answers of this simulator.
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <string>
#include <string_view>
#include <vector>

#include "libfwsim.h"

namespace {

[[noreturn]] void fail(std::string_view why, const std::string& line) {
  std::fprintf(stderr, "replay: %.*s: %s\n", static_cast<int>(why.size()), why.data(),
               line.c_str());
  std::exit(1);
}

/// What follows `"key":`, in a line without spaces, as JSON.stringify writes it.
std::string value_of(const std::string& line, const std::string& key) {
  const std::string name = "\"" + key + "\":";
  const size_t at = line.find(name);
  if (at == std::string::npos) fail("no " + key, line);
  size_t begin = at + name.size();
  const bool is_text = line[begin] == '"';
  if (is_text) ++begin;
  return line.substr(begin, line.find_first_of(is_text ? "\"" : ",}", begin) - begin);
}

std::vector<uint8_t> bytes_of(const std::string& hex) {
  std::vector<uint8_t> bytes;
  for (size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(static_cast<uint8_t>(std::stoul(hex.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

void require(int status, const std::string& line) {
  if (status != FWSIM_OK) fail("refused", line);
}

double get(const fwsim* sim, const char* name) {
  double value = 0.0;
  require(fwsim_get(sim, name, &value), name);
  return value;
}

void print_read(fwsim* sim, const std::string& t) {
  std::printf("{\"t\":%s,\"call\":\"read\",\"bytes\":\"", t.c_str());
  uint8_t buffer[4096];
  size_t size = sizeof buffer;
  while (size == sizeof buffer) {
    require(fwsim_read(sim, buffer, sizeof buffer, &size), "read");
    for (size_t i = 0; i < size; ++i) std::printf("%02x", buffer[i]);
  }
  std::printf("\",\"state\":%.0f,\"ticks\":[%.0f,%.0f]}\n", get(sim, "state"),
              get(sim, "true.left_ticks"), get(sim, "true.right_ticks"));
}

}  // namespace

int main() {
  fwsim* sim = nullptr;
  for (std::string line; std::getline(std::cin, line);) {
    const std::string call = value_of(line, "call");
    if (call == "seed") {
      fwsim_destroy(sim);
      sim = fwsim_create(std::strtoull(value_of(line, "seed").c_str(), nullptr, 10));
    } else if (sim == nullptr) {
      fail("no seed before", line);
    } else if (call == "advance") {
      require(fwsim_advance_us(sim, std::strtoll(value_of(line, "us").c_str(), nullptr, 10)), line);
    } else if (call == "write") {
      const std::vector<uint8_t> bytes = bytes_of(value_of(line, "bytes"));
      require(fwsim_write(sim, bytes.data(), bytes.size()), line);
    } else if (call == "set") {
      const double value = std::strtod(value_of(line, "value").c_str(), nullptr);
      require(fwsim_set(sim, value_of(line, "name").c_str(), value), line);
    } else if (call == "read") {
      print_read(sim, value_of(line, "t"));
      continue;
    } else {
      fail("not a call", line);
    }
    std::puts(line.c_str());
  }
  fwsim_destroy(sim);
}
