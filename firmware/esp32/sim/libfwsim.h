/* The simulated device in virtual time, for any language: the firmware's core on a model robot.
 *
 * Nothing here blocks, prints or raises. A simulator is used by one thread at a time; two of them
 * share nothing. The same seed and the same calls give the same run. Without memory the process
 * ends.
 */
#ifndef WHEELWIRE_LIBFWSIM_H
#define WHEELWIRE_LIBFWSIM_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define FWSIM_EXPORT __attribute__((visibility("default")))

typedef struct fwsim fwsim;

/* Returned by every function that returns an int. */
enum fwsim_status {
  FWSIM_OK = 0,
  FWSIM_UNKNOWN_NAME = -1, /* No variable of this name. */
  FWSIM_READ_ONLY = -2,
  FWSIM_OUT_OF_RANGE = -3, /* Not finite, out of bounds, or at odds with the other variables. */
  FWSIM_BAD_ARGUMENT = -4  /* A null pointer, a negative time. */
};

/* A settable variable lies between minimum and maximum; both are 0 for a read-only one. */
typedef struct fwsim_variable {
  const char* name;
  const char* unit;
  const char* doc;
  double minimum;
  double maximum;
  int settable;
} fwsim_variable;

/* Powers a device on at time 0. */
FWSIM_EXPORT fwsim* fwsim_create(uint64_t seed);
FWSIM_EXPORT void fwsim_destroy(fwsim* sim);

/* Stores the parameters in a file, and other saved data next to it; call this before the first
 * advance. */
FWSIM_EXPORT int fwsim_use_store(fwsim* sim, const char* path);

/* Changes the default of the parameter with this id, from the next reset on. */
FWSIM_EXPORT int fwsim_preset(fwsim* sim, int parameter, float value);

FWSIM_EXPORT int fwsim_set(fwsim* sim, const char* name, double value);
FWSIM_EXPORT int fwsim_get(const fwsim* sim, const char* name, double* value);

/* Runs the device and the world for this long [us]. */
FWSIM_EXPORT int fwsim_advance_us(fwsim* sim, int64_t duration_us);
/* Runs them in steps until a step brings bytes to the host, or for `count` steps; *done is set to
   how many. */
FWSIM_EXPORT int fwsim_advance_to_bytes(fwsim* sim, int64_t step_us, int64_t count, int64_t* done);

/* Bytes from the host onto the line. */
FWSIM_EXPORT int fwsim_write(fwsim* sim, const uint8_t* data, size_t size);
/* Bytes that have reached the host; *size is set to how many were read. */
FWSIM_EXPORT int fwsim_read(fwsim* sim, uint8_t* out, size_t capacity, size_t* size);

/* The black box of the device, WHEELWIRE_BOX_SIZE bytes as capi/wheelwire_core.h describes them:
 * the last second or two, or those before a fault or an e-stop. */
FWSIM_EXPORT int fwsim_box(fwsim* sim, uint8_t* out, size_t capacity, size_t* size);

FWSIM_EXPORT size_t fwsim_variable_count(void);
FWSIM_EXPORT int fwsim_describe(size_t index, fwsim_variable* description);

/* The robot without the device: levels of GPIOs in, edges of its encoders out. For programs that
 * replace a computer's own pins. One thread at a time. */
typedef struct fwsim_robot fwsim_robot;

/* A level of an encoder changed. */
typedef struct fwsim_edge {
  uint64_t t_ns;
  uint32_t gpio;
  uint32_t level;
} fwsim_edge;

/* `board`: the wiring of the GPIOs, packed as it is sent and stored. Returns NULL if it is damaged.
 * */
FWSIM_EXPORT fwsim_robot* fwsim_robot_create(const uint8_t* board, size_t size,
                                             int counts_per_revolution, int64_t now_ns);
FWSIM_EXPORT void fwsim_robot_destroy(fwsim_robot* robot);

/* The duties of the first `count` GPIOs, 0 to 32767, of 64 at most. Returns 1 while a motor is
 * driven, plus 2 while one is braked, its winding shorted all the time. */
FWSIM_EXPORT int fwsim_robot_set_pins(fwsim_robot* robot, const uint16_t* duty_q15, size_t count);

/* Lets time pass until `end_ns`; it skips a gap longer than `longest_ns` except for that much at
 * its end. *edges has the edges, in order, until the next call; *count is their number. */
FWSIM_EXPORT int fwsim_robot_advance(fwsim_robot* robot, int64_t end_ns, int64_t longest_ns,
                                     const fwsim_edge** edges, size_t* count);

/* From now on both wheels turn at this rate [1/s], whatever the motors do. */
FWSIM_EXPORT void fwsim_robot_spin(fwsim_robot* robot, double ticks_per_s);

/* What a perfect encoder would have counted since the start; `side` is 0 for the left wheel, and 1
 * for the right one. */
FWSIM_EXPORT int64_t fwsim_robot_ticks(fwsim_robot* robot, int side);
/* From now on the encoder's levels are stuck. */
FWSIM_EXPORT void fwsim_robot_kill_encoder(fwsim_robot* robot, int side);

#ifdef __cplusplus
}
#endif

#endif
