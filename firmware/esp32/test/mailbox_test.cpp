#include "mailbox.hpp"

#include <thread>

#include "check.hpp"

using namespace wheelwire;

TEST(a_mailbox_gives_the_newest_value_once) {
  Mailbox<int> mailbox;
  int value = 0;
  CHECK(!mailbox.take(value));
  mailbox.post(1);
  mailbox.post(2);
  CHECK(mailbox.take(value) && value == 2);
  CHECK(!mailbox.take(value));
  for (int i = 3; i < 20; ++i) {
    mailbox.post(i);
    CHECK(mailbox.take(value) && value == i);
  }
}

TEST(no_value_is_torn_or_older_than_the_one_before_it) {
  struct Value {
    uint32_t words[16];
  };
  constexpr uint32_t kValues = 200'000;
  Mailbox<Value> mailbox;
  std::thread writer{[&mailbox] {
    for (uint32_t i = 1; i <= kValues; ++i) {
      Value value;
      for (uint32_t& word : value.words) word = i;
      mailbox.post(value);
    }
  }};
  uint32_t newest = 0;
  bool is_torn = false;
  bool is_older = false;
  while (newest < kValues) {
    Value value;
    if (!mailbox.take(value)) continue;
    for (const uint32_t word : value.words) is_torn |= word != value.words[0];
    is_older |= value.words[0] <= newest;
    newest = value.words[0];
  }
  writer.join();
  CHECK(!is_torn);
  CHECK(!is_older);
}
