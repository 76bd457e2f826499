// One line of JSON: a flat object, built field by field.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

namespace wheelwire::sim {

class JsonLine {
 public:
  explicit JsonLine(std::string_view event) { add("event", event); }

  JsonLine& add(std::string_view key, std::string_view value) {
    begin(key);
    quote(value);
    return *this;
  }
  JsonLine& add(std::string_view key, const char* value) {
    return add(key, std::string_view(value));
  }
  JsonLine& add(std::string_view key, bool value) {
    begin(key);
    text_ += value ? "true" : "false";
    return *this;
  }
  JsonLine& add(std::string_view key, uint64_t value) {
    begin(key);
    text_ += std::to_string(value);
    return *this;
  }
  /// 15 significant digits keep whole numbers whole.
  JsonLine& add(std::string_view key, double value) {
    char digits[32];
    std::snprintf(digits, sizeof digits, "%.15g", value);
    begin(key);
    text_ += digits;
    return *this;
  }

  std::string str() const { return "{" + text_ + "}\n"; }

 private:
  void begin(std::string_view key) {
    if (!text_.empty()) text_ += ", ";
    quote(key);
    text_ += ": ";
  }

  void quote(std::string_view value) {
    text_ += '"';
    for (const char c : value) {
      const auto code = static_cast<unsigned char>(c);
      if (c == '"' || c == '\\') {
        text_ += '\\';
        text_ += c;
      } else if (code < 0x20 || code >= 0x7f) {
        char escape[8];
        std::snprintf(escape, sizeof escape, "\\u%04x", code);
        text_ += escape;
      } else {
        text_ += c;
      }
    }
    text_ += '"';
  }

  std::string text_;
};

}  // namespace wheelwire::sim
