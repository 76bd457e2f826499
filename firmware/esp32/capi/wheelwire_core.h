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

/* Incremented with every change of the declarations here. */
#define WHEELWIRE_ABI 12

WHEELWIRE_EXPORT uint32_t wheelwire_abi(void);
/* Hash of the message definitions, as in DeviceHello. */
WHEELWIRE_EXPORT uint32_t wheelwire_schema_hash(void);

typedef struct wheelwire_core wheelwire_core;

/* What DeviceHello reports; protocol/MESSAGES.md has the codes. */
typedef struct wheelwire_identity {
  uint64_t board_id;
  uint32_t boot_id; /* Random. */
  uint32_t capabilities;
  uint8_t board; /* Also selects the defaults of the parameters. */
  uint8_t reset_reason;
} wheelwire_identity;

/* Stores a block of bytes, the saved parameters. Returns 1, or 0 on failure;
 * the previous block must then still be there. */
typedef int (*wheelwire_save)(void* context, const uint8_t* block, size_t size);

typedef struct wheelwire_inputs {
  uint64_t now_us;
  int32_t left_ticks;    /* Cumulative, forward positive, modulo 2^32. */
  int32_t right_ticks;   /* At the same instant. */
  uint16_t battery_mv;   /* 0: not measured. */
  uint32_t left_illegal; /* Transitions that imply a lost edge, cumulative; 0 where not detected. */
  uint32_t right_illegal;
  uint8_t contact_open; /* The e-stop contact, normally closed. */
  uint16_t levels;      /* Of the peripherals that are digital inputs: bit n is entry n. */
} wheelwire_inputs;

/* The inputs of one wheel's power stage: the duty of the PWM on each, 0 to 32767; 0 is low, 32767
 * is high. Inputs that the stage does not have are 0. If several change, first set the falling
 * ones, then the rising ones, from the last to the first: directions before enables. */
typedef struct wheelwire_stage {
  uint16_t enable_q15;
  uint16_t in1_q15;
  uint16_t in2_q15;
  uint16_t pwm_q15;
  uint16_t dir_q15;
} wheelwire_stage;

typedef struct wheelwire_outputs {
  uint64_t deadline_us; /* When the active setpoint expires. */
  uint32_t period_us;   /* From this step to the next. */
  uint32_t faults;
  wheelwire_stage left;
  wheelwire_stage right;
  uint8_t state; /* The supervisor's. */
} wheelwire_outputs;

/* Creates a robot in BOOT. `block`: what was saved last, copied; NULL and size 0 for nothing.
 * Returns NULL when out of memory. */
WHEELWIRE_EXPORT wheelwire_core* wheelwire_core_create(const wheelwire_identity* identity,
                                                       const uint8_t* block, size_t size,
                                                       wheelwire_save save, void* context);
WHEELWIRE_EXPORT void wheelwire_core_destroy(wheelwire_core* core);

/* Sets the packed configuration whose board's power stages the outputs are for, and the defaults
 * that it gives, before the start; without it they are an L298N's. Returns a BoardFault, the first
 * one of the board. */
WHEELWIRE_EXPORT uint8_t wheelwire_core_board(wheelwire_core* core, const uint8_t* packed,
                                              size_t size);

/* Changes the default of a parameter, before the start. Returns a RefusalCode. */
WHEELWIRE_EXPORT uint8_t wheelwire_core_preset(wheelwire_core* core, uint8_t parameter,
                                               float value);

/* Lets latches survive the process. `save` is called at each change, also while driving, and must
 * not block; its result is ignored. `record`: its last argument, copied; NULL and size 0 if none is
 * known. A damaged record counts as a latched e-stop. Call this before the start; otherwise nothing
 * survives. */
WHEELWIRE_EXPORT void wheelwire_core_latches(wheelwire_core* core, const uint8_t* record,
                                             size_t size, wheelwire_save save, void* context);

/* Size of the recorder's content, in bytes. */
#define WHEELWIRE_RECORDER_SIZE 327680

/* Stores a part of the recorder's content. Returns 1, or 0 on failure. */
typedef int (*wheelwire_write)(void* context, uint32_t offset, const uint8_t* data, size_t size);

/* Adds a black box and a ledger, which hosts read by the messages of the group RECORDER. `content`:
 * the content written last, WHEELWIRE_RECORDER_SIZE bytes, copied; NULL if none was written.
 * `write` is called for each part that changes, only while the wheels stand, and at most once a
 * step. It may wait: the next step may be late. Call this before the start. Returns 1, or 0 when
 * out of memory. */
WHEELWIRE_EXPORT int wheelwire_core_recorder(wheelwire_core* core, const uint8_t* content,
                                             wheelwire_write write, void* context);

/* The peripherals of a robot on a computer's own pins. A separate process or thread reads each I2C
 * bus, so a hung bus holds up nothing else. */
typedef struct wheelwire_sensors wheelwire_sensors;

enum wheelwire_transfer_result {
  WHEELWIRE_TRANSFER_HUNG = 0, /* It did not end in time, or a line was held low. */
  WHEELWIRE_TRANSFER_DONE = 1,
  WHEELWIRE_TRANSFER_NO_ANSWER = 2
};

/* Writes `out` to the chip at an address, then, unless `in_size` is 0, reads from it after a
 * repeated start. Sets `now_us` to when it ended. Returns a wheelwire_transfer_result. */
typedef int (*wheelwire_transfer)(void* context, uint8_t address, const uint8_t* out,
                                  size_t out_size, uint8_t* in, size_t in_size, uint64_t* now_us);

/* Size of the memory that they need, in bytes. */
WHEELWIRE_EXPORT size_t wheelwire_sensors_size(void);
/* Makes the peripherals of a packed configuration in this memory, which must be large enough and
 * aligned to a page. If it is shared, a process that is forked later may poll them. NULL if the
 * list cannot be read; wheelwire_core_sense checks its rules. */
WHEELWIRE_EXPORT wheelwire_sensors* wheelwire_sensors_create(void* memory, const uint8_t* packed,
                                                             size_t size);
/* Does what is due on the bus of this number. Returns when there will be something to do. Each bus
 * has one caller, while others step the core. */
WHEELWIRE_EXPORT uint64_t wheelwire_sensors_poll(wheelwire_sensors* sensors, int bus,
                                                 uint64_t now_us, wheelwire_transfer transfer,
                                                 void* context);
/* The core's robot has these, on the board that it was given; before the start. They must outlive
 * the core. Returns a PeripheralFault, the first one of the list. */
WHEELWIRE_EXPORT uint8_t wheelwire_core_sense(wheelwire_core* core, wheelwire_sensors* sensors);

/* Call once, when the pins are ready; then a step each period. Before the start the functions below
 * do nothing. */
WHEELWIRE_EXPORT void wheelwire_core_start(wheelwire_core* core, const wheelwire_inputs* inputs,
                                           wheelwire_outputs* outputs);
WHEELWIRE_EXPORT void wheelwire_core_step(wheelwire_core* core, const wheelwire_inputs* inputs,
                                          wheelwire_outputs* outputs);
/* Call between two steps, when bytes have arrived: reads and answers them. A stop acts at once. */
WHEELWIRE_EXPORT void wheelwire_core_service(wheelwire_core* core, uint64_t now_us,
                                             wheelwire_outputs* outputs);
/* Call when the line reports that the host is gone: stops the wheels, ends the session and drops
 * all buffered bytes. The next host begins with a hello. */
WHEELWIRE_EXPORT void wheelwire_core_hang_up(wheelwire_core* core, uint64_t now_us,
                                             wheelwire_outputs* outputs);
/* The present value of a parameter; 0 before the start and for an unknown one. */
WHEELWIRE_EXPORT float wheelwire_core_value(const wheelwire_core* core, uint8_t parameter);
/* A pin failed: DRIVER_FAILED from the next step on, for the life of this core. */
WHEELWIRE_EXPORT void wheelwire_core_fail(wheelwire_core* core);

/* Bytes from the host; returns how many there was room for. A step or service reads up to 600. */
WHEELWIRE_EXPORT size_t wheelwire_core_feed(wheelwire_core* core, const uint8_t* data, size_t size);
/* Bytes for the host; returns how many were written to `out`. If they are not taken, frames are
 * dropped, and counted in LinkCounters. */
WHEELWIRE_EXPORT size_t wheelwire_core_take(wheelwire_core* core, uint8_t* out, size_t capacity);

/* What is wrong with a board; protocol/wheelwire_protocol/board.py has the codes. */
typedef struct wheelwire_board_issue {
  uint32_t value;
  uint32_t limit;
  int16_t pin;      /* GPIO; -1: no pin is concerned. */
  uint8_t fault;    /* BoardFault */
  uint8_t function; /* BoardPin: what the pin is used for. */
  uint8_t other;    /* BoardPin: its other use. */
} wheelwire_board_issue;

/* Checks the board of a packed configuration. Returns the number of issues, 0 for a usable board,
 * and writes the first `capacity` of them to `issues`. */
WHEELWIRE_EXPORT size_t wheelwire_board_check(const uint8_t* packed, size_t size,
                                              wheelwire_board_issue* issues, size_t capacity);

/* What is wrong with a list of peripherals; the codes are those of
 * protocol/wheelwire_protocol/peripherals.py. */
typedef struct wheelwire_peripheral_issue {
  uint32_t value;
  uint32_t limit;
  int16_t channel; /* Index of the entry; -1: no entry. */
  int16_t pin;     /* GPIO; -1: no pin. */
  uint8_t fault;   /* PeripheralFault */
} wheelwire_peripheral_issue;

/* Checks the peripherals of a packed configuration, as wheelwire_board_check. */
WHEELWIRE_EXPORT size_t wheelwire_peripherals_check(const uint8_t* packed, size_t size,
                                                    wheelwire_peripheral_issue* issues,
                                                    size_t capacity);

/* A black box: what a robot was given in the last second or two, and what it did. */
typedef struct wheelwire_box wheelwire_box;

/* Size of a box, in bytes. */
#define WHEELWIRE_BOX_SIZE 32768

enum wheelwire_box_status {
  WHEELWIRE_BOX_OPENED = 0,
  WHEELWIRE_BOX_NONE = 1,    /* These bytes are not a box. */
  WHEELWIRE_BOX_DAMAGED = 2, /* They were a box. */
  WHEELWIRE_BOX_NO_MEMORY = 3
};

typedef struct wheelwire_box_head {
  uint64_t stored_us; /* Device clock. */
  uint32_t number;    /* Counts up over all boxes of a device. */
  uint32_t boot_id;
  uint32_t core; /* As wheelwire_core_hash(): only the same core can re-run the box. */
  uint32_t release;
  uint32_t git_hash;
  uint32_t board; /* Fingerprint; 0: none. */
  uint32_t faults;
  uint8_t cause;
  uint8_t reset_reason;
  uint8_t missing; /* Quarters of it that cannot be read: a reset damaged them. */
} wheelwire_box_head;

/* One record. Its kind, see recorder/box_format.hpp, decides which fields are valid. */
typedef struct wheelwire_box_entry {
  uint64_t t_us;        /* Of the step or message, or of its cause. */
  int16_t left_counter; /* At the newest step: raw, before inversion and swapping. */
  int16_t right_counter;
  int16_t left_duty_q15; /* On the outputs until that step. */
  int16_t right_duty_q15;
  uint16_t battery_mv;
  uint32_t faults;
  uint8_t kind;
  uint8_t event; /* Of a transition, with the states before and after. */
  uint8_t before;
  uint8_t after;
  uint8_t message_id; /* Of a message or a refusal. */
  uint8_t code;       /* Of a refusal. */
  uint8_t flag;       /* The contact is open; a write to flash was done. */
  uint8_t body_size;
  uint8_t body[80];
} wheelwire_box_entry;

/* Result of a re-run. */
enum wheelwire_rerun_outcome {
  WHEELWIRE_RERUN_SAME = 0,
  WHEELWIRE_RERUN_DIFFERS = 1,
  WHEELWIRE_RERUN_EMPTY = 2,
  WHEELWIRE_RERUN_OTHER_CORE = 3,
  WHEELWIRE_RERUN_UNREADABLE = 4,
  WHEELWIRE_RERUN_NO_MEMORY = 5
};

typedef struct wheelwire_rerun {
  uint64_t first_us; /* Device clock of the first and last step. */
  uint64_t last_us;
  uint64_t t_us; /* Of the first difference, with the step that it is in, counted from 1. */
  double recorded;
  double computed;
  uint32_t steps;
  uint32_t step;
  char field[120]; /* "left_duty_q15", "robot.drive.left.velocity_umps"; "record": another kind. */
} wheelwire_rerun;

/* Hash of the core's sources. */
WHEELWIRE_EXPORT uint32_t wheelwire_core_hash(void);
/* Returns a wheelwire_box_status. */
WHEELWIRE_EXPORT int wheelwire_box_open(const uint8_t* image, size_t size, wheelwire_box** box,
                                        wheelwire_box_head* head);
WHEELWIRE_EXPORT void wheelwire_box_close(wheelwire_box* box);
/* The next record, oldest first; 0: no more. */
WHEELWIRE_EXPORT int wheelwire_box_next(wheelwire_box* box, wheelwire_box_entry* entry);
/* Gives the inputs to this core again, in virtual time. Returns a wheelwire_rerun_outcome. For
 * another core's box it compares what the robot did, not its duties and state; with `any_core` 0 it
 * does not run it. */
WHEELWIRE_EXPORT int wheelwire_box_rerun(const wheelwire_box* box, int any_core,
                                         wheelwire_rerun* result);

/* The core's decoder, for a host: it knows every message, also those that only devices send. */
typedef struct wheelwire_decoder wheelwire_decoder;

/* Consecutive frames of the same message. */
typedef struct wheelwire_run {
  uint32_t id;
  uint32_t frames;
} wheelwire_run;

/* As ReceiveCounters, in the same order. */
typedef struct wheelwire_counters {
  uint64_t frames;
  uint64_t bad_crc;
  uint64_t bad_cobs;
  uint64_t unknown_id;
  uint64_t wrong_length;
  uint64_t seq_lost;
  uint64_t repeated;
} wheelwire_counters;

/* What a frame that began in an earlier feed may add to the bodies of a feed. */
#define WHEELWIRE_SPARE_ROOM 96

/* The smallest frame, in bytes: no body, one delimiter. */
#define WHEELWIRE_LEAST_FRAME 9

/* Each call of feed writes what it completes to `bodies`, the bodies of the frames packed one after
 * the other, and to `runs`, which messages they are of. Both must outlive the decoder. `bodies`
 * needs room for the largest feed plus WHEELWIRE_SPARE_ROOM bytes, `runs` for as many smallest
 * frames as fit in that, plus one. Returns NULL when out of memory. */
WHEELWIRE_EXPORT wheelwire_decoder* wheelwire_decoder_create(uint8_t* bodies, wheelwire_run* runs);
WHEELWIRE_EXPORT void wheelwire_decoder_destroy(wheelwire_decoder* decoder);

/* Decodes what has arrived, cut anywhere. Returns the number of runs. */
WHEELWIRE_EXPORT size_t wheelwire_decoder_feed(wheelwire_decoder* decoder, const uint8_t* data,
                                               size_t size);
/* Expects any sequence number next: the sender is known to have restarted. */
WHEELWIRE_EXPORT void wheelwire_decoder_restart_sequence(wheelwire_decoder* decoder);
/* The line was reopened: also drops a partial frame. */
WHEELWIRE_EXPORT void wheelwire_decoder_restart(wheelwire_decoder* decoder);
WHEELWIRE_EXPORT void wheelwire_decoder_counters(const wheelwire_decoder* decoder,
                                                 wheelwire_counters* counters);

/* Writes the bodies of all good frames of message `id` in a capture, packed one after the other, to
 * `bodies`, which has room for `size` bytes. Returns the number of frames. */
WHEELWIRE_EXPORT size_t wheelwire_decode_capture(const uint8_t* data, size_t size, uint8_t id,
                                                 uint8_t* bodies);

#ifdef __cplusplus
}
#endif

#endif
