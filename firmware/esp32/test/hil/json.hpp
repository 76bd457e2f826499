// A JSON object, written key by key.
#pragma once

#include <string>
#include <type_traits>
#include <vector>

namespace wheelwire::hil {

class Json {
 public:
  template <typename Value>
  Json& put(const char* key, const Value& value) {
    if (!text_.empty()) text_ += ", ";
    text_ += std::string{"\""} + key + "\": " + text_of(value);
    return *this;
  }
  std::string text() const { return "{" + text_ + "}"; }

 private:
  template <typename Value>
  static std::string text_of(const Value& value) {
    if constexpr (std::is_same_v<Value, bool>) {
      return value ? "true" : "false";
    } else if constexpr (std::is_arithmetic_v<Value>) {
      return std::to_string(value);
    } else {
      return value;
    }
  }
  static std::string text_of(const Json& value) { return value.text(); }
  static std::string text_of(const std::vector<Json>& values) {
    std::string all;
    for (const Json& value : values) all += (all.empty() ? "" : ", ") + value.text();
    return "[" + all + "]";
  }

  std::string text_;
};

inline std::string quoted(const std::string& text) { return "\"" + text + "\""; }

}  // namespace wheelwire::hil
