// One line of JSON: a flat object, built field by field.
#pragma once

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>

namespace wheelwire::sim {

class JsonLine {
 public:
  explicit JsonLine(std::string_view event) { add("event", event); }

  /// 15 significant digits keep whole numbers whole.
  template <typename Value>
  JsonLine& add(std::string_view key, const Value& value) {
    if (!text_.empty()) text_ += ", ";
    quote(key);
    text_ += ": ";
    if constexpr (std::is_same_v<Value, bool>) {
      text_ += value ? "true" : "false";
    } else if constexpr (std::is_integral_v<Value>) {
      text_ += std::to_string(value);
    } else if constexpr (std::is_same_v<Value, double>) {
      char digits[32];
      std::snprintf(digits, sizeof digits, "%.15g", value);
      text_ += digits;
    } else {
      quote(value);
    }
    return *this;
  }

  std::string str() const { return "{" + text_ + "}\n"; }

 private:
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
