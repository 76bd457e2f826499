/* The library as any language sees it: a host says hello to a core, and decodes the answer. In C,
 * so that the header stays valid C; on a foreign processor it is run with a wheel's library. */
#include <stdio.h>
#include <string.h>

#include "wheelwire_core.h"

static int failures = 0;

static void check(int condition, const char* what) {
  if (condition) return;
  printf("failed: %s\n", what);
  ++failures;
}

static int save(void* context, const uint8_t* block, size_t size) {
  (void)context;
  (void)block;
  (void)size;
  return 1;
}

/* How much of the recorder was written. */
static int write_part(void* context, uint32_t offset, const uint8_t* data, size_t size) {
  (void)data;
  *(size_t*)context += size;
  return offset + size <= WHEELWIRE_RECORDER_SIZE;
}

/* protocol/vectors: an e-stop. */
static const uint8_t kEstop[] = {0x00, 0x02, 0x03, 0x01, 0x06, 0x4d, 0x3c, 0x2b,
                                 0x1a, 0x01, 0x05, 0x86, 0x5b, 0x0a, 0x77, 0x00};

int main(void) {
  check(wheelwire_abi() == WHEELWIRE_ABI, "the header is the library's");

  const wheelwire_identity identity = {.board_id = 7, .boot_id = 1, .board = 4};
  wheelwire_core* core = wheelwire_core_create(&identity, NULL, 0, save, NULL);
  check(core != NULL, "a core");
  check(wheelwire_core_preset(core, 1, 0.05f) == 0, "a preset within its bounds");
  check(wheelwire_core_preset(core, 1, 50.0f) != 0, "a preset beyond its bounds");

  size_t written = 0;
  check(wheelwire_core_recorder(core, NULL, write_part, &written) == 1, "a recorder");

  wheelwire_inputs inputs = {.now_us = 1000};
  wheelwire_outputs outputs;
  wheelwire_core_start(core, &inputs, &outputs);
  check(outputs.period_us == 10000, "the defaults of a computer");
  check(outputs.left.enable_q15 == 0 && outputs.right.enable_q15 == 0, "EN low at the start");
  const uint8_t idle = outputs.state;

  check(wheelwire_core_feed(core, kEstop, sizeof kEstop) == sizeof kEstop, "room for a frame");
  wheelwire_core_service(core, 2000, &outputs);
  check(outputs.state != idle, "an e-stop between two steps");
  inputs.now_us = 11000;
  wheelwire_core_step(core, &inputs, &outputs);
  check(outputs.left.enable_q15 == 32767 && outputs.right.enable_q15 == 32767, "a brake at once");
  check(outputs.left.in1_q15 == outputs.left.in2_q15, "by both inputs alike");
  check(written == 0, "nothing is written soon after a start");
  for (; inputs.now_us < 15000000; inputs.now_us += 10000) {
    wheelwire_core_step(core, &inputs, &outputs);
  }
  check(outputs.left.enable_q15 == 0 && outputs.right.enable_q15 == 0, "EN low at rest");
  check(written >= WHEELWIRE_BOX_SIZE, "the e-stop's black box at rest");
  wheelwire_core_destroy(core);

  uint8_t bodies[256];
  wheelwire_run runs[32];
  wheelwire_decoder* decoder = wheelwire_decoder_create(bodies, runs);
  check(decoder != NULL, "a decoder");
  check(wheelwire_decoder_feed(decoder, kEstop, 9) == 0, "no frame of a half");
  check(wheelwire_decoder_feed(decoder, kEstop + 9, sizeof kEstop - 9) == 1, "one run of frames");
  check(runs[0].id == 3 && runs[0].frames == 1, "one e-stop");
  check(memcmp(bodies, "\x4d\x3c\x2b\x1a\x01\x00", 6) == 0, "its body");
  wheelwire_counters counters;
  wheelwire_decoder_counters(decoder, &counters);
  check(counters.frames == 1 && counters.bad_crc == 0, "its count");
  wheelwire_decoder_destroy(decoder);

  check(wheelwire_decode_capture(kEstop, sizeof kEstop, 3, bodies) == 1, "a capture");
  printf("%d failed checks\n", failures);
  return failures != 0;
}
