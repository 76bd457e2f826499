#include "twin_store.hpp"

#include <string.h>

#include "crc32.hpp"
#include "protocol.hpp"
#include "wire.hpp"

namespace wheelwire {
namespace {

// After the block: this, the records, the number, the checksum. Earlier firmware left out the first
// two.
constexpr uint16_t kSlotMagic = 0x3257;  // "W2"
constexpr int kAttempts = 2;

}  // namespace

void TwinStore::record(TwinStore& parameters, TwinStore& latches) {
  others_[0] = &parameters;
  others_[1] = &latches;
  parameters.recorder_ = latches.recorder_ = this;
  parameters.flag_ = 1;
  latches.flag_ = 2;
  parameters.waits_ = true;
}

size_t TwinStore::load(uint8_t* out, size_t capacity) {
  Copy content;
  const int copy = find(content);
  if (copy < 0) return 0;
  read(copy);
  memcpy(out, buffer_, content.size < capacity ? content.size : capacity);
  return content.size;
}

bool TwinStore::save(const uint8_t* data, size_t size) {
  if (size == 0 || size > kCapacity) return false;
  if (waits_ && !recorder_->note(0)) return false;
  Copy content;
  const int last = find(content) == 0 ? 0 : 1;
  content.size = size;
  ++content.number;
  content.records |= existing();
  is_incomplete_ = true;
  // The one that counts last: until then a cut of the power leaves it.
  if (!write(1 - last, content, data) || !write(last, content, data)) return false;
  is_incomplete_ = false;
  faults_ = 0;
  const bool is_recorded = recorder_ == nullptr || recorder_->note(flag_);
  return is_recorded || !waits_;
}

bool TwinStore::repair() {
  Copy content;
  const int copy = find(content);
  if (copy < 0 || !is_incomplete_) return true;
  read(copy);
  is_incomplete_ = !write(1 - copy, content) || (recorder_ != nullptr && !recorder_->note(flag_));
  return !is_incomplete_;
}

TwinStore::Copy TwinStore::read(int copy) {
  Copy found;
  const size_t size = copies_[copy]->load(buffer_, sizeof buffer_);
  if (size == 0) return found;
  found.state = State::kDamaged;
  if (size < kTail || size > sizeof buffer_ || crc32(buffer_, size) != kCrcResidue) return found;
  found.size = size - kTail;
  const uint8_t* at = buffer_ + found.size;
  uint16_t magic;
  wire::get(at, magic);
  wire::get(at, found.records);
  wire::get(at, found.number);
  found.state = magic == kSlotMagic ? State::kWhole : State::kOutdated;
  return found;
}

int TwinStore::find(Copy& content) {
  const Copy copies[2] = {read(0), read(1)};
  const bool whole[2] = {copies[0].state == State::kWhole, copies[1].state == State::kWhole};
  // The difference, as the numbers may wrap.
  const auto ahead = static_cast<int32_t>(copies[1].number - copies[0].number);
  is_incomplete_ = has_lost_copy_ = false;
  if (whole[0] || whole[1]) {
    const int newest = whole[1] && (!whole[0] || ahead > 0) ? 1 : 0;
    content = copies[newest];
    faults_ = 0;
    has_lost_copy_ = !(whole[0] && whole[1]);
    is_incomplete_ =
        has_lost_copy_ || ahead != 0 || (recorder_ != nullptr && !recorder_->records(flag_));
    return newest;
  }
  faults_ = copies_[0]->faults() | copies_[1]->faults();
  const auto either = [&copies](State state) {
    return copies[0].state == state || copies[1].state == state;
  };
  if (either(State::kOutdated)) {
    faults_ |= fault::kStoreOutdated;
  } else if (either(State::kDamaged) || is_gone()) {
    faults_ |= fault::kStoreUnreadable;
  }
  return -1;
}

bool TwinStore::write(int copy, const Copy& content, const uint8_t* data) {
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    memcpy(buffer_, data, content.size);
    if (write(copy, content)) return true;
  }
  return false;
}

bool TwinStore::write(int copy, const Copy& content) {
  uint8_t* at = buffer_ + content.size;
  wire::put(at, kSlotMagic);
  wire::put(at, content.records);
  wire::put(at, content.number);
  const uint32_t crc = crc32(buffer_, static_cast<size_t>(at - buffer_));
  wire::put(at, crc);
  if (!copies_[copy]->save(buffer_, content.size + kTail)) return false;
  // Flash that was written while the power failed may take a later write badly, and NVS may lose an
  // entry that it has just taken.
  const Copy written = read(copy);
  if (written.state != State::kWhole || written.size != content.size) return false;
  const uint8_t* end = buffer_ + content.size + kTail - sizeof crc;
  uint32_t read_back;
  wire::get(end, read_back);
  return read_back == crc;
}

/// Records that another block exists; 0: only makes sure that there is a record at all.
bool TwinStore::note(uint8_t flag) {
  Copy content;
  const int found = find(content);
  // A configuration that is damaged stays so until another one is written.
  if (found < 0 && faults_ != 0) return true;
  if (found >= 0 && (content.records | flag) == content.records) return true;
  const int last = found == 0 ? 0 : 1;
  content.records |= static_cast<uint8_t>(flag | existing());
  ++content.number;
  if (found >= 0) read(found);
  // What the first one holds afterwards is the block for the second one.
  is_incomplete_ = !write(1 - last, content) || !write(last, content);
  return !is_incomplete_;
}

/// Flags of the other blocks that exist.
uint8_t TwinStore::existing() {
  uint8_t flags = 0;
  for (TwinStore* const other : others_)
    if (other != nullptr && other->exists()) flags |= other->flag_;
  return flags;
}

/// Both copies are empty. Whether there was a block.
bool TwinStore::is_gone() {
  if (recorder_ != nullptr) return recorder_->records(flag_);
  return others_[0] != nullptr && others_[0]->exists();
}

}  // namespace wheelwire
