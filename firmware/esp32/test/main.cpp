// Runs every case, or those whose name contains the argument.
#include <cstring>

#include "check.hpp"

int main(int argc, char** argv) {
  int ran = 0;
  for (const auto& test : wheelwire::test::cases()) {
    if (argc > 1 && std::strstr(test.name.c_str(), argv[1]) == nullptr) continue;
    const int before = wheelwire::test::failures;
    test.run();
    std::printf("%s %s\n", wheelwire::test::failures == before ? "ok  " : "FAIL",
                test.name.c_str());
    ++ran;
  }
  std::printf("%d cases, %d failed checks\n", ran, wheelwire::test::failures);
  return ran == 0 || wheelwire::test::failures != 0;
}
