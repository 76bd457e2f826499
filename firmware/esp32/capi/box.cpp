// The C interface of black boxes: reading one, and running it again.
#include <stdlib.h>
#include <string.h>

#include <new>
#include <optional>

#include "box_image.hpp"
#include "core_hash.hpp"
#include "rerun.hpp"
#include "wheelwire_core.h"

using namespace wheelwire;

struct wheelwire_box {
  explicit wheelwire_box(const uint8_t* image) {
    memcpy(words, image, sizeof words);
    reader.emplace(memory());
  }

  const uint32_t* memory() const { return words + BoxHead::kWords; }

  uint32_t words[kBoxImageWords];  // Aligned, as the caller's bytes may not be.
  std::optional<BoxReader> reader;
};

uint32_t wheelwire_core_hash(void) { return kCoreHash; }

int wheelwire_box_open(const uint8_t* image, size_t size, wheelwire_box** box,
                       wheelwire_box_head* head) {
  *box = nullptr;
  if (size != kBoxImageSize) return WHEELWIRE_BOX_NONE;
  void* const allocated = malloc(sizeof(wheelwire_box));
  if (allocated == nullptr) return WHEELWIRE_BOX_NO_MEMORY;
  auto* const opened = new (allocated) wheelwire_box(image);
  BoxHead found;
  const bool has_head = BoxHead::decode(opened->words, found);
  if (!has_head || box_check(opened->memory()) != found.check) {
    free(allocated);
    return has_head ? WHEELWIRE_BOX_DAMAGED : WHEELWIRE_BOX_NONE;
  }
  *head = {.stored_us = found.stored_us,
           .number = found.number,
           .boot_id = found.origin.boot_id,
           .core = found.origin.core,
           .release = found.origin.release,
           .git_hash = found.origin.git_hash,
           .board = found.board,
           .faults = found.faults,
           .cause = static_cast<uint8_t>(found.cause),
           .reset_reason = static_cast<uint8_t>(found.reset_reason),
           .missing = static_cast<uint8_t>(opened->reader->missing())};
  *box = opened;
  return WHEELWIRE_BOX_OPENED;
}

void wheelwire_box_close(wheelwire_box* box) { free(box); }

int wheelwire_box_next(wheelwire_box* box, wheelwire_box_entry* out) {
  BoxEntry entry;
  if (!box->reader->next(entry)) return 0;
  *out = {};
  out->t_us = entry.t_us;
  out->kind = static_cast<uint8_t>(entry.kind);
  out->left_counter = entry.step.left_counter;
  out->right_counter = entry.step.right_counter;
  out->battery_mv = entry.step.battery_mv;
  out->left_duty_q15 = entry.step.left_duty_q15;
  out->right_duty_q15 = entry.step.right_duty_q15;
  const uint32_t argument = entry.argument;
  switch (entry.kind) {
    case box::Kind::kMessage:
      out->message_id = entry.message_id;
      out->body_size =
          entry.body_size <= sizeof out->body ? entry.body_size : uint8_t{sizeof out->body};
      memcpy(out->body, entry.body, out->body_size);
      break;
    case box::Kind::kTransition:
      out->event = static_cast<uint8_t>(argument & 15);
      out->before = static_cast<uint8_t>(argument >> 4 & 15);
      out->after = static_cast<uint8_t>(argument >> 8 & 15);
      out->faults = entry.payload[0];
      break;
    case box::Kind::kRefusal:
      out->message_id = static_cast<uint8_t>(entry.payload[0]);
      out->code = static_cast<uint8_t>(entry.payload[0] >> 8);
      break;
    case box::Kind::kContact:
    case box::Kind::kStore:
      out->flag = argument & 1;
      break;
    case box::Kind::kFailure:
      out->faults = entry.payload[0];
      break;
    default:
      break;
  }
  return 1;
}

int wheelwire_box_rerun(const wheelwire_box* box, int any_core, wheelwire_rerun* out) {
  void* const allocated = malloc(sizeof(Rerun));
  if (allocated == nullptr) return WHEELWIRE_RERUN_NO_MEMORY;
  auto* const rerun = new (allocated)
      Rerun(box->memory(), any_core != 0 ? Rerun::Accept::kAnyCore : Rerun::Accept::kThisCore);
  const Rerun::Outcome outcome = rerun->run();
  const BoxDifference& difference = rerun->difference();
  *out = {};
  out->first_us = rerun->first_us();
  out->last_us = rerun->last_us();
  out->steps = rerun->steps();
  out->step = difference.step;
  out->t_us = difference.t_us;
  out->recorded = difference.recorded;
  out->computed = difference.computed;
  static_assert(sizeof out->field == sizeof difference.field);
  memcpy(out->field, difference.field, sizeof out->field);
  free(allocated);
  return static_cast<int>(outcome);
}
