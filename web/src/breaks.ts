// What a person can break, what should happen then, and whether it did.
import { Fault, Held, ResetReason, SupervisorState } from "./generated/protocol.js";
import { mm, time, type Observation } from "./observation.js";
import { LIMITS_MPS, TTL_US, isClose } from "./program.js";
import type { World } from "./world.js";

const { BOOT, DRIVING, ESTOPPED, FAULT, IDLE, TIMED_OUT } = SupervisorState;
/** Two control periods of the firmware. */
const LATEST_US = 2000;
const FULL_V = 7.4;
/** The chip's regulator needs this much. */
const BROWNOUT_V = 4.5;
const DRAINED_V = 3;
const DRAIN_US = 3_000_000;
const SLOPE_RAD = 0.08;
const BUMPER_ROLL_M = 0.15;

/** Something that can be broken. */
export interface Break {
  /** What its button is called. */
  readonly name: string;
  /** What should happen, said beforehand. */
  readonly should: string;
  /** At rest nothing happens. */
  readonly needsDrive: boolean;
  /** After so much of what was broken there is something to say, though nothing stopped. */
  readonly watchUs: number;
  readonly apply: (world: World) => void;
  readonly repair: (world: World) => void;
  /** Called after each slice while it is broken. */
  readonly tick?: (world: World, elapsedUs: number) => void;
  /** Whether what should happen did. */
  readonly isMet: (seen: Observation) => boolean;
  /** Further remarks. */
  readonly note?: (seen: Observation) => string;
}

function variable(...names: string[]): Pick<Break, "apply" | "repair"> {
  const put = (value: number) => (world: World) => {
    for (const name of names) world.simulator.set(name, value);
  };
  return { apply: put(1), repair: put(0) };
}

function setSupply(world: World, volts: number): void {
  world.simulator.set("supply_v", volts);
  world.simulator.set("battery_v", volts);
}

function timedOut(seen: Observation): boolean {
  const lateUs = seen.stop?.lateUs;
  const end = seen.states.find((one) => one.state === TIMED_OUT);
  if (lateUs === undefined || end === undefined || drivesAgain(seen)) return false;
  return lateUs <= LATEST_US && seen.sinceDriveUs(end.afterUs) <= TTL_US + LATEST_US;
}

function drivesAgain(seen: Observation): boolean {
  return seen.states.some((one, at) => at > 0 && one.state === DRIVING);
}

function tripped(...faults: number[]): (seen: Observation) => boolean {
  return (seen) => seen.reached(FAULT) && faults.some((fault) => (seen.faults & fault) !== 0);
}

const WITHIN = `its last setpoint expires after at most ${time(TTL_US)}`;

export const BREAKS: readonly Break[] = [
  {
    name: "hang the program",
    should: `The program runs no more: ${WITHIN}, and within 2 ms of that the robot removes the drive by itself.`,
    needsDrive: true,
    watchUs: 3_000_000,
    apply: (world) => {
      world.isHung = true;
    },
    repair: (world) => {
      world.resume();
    },
    isMet: timedOut,
  },
  {
    name: "pull the cable",
    should: `Nothing arrives any more: ${WITHIN}, and the robot removes the drive by itself. Plugged in again, it stands until you drive.`,
    needsDrive: true,
    watchUs: 3_000_000,
    apply: (world) => {
      world.cable.pulled = true;
    },
    repair: (world) => {
      world.cable.pulled = false;
    },
    isMet: timedOut,
  },
  {
    name: "corrupt 1 % of the bytes",
    should: "Each frame has a checksum: those that are damaged are counted and never used. It drives on.",
    needsDrive: true,
    watchUs: 4_000_000,
    apply: (world) => {
      world.cable.corruption = 0.01;
    },
    repair: (world) => {
      world.cable.corruption = 0;
    },
    isMet: (seen) => seen.damaged.damaged > 0 && seen.faults === 0,
    note: (seen) =>
      `Of ${seen.damaged.all} frames ${seen.damaged.damaged} came damaged; none was used.`,
  },
  {
    name: "cut an encoder",
    should: "The left wheel is driven, and counts nothing: within a second a fault stops both wheels.",
    needsDrive: true,
    watchUs: 4_000_000,
    ...variable("left.encoder_dead"),
    isMet: tripped(Fault.LEFT_NOT_COUNTING),
  },
  {
    name: "halve an encoder",
    should:
      "The left wheel turns twice as fast as it counts, so the robot leaves its path. A fault stops it once that takes much more duty than the speed explains; in slow drives nothing can see it.",
    needsDrive: true,
    watchUs: 12_000_000,
    apply: (world) => {
      world.simulator.set("left.encoder_lost", 0.5);
    },
    repair: (world) => {
      world.simulator.set("left.encoder_lost", 0);
    },
    isMet: (seen) => !seen.reached(FAULT) || (seen.faults & Fault.LEFT_ENCODER_IMPLAUSIBLE) !== 0,
  },
  {
    name: "block a wheel",
    should: "The left wheel is held fast while it is driven: within a second a fault stops both wheels.",
    needsDrive: true,
    watchUs: 4_000_000,
    ...variable("left.blocked"),
    isMet: tripped(Fault.LEFT_NOT_COUNTING),
  },
  {
    name: "reverse a motor's wires",
    should: "The left wheel speeds up against its drive: a fault stops both wheels before a quarter turn.",
    needsDrive: true,
    watchUs: 4_000_000,
    ...variable("left.motor_reversed"),
    isMet: tripped(Fault.LEFT_REVERSED),
  },
  {
    name: "open the e-stop contact",
    should: "The robot brakes within 2 ms and latches. It can be cleared once the contact is closed.",
    needsDrive: false,
    watchUs: 4_000_000,
    ...variable("estop_open"),
    isMet: (seen) => seen.reached(ESTOPPED) && (seen.held & Held.CONTACT) !== 0,
  },
  {
    name: "press the front bumper",
    should: "No wheel turns forward any more; it can back out. Once the bumper is free, it waits for a fresh start.",
    needsDrive: false,
    watchUs: 2_000_000,
    ...variable("bumper.front_left", "bumper.front_right"),
    isMet: (seen) => {
      const bumpers = Held.BUMPER_FRONT_LEFT | Held.BUMPER_FRONT_RIGHT;
      return (seen.held & bumpers) === bumpers && seen.forwardM < BUMPER_ROLL_M;
    },
    note: (seen) => `It went ${mm(seen.forwardM)} mm forward since.`,
  },
  {
    name: "put it on a slope",
    should:
      "It drives on at its speed. After a stop it brakes for one second, then rolls downhill, and says so. Its parameter stop_mode can make it brake until it is driven; a wedge is better.",
    needsDrive: false,
    watchUs: 4_000_000,
    apply: (world) => {
      world.simulator.set("slope_rad", SLOPE_RAD);
    },
    repair: (world) => {
      world.simulator.set("slope_rad", 0);
    },
    isMet: (seen) => seen.faults === 0,
    note: (seen) => `It went ${mm(seen.movedM)} mm since.`,
  },
  {
    name: "drain the battery",
    should: `The supply falls for three seconds. Below ${BROWNOUT_V} V the chip is reset, and held there: the wheels coast. Charged, it starts, and stands until you drive.`,
    needsDrive: false,
    watchUs: 6_000_000,
    apply: (world) => {
      world.simulator.set("brownout_v", BROWNOUT_V);
    },
    tick: (world, elapsedUs) => {
      if (elapsedUs > DRAIN_US) return;
      setSupply(world, FULL_V - ((FULL_V - DRAINED_V) * elapsedUs) / DRAIN_US);
    },
    repair: (world) => {
      setSupply(world, FULL_V);
      world.simulator.set("brownout_v", 0);
    },
    isMet: (seen) => seen.reached(BOOT) && !drivesAgain(seen),
  },
  {
    name: "crash the chip",
    should: "The drive is gone at once. The chip starts anew, the program says hello again, and nothing moves until you drive.",
    needsDrive: false,
    watchUs: 4_000_000,
    apply: (world) => {
      world.simulator.set("reset", ResetReason.PANIC);
    },
    repair: () => undefined,
    isMet: (seen) => seen.reached(IDLE) && seen.sessions === 1 && !drivesAgain(seen),
    note: (seen) => `Sessions opened since: ${seen.sessions}.`,
  },
  {
    name: "cut the power while it saves",
    should:
      "The robot stops, and its speed limit is saved; in the middle of that its power fails, and comes back. It has the old limit or the new one, nothing is damaged, and it stands until you drive.",
    needsDrive: false,
    watchUs: 4_000_000,
    apply: (world) => {
      world.simulator.set("power_cut_at_write", 1);
      world.program.save(world.nowUs);
    },
    repair: (world) => {
      world.simulator.set("power_cut_at_write", 0);
    },
    isMet: (seen) =>
      seen.reached(BOOT) &&
      seen.faults === 0 &&
      LIMITS_MPS.some((limit) => isClose(seen.limitMps, limit)) &&
      !drivesAgain(seen),
    note: (seen) =>
      seen.limitMps === undefined ? "" : `Its speed limit is ${mm(seen.limitMps)} mm/s.`,
  },
];

