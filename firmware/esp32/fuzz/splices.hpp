// Random damage to a row of frames. Each kind replaces some bytes by others, of any two lengths.
#pragma once

#include "frames.hpp"

namespace wheelwire::fuzz {

enum class Damage { kBurst, kLoss, kRepeat, kInsertion, kOverwrite };

/// By Damage.
constexpr const char* kDamageNames[] = {"bursts", "losses", "repeats", "insertions", "overwrites"};

constexpr size_t kLongestBurst = 32;
constexpr size_t kLongestSplice = 160;  // about four frames

/// The bytes [begin, end) of a row replaced by `bytes`.
struct Splice {
  size_t begin;
  size_t end;
  Bytes bytes;

  /// Bytes were changed or removed within the frame, or put between two of its bytes.
  bool touches(const Placed& frame) const { return frame.begin < end && begin < frame.end; }
};

class Splicer {
 public:
  Splicer(const Bytes& row, sim::Random& random) : row_(row), random_(random) {}

  Splice make(Damage damage) {
    const size_t longest = damage == Damage::kBurst ? kLongestBurst : kLongestSplice;
    const size_t begin = below(row_.size() + 1);
    const size_t size = 1 + below(longest);
    const size_t end = std::min(begin + size, row_.size());
    switch (damage) {
      case Damage::kBurst:
        return {begin, end, noisy(begin, end)};
      case Damage::kLoss:
        return {begin, end, {}};
      case Damage::kRepeat:
        return {begin, begin, copy(begin - std::min(size, begin), begin)};
      case Damage::kInsertion:
        return {begin, begin, noise(size)};
      case Damage::kOverwrite:
        return {begin, end, other(end - begin)};
    }
    return {};
  }

 private:
  size_t below(size_t limit) { return random_.next() % limit; }

  Bytes copy(size_t begin, size_t end) const {
    return {row_.begin() + static_cast<ptrdiff_t>(begin),
            row_.begin() + static_cast<ptrdiff_t>(end)};
  }

  /// What a disturbed line makes of the bytes: some bits inverted.
  Bytes noisy(size_t begin, size_t end) {
    Bytes bytes = copy(begin, end);
    for (uint8_t& byte : bytes) byte ^= static_cast<uint8_t>(random_.next() & random_.next());
    return bytes;
  }

  /// Delimiters and the small numbers of COBS's codes are frequent in half of it.
  Bytes noise(size_t size) {
    const uint64_t range = random_.next() % 2 == 0 ? 256 : 8;
    Bytes bytes(size);
    for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(random_.next() % range);
    return bytes;
  }

  /// Noise, or what stands elsewhere in the row, as when a driver mixes up its buffers.
  Bytes other(size_t size) {
    if (random_.next() % 2 == 0) return noise(size);
    const size_t from = below(row_.size() - size + 1);
    return copy(from, from + size);
  }

  const Bytes& row_;
  sim::Random& random_;
};

/// Feeds the damaged row and compares what is delivered with what was sent.
inline void judge(const Row& row, const Splice& splice, Findings& findings) {
  FrameDecoder decoder(body_size);
  Frame frame;
  auto next = row.frames.begin();  // the first that may still be delivered in order
  const auto skip_touched = [&] {
    while (next != row.frames.end() && splice.touches(*next)) ++next;
  };
  const auto take = [&](uint8_t byte) {
    if (!decoder.feed(byte, frame)) return;
    skip_touched();
    if (next != row.frames.end() && next->says(frame)) {
      ++next;
    } else if (std::ranges::none_of(row.frames, [&](const Placed& f) { return f.says(frame); })) {
      ++findings.wrong;
    }
  };
  for (size_t i = 0; i < splice.begin; ++i) take(row.bytes[i]);
  for (const uint8_t byte : splice.bytes) take(byte);
  for (size_t i = splice.end; i < row.bytes.size(); ++i) take(row.bytes[i]);
  skip_touched();
  for (; next != row.frames.end(); ++next) findings.lost += !splice.touches(*next);
  ++findings.injected;
  findings.count_chunks(decoder.counters());
}

}  // namespace wheelwire::fuzz
