/* The firmware's core as a library, for any language: one robot behind a line of bytes.
 *
 * Nothing here blocks, prints or reads a clock. A core is used by one thread at a time; two of them
 * share nothing. All times are microseconds on one monotonic clock, the device's.
 */
#ifndef WHEELWIRE_CORE_H
#define WHEELWIRE_CORE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define WHEELWIRE_EXPORT __attribute__((visibility("default")))

/* Grows with every change of what is declared here. */
#define WHEELWIRE_ABI 1

WHEELWIRE_EXPORT uint32_t wheelwire_abi(void);
/* Of the messages; as in DeviceHello. */
WHEELWIRE_EXPORT uint32_t wheelwire_schema_hash(void);

typedef struct wheelwire_core wheelwire_core;

/* What DeviceHello tells; the codes are those of protocol/MESSAGES.md. */
typedef struct wheelwire_identity {
  uint64_t board_id;
  uint32_t boot_id; /* Random. */
  uint32_t capabilities;
  uint8_t board; /* Also chooses the defaults of the parameters. */
  uint8_t reset_reason;
} wheelwire_identity;

/* Keeps a block of bytes, the saved parameters; of size 0: forgets it. Returns 1, or 0 when it
 * could not; the former block is then still there. */
typedef int (*wheelwire_save)(void* context, const uint8_t* block, size_t size);

typedef struct wheelwire_inputs {
  uint64_t now_us;
  int32_t left_ticks;   /* Cumulative, forward positive, modulo 2^32. */
  int32_t right_ticks;  /* Of the same instant. */
  uint16_t battery_mv;  /* 0: not measured. */
  uint8_t contact_open; /* The e-stop contact, normally closed. */
} wheelwire_inputs;

/* The pins of one half of an L298N. Whoever applies them sets EN low, then the inputs, then EN
 * where an input changes: it must not switch under current. */
typedef struct wheelwire_bridge {
  uint16_t enable_q15; /* Duty of the PWM on EN, 0 to 32767; 0 is low. */
  uint8_t in1;
  uint8_t in2;
} wheelwire_bridge;

typedef struct wheelwire_outputs {
  uint64_t deadline_us; /* When the setpoint obeyed expires. */
  uint32_t period_us;   /* From this step to the next. */
  uint32_t faults;
  wheelwire_bridge left;
  wheelwire_bridge right;
  uint8_t state; /* The supervisor's. */
} wheelwire_outputs;

/* A robot in BOOT. `block`: what was saved last, copied; NULL with size 0 for nothing. NULL when
 * out of memory. */
WHEELWIRE_EXPORT wheelwire_core* wheelwire_core_create(const wheelwire_identity* identity,
                                                       const uint8_t* block, size_t size,
                                                       wheelwire_save save, void* context);
WHEELWIRE_EXPORT void wheelwire_core_destroy(wheelwire_core* core);

/* Makes another default of a parameter, before the start. Returns a RefusalCode. */
WHEELWIRE_EXPORT uint8_t wheelwire_core_preset(wheelwire_core* core, uint8_t parameter,
                                               float value);

/* Once, when the pins are ready; then a step each period. Before the start nothing below acts. */
WHEELWIRE_EXPORT void wheelwire_core_start(wheelwire_core* core, const wheelwire_inputs* inputs,
                                           wheelwire_outputs* outputs);
WHEELWIRE_EXPORT void wheelwire_core_step(wheelwire_core* core, const wheelwire_inputs* inputs,
                                          wheelwire_outputs* outputs);
/* Between two steps, when bytes have come: reads and answers them. A stop acts at once. */
WHEELWIRE_EXPORT void wheelwire_core_service(wheelwire_core* core, uint64_t now_us,
                                             wheelwire_outputs* outputs);
/* A pin failed: DRIVER_FAILED from the next step on, until the process starts anew. */
WHEELWIRE_EXPORT void wheelwire_core_fail(wheelwire_core* core);

/* Bytes from the host; returns how many there was room for. A step or service reads 600. */
WHEELWIRE_EXPORT size_t wheelwire_core_feed(wheelwire_core* core, const uint8_t* data, size_t size);
/* Bytes for the host; returns how many were written to `out`. What is not taken in time is dropped
 * frame by frame, and counted in LinkCounters. */
WHEELWIRE_EXPORT size_t wheelwire_core_take(wheelwire_core* core, uint8_t* out, size_t capacity);

#ifdef __cplusplus
}
#endif

#endif
