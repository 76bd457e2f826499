#include "session.hpp"

#include "check.hpp"

using namespace wheelwire;

namespace {

Session::Request classify(const Session& session, uint16_t request_id) {
  const Answer* answer = nullptr;
  return session.classify(request_id, answer);
}

Session opened() {
  Session session;
  session.open(0x1234, 0xff00);
  return session;
}

}  // namespace

TEST(a_session_is_named_by_nonce_and_boot_id) {
  Session session;
  CHECK(!session.matches(0));
  session.open(0x1234, 0xff00);
  CHECK(session.matches(0x1234 ^ 0xff00));
  CHECK(!session.matches(0x1234));
  CHECK(session.is_open_with(0x1234));
}

TEST(the_last_four_requests_are_repeats_and_older_ones_are_old) {
  Session session = opened();
  for (uint16_t id = 1; id <= 6; ++id) {
    CHECK(classify(session, id) == Session::Request::kNew);
    session.record(id);
  }
  CHECK(classify(session, 2) == Session::Request::kOld);
  for (uint16_t id = 3; id <= 6; ++id) CHECK(classify(session, id) == Session::Request::kRepeat);
  CHECK(classify(session, 7) == Session::Request::kNew);
}

TEST(request_ids_wrap) {
  Session session = opened();
  session.record(30'000);
  CHECK(classify(session, 40'000) == Session::Request::kNew);
  session.record(60'000);
  session.record(65'535);
  CHECK(classify(session, 0) == Session::Request::kNew);
  session.record(0);
  CHECK(classify(session, 65'535) == Session::Request::kRepeat);
  CHECK(classify(session, 65'000) == Session::Request::kOld);
}

TEST(only_newer_commands_are_taken_and_a_new_session_forgets_them_answers_and_the_clock) {
  Session session = opened();
  CHECK(!session.take_command(0));
  CHECK(session.take_command(1));
  CHECK(!session.take_command(1));
  CHECK(session.take_command(7));
  CHECK(!session.take_command(6));
  session.record(1);
  // An id that is old in the new session.
  session.record(40'000);
  CHECK(classify(session, 40'000) == Session::Request::kRepeat);
  session.note_ping();
  session.open(0x9999, 0xff00);
  CHECK(classify(session, 1) == Session::Request::kNew);
  CHECK(classify(session, 30'000) == Session::Request::kNew);
  CHECK(classify(session, 40'000) == Session::Request::kOld);
  CHECK(!session.clock_synchronised());
  CHECK(session.take_command(1));
}
