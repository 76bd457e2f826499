// Damages frames on the wire, and counts what gets through and what is lost with them.
//
//   wheelwire-corruption [--random N] [--bits 1..3] [--seed N]
//
// First every flip of one, two and three bits of one frame of every message, between two good
// frames. Then N random injections into rows of six frames: bursts, losses, repeats, insertions and
// overwrites in turn.
//
// A frame is touched when any of its bytes, delimiters included, was changed or removed, or when
// bytes were put between two of its bytes. Bytes put between two frames touch neither. Touched
// frames may be lost; every other frame has to be delivered, in order.
// A delivered message is wrong when no frame of the row has its id and body. One that equals an
// original is not wrong: damage can repeat a whole frame, and the layers above handle repeats.
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "flips.hpp"
#include "splices.hpp"

namespace {

using namespace wheelwire;
using namespace wheelwire::fuzz;

constexpr size_t kRowFrames = 6;
constexpr uint64_t kInjectionsPerRow = 32;

struct Options {
  uint64_t random = 50'000'000;
  int bits = 3;
  uint64_t seed = 1;
};

bool parse(int argc, char** argv, Options& options) {
  for (int i = 1; i + 1 < argc; i += 2) {
    const uint64_t value = std::strtoull(argv[i + 1], nullptr, 10);
    if (std::strcmp(argv[i], "--random") == 0) {
      options.random = value;
    } else if (std::strcmp(argv[i], "--bits") == 0 && value >= 1 && value <= 3) {
      options.bits = static_cast<int>(value);
    } else if (std::strcmp(argv[i], "--seed") == 0) {
      options.seed = value;
    } else {
      return false;
    }
  }
  return argc % 2 == 1;
}

bool report(const char* name, const Findings& found) {
  std::printf("%-12s %12" PRIu64 " injected %12" PRIu64 " refused by CRC %3" PRIu64
              " by id or length %3" PRIu64 " wrong %3" PRIu64 " lost\n",
              name, found.injected, found.reached_crc, found.passed_crc, found.wrong, found.lost);
  std::fflush(stdout);
  return found.aims_met();
}

bool flip_bits(const Options& options, const Bytes& ids) {
  sim::Random random(options.seed);
  Findings found;
  for (const uint8_t id : ids) FlippedFrame(id, ids, random).inject(options.bits, found);
  return report("bit flips", found);
}

bool splice_rows(const Options& options, const Bytes& ids, size_t damage) {
  sim::Random random(options.seed * std::size(kDamageNames) + damage);
  Findings found;
  const uint64_t wanted = options.random / std::size(kDamageNames);
  while (found.injected < wanted) {
    Row row;
    for (uint16_t seq = 0; seq < kRowFrames; ++seq)
      row.append(ids[random.next() % ids.size()], seq, random);
    Splicer splicer(row.bytes, random);
    for (uint64_t i = 0; i < kInjectionsPerRow; ++i)
      judge(row, splicer.make(Damage(damage)), found);
  }
  return report(kDamageNames[damage], found);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  if (!parse(argc, argv, options)) {
    std::fprintf(stderr, "usage: wheelwire-corruption [--random N] [--bits 1..3] [--seed N]\n");
    return 2;
  }
  const Bytes ids = all_ids();
  bool aims_met = flip_bits(options, ids);
  for (size_t damage = 0; damage < std::size(kDamageNames); ++damage)
    aims_met &= splice_rows(options, ids, damage);
  return aims_met ? 0 : 1;
}
