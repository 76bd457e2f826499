// A minimal test framework: TEST registers a function, CHECK reports and continues.
#pragma once

#include <cstdio>
#include <functional>
#include <string>
#include <vector>

namespace wheelwire::test {

struct Case {
  std::string name;
  std::function<void()> run;
};

inline std::vector<Case>& cases() {
  static std::vector<Case> all;
  return all;
}

inline int failures = 0;

inline bool add(const char* name, std::function<void()> run) {
  cases().push_back({name, std::move(run)});
  return true;
}

inline void report(const char* file, int line, const char* expression) {
  ++failures;
  std::printf("%s:%d: CHECK(%s) failed\n", file, line, expression);
}

/// How many samples to draw. All in the plain build: code takes ten times as long under the
/// sanitizers, and a fifth shows them each access to memory, too.
template <typename Number>
constexpr Number draws(Number all) {
#ifdef WHEELWIRE_SANITIZED
  return all / 5;
#else
  return all;
#endif
}

}  // namespace wheelwire::test

#define TEST(name)                                                                     \
  static void name();                                                                  \
  [[maybe_unused]] static const bool name##_added = wheelwire::test::add(#name, name); \
  static void name()

#define CHECK(...) \
  ((__VA_ARGS__) ? void() : wheelwire::test::report(__FILE__, __LINE__, #__VA_ARGS__))
