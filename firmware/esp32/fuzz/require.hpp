// Asserts in a fuzz target, by a crash that libFuzzer and a plain replay notice in every build.
#pragma once

#include <cstdio>
#include <cstdlib>

#define REQUIRE(...)                                                                 \
  do {                                                                               \
    if (!(__VA_ARGS__)) {                                                            \
      std::fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #__VA_ARGS__); \
      std::abort();                                                                  \
    }                                                                                \
  } while (false)
