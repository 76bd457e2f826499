// Every flip of one, two and three bits of a frame on the wire.
#pragma once

#include "frames.hpp"

namespace wheelwire::fuzz {

/// Damages the second of three frames, bit by bit, and feeds it and the third to a decoder that has
/// just taken the first.
class FlippedFrame {
 public:
  FlippedFrame(uint8_t id, const Bytes& ids, sim::Random& random) : after_first_(body_size) {
    row_.append(ids[random.next() % ids.size()], 0, random);
    row_.append(id, 1, random);
    row_.append(ids[random.next() % ids.size()], 2, random);
    Frame frame;
    for (size_t i = 0; i < damaged().begin; ++i) after_first_.feed(row_.bytes[i], frame);
  }

  /// All flips of one to `most` bits from this one on, delimiters included.
  void inject(int most, Findings& findings, size_t first = 0) {
    const size_t bits = (damaged().end - damaged().begin) * 8;
    for (size_t bit = first; bit < bits; ++bit) {
      flip(bit);
      judge(findings);
      if (most > 1) inject(most - 1, findings, bit + 1);
      flip(bit);
    }
  }

 private:
  const Placed& damaged() const { return row_.frames[1]; }

  void flip(size_t bit) {
    row_.bytes[damaged().begin + bit / 8] ^= static_cast<uint8_t>(1u << (bit % 8));
  }

  void judge(Findings& findings) {
    FrameDecoder decoder = after_first_;
    Frame frame;
    bool third = false;
    for (size_t i = damaged().begin; i < row_.bytes.size(); ++i) {
      if (!decoder.feed(row_.bytes[i], frame)) continue;
      if (row_.frames[2].says(frame)) {
        third = true;
      } else if (!damaged().says(frame)) {
        ++findings.wrong;
      }
    }
    ++findings.injected;
    findings.lost += !third;
    findings.count_chunks(decoder.counters());
  }

  Row row_;
  FrameDecoder after_first_;
};

}  // namespace wheelwire::fuzz
