// Driving while measuring: pulses of one bridge, and what the counters did.
//
// As host/wheelwire/tools/setup/driving.py.
import { DeviceRefused } from "../errors.js";
import { Fault, RefusalCode, SupervisorState } from "../generated/protocol.js";
import { SETUP } from "../generated/words.js";
import type { Sample } from "../session.js";
import { fill } from "../text.js";
import { SetupFailed, meaningOf, type ParameterName, type SetupRobot } from "./robot.js";

/** An encoder that rests on an edge may toggle by this much. */
export const RESTING_TICKS = 1;
/** A whole period of A and B: an encoder with one dead channel never gets there. */
export const COUNTED_TICKS = 4;
export const SIDES = ["left", "right"] as const;
/** Index of a wheel, a bridge or a counter. */
export type Side = 0 | 1;
export const BOTH_SIDES: readonly Side[] = [0, 1];
export type Pair = readonly [left: number, right: number];

/** Changes of a count that are more than an encoder at rest on an edge. */
const TOGGLES = 3;
const LONGEST_ROLL_S = 5;
/** On a bad line. */
const LONGEST_ARMING_S = 3;
const RISE_S = 0.08;
const HARDER_S = 0.15;
const LOWEST_DUTY = 0.1;
const RISE = 1.25;
/** Highest duty of a wheel whose counter does nothing: nothing tells how far it turns. */
const HIGHEST_DUTY = 0.6;
/** Below the highest `reversal_duty`, so that at that value no pulse trips REVERSED. */
const HARDEST_DUTY = 0.98;
const SHOW_S = 0.25;
const REST_S = 0.1;
/** What a wrong wiring trips; the wheels have been stopped. */
const OWN_FAULTS =
  Fault.LEFT_NOT_COUNTING | Fault.RIGHT_NOT_COUNTING | Fault.LEFT_REVERSED | Fault.RIGHT_REVERSED;

export function secondsBetween(earlier: Sample, later: Sample): number {
  return (later.tUs - earlier.tUs) / 1e6;
}

/** Ticks of each counter; they wrap. */
export function travel(earlier: Sample, later: Sample): Pair {
  return [(later.left_ticks - earlier.left_ticks) | 0, (later.right_ticks - earlier.right_ticks) | 0];
}

/** The samples of a motion, counted from its first one. */
class Record {
  readonly toggles: [number, number] = [0, 0];
  readonly #first: Sample;
  newest: Sample;

  constructor(first: Sample) {
    this.#first = this.newest = first;
  }

  /** Whether a counter has changed since the sample before. */
  add(sample: Sample): boolean {
    const steps = travel(this.newest, sample);
    for (const side of BOTH_SIDES) if (steps[side] !== 0) this.toggles[side]++;
    this.newest = sample;
    return steps[0] !== 0 || steps[1] !== 0;
  }

  get seconds(): number {
    return secondsBetween(this.#first, this.newest);
  }

  get ticks(): Pair {
    return travel(this.#first, this.newest);
  }
}

/** What the pulses of one bridge did. */
export class Pulsed {
  /**
   * @param duty The duty at which a counter began to count; the highest one if none did.
   * @param ticks The ticks of each counter.
   * @param toggles In how many samples each counter had changed.
   */
  constructor(
    readonly duty: number,
    readonly ticks: Pair,
    readonly toggles: Pair,
  ) {}

  /** Whether it went on in one direction. */
  counted(counter: Side): boolean {
    return Math.abs(this.ticks[counter]) >= COUNTED_TICKS;
  }

  /** Whether its count oscillated. */
  toggled(counter: Side): boolean {
    return Math.abs(this.ticks[counter]) <= 1 && this.toggles[counter] >= TOGGLES;
  }

  /** Whether a counter did anything. */
  get wasNoticed(): boolean {
    return BOTH_SIDES.some((side) => this.counted(side) || this.toggled(side));
  }
}

/** Ask for standstill until the robot has obeyed: after a clear or a start nothing else drives. */
export async function arm(robot: SetupRobot): Promise<void> {
  const begin = await robot.fresh();
  for (let sample = begin; sample.supervisor !== SupervisorState.DRIVING; sample = await robot.read()) {
    if (secondsBetween(begin, sample) > LONGEST_ARMING_S) throw new SetupFailed(SETUP.noSetpoint);
    // Again and again: a setpoint is not acknowledged, and may be lost.
    robot.standStill();
  }
  // Some parameters change only while nothing is obeyed.
  await robot.stop();
}

/** Set a parameter, just after a motion, too: as soon as the robot itself takes it for at rest. */
export async function setAtRest(robot: SetupRobot, name: ParameterName, value: number): Promise<void> {
  const begin = await robot.read();
  for (let newest = begin; ; newest = await robot.read()) {
    try {
      await robot.set(name, value);
      return;
    } catch (error) {
      const isTurning = error instanceof DeviceRefused && error.code === RefusalCode.NOT_STOPPED;
      if (!isTurning || secondsBetween(begin, newest) > LONGEST_ROLL_S) throw error;
    }
  }
}

/**
 * Pulse one bridge forward with rising duty until a counter counts, then once a little longer.
 *
 * With any motor a wheel turns less than 1.5 turns in total. Each pulse is a single setpoint that
 * ends on the robot's own clock.
 */
export function pulse(robot: SetupRobot, side: Side): Promise<Pulsed> {
  return rise(robot, side, RISE_S, LOWEST_DUTY, HIGHEST_DUTY);
}

/** Go on where `pulse` ended: nothing turned, or it is known which wheel does, and which way. */
export function pulseHarder(robot: SetupRobot, side: Side): Promise<Pulsed> {
  return rise(robot, side, HARDER_S, HIGHEST_DUTY * RISE, HARDEST_DUTY);
}

/** Raise the duty until a counter counts; as long as none does anything, up to `unnoticed`. */
async function rise(
  robot: SetupRobot,
  side: Side,
  seconds: number,
  lowest: number,
  unnoticed: number,
): Promise<Pulsed> {
  for (let duty = lowest; ; ) {
    const pulsed = await pulseOnce(robot, side, duty, seconds);
    if (pulsed.wasNoticed) {
      // The longer pulse has more ticks. If it shows nothing, the first one is what there is.
      const shown = await show(robot, side, pulsed);
      return shown.wasNoticed ? shown : pulsed;
    }
    // One tick or two: there is an encoder, and its wheel hardly moves yet.
    const highest = pulsed.toggles.some((count) => count > 0) ? HARDEST_DUTY : unnoticed;
    if (duty >= highest) return pulsed;
    duty = Math.min(duty * RISE, highest);
  }
}

/** Pulse one bridge again, long enough for a person to see which way the wheel turns. */
export async function show(robot: SetupRobot, side: Side, pulsed: Pulsed): Promise<Pulsed> {
  // If no counter noticed it, it is not known how fast the wheel turns.
  const [duty, seconds] = pulsed.wasNoticed
    ? [Math.min(pulsed.duty * RISE, HARDEST_DUTY), SHOW_S]
    : [pulsed.duty, RISE_S];
  const { ticks, toggles } = await pulseOnce(robot, side, duty, seconds);
  return new Pulsed(pulsed.duty, ticks, toggles);
}

function pulseOnce(robot: SetupRobot, side: Side, duty: number, seconds: number): Promise<Pulsed> {
  return run(robot, side === 0 ? [duty, 0] : [0, duty], seconds);
}

/**
 * Drive both bridges for this long, stop, and wait for standstill.
 *
 * The robot's own clock ends a short drive. Faults that a wrong wiring trips are cleared.
 *
 * @throws SetupFailed The board was reset, or an e-stop or another fault was latched.
 */
export async function run(robot: SetupRobot, duties: Pair, seconds: number): Promise<Pulsed> {
  const record = new Record(await robot.fresh());
  await drive(robot, duties, seconds, record);
  const { supervisor: state, faults } = record.newest;
  if (state === SupervisorState.ESTOPPED) throw new SetupFailed(SETUP.estopPressed);
  if (state === SupervisorState.FAULT) {
    if ((faults & ~OWN_FAULTS) !== 0) throw new SetupFailed(fill(SETUP.faultStopped, meaningOf(faults)));
    await robot.clear("ClearFault");
    await arm(robot);
  }
  return new Pulsed(Math.max(...duties), record.ticks, record.toggles);
}

async function drive(robot: SetupRobot, duties: Pair, seconds: number, record: Record): Promise<void> {
  let untilS = 0;
  while (record.seconds < seconds) {
    const nowS = record.seconds;
    // Renewed at half of its life, so that a late sample does not interrupt the drive.
    if (untilS < seconds && untilS - nowS < robot.lifeS / 2) {
      const ttlS = Math.min(robot.lifeS, seconds - nowS);
      try {
        robot.setDuty(...duties, ttlS);
      } catch (error) {
        // The next sample has a fault.
        if (!(error instanceof DeviceRefused) || error.code !== RefusalCode.FAULT) throw error;
      }
      untilS = nowS + ttlS;
    }
    record.add(await robot.read());
    if (record.newest.supervisor === SupervisorState.FAULT) break;
  }
  await robot.stop();
  for (let movedS = record.seconds; record.seconds - movedS < REST_S; ) {
    if (record.add(await robot.read())) movedS = record.seconds;
    if (record.seconds > seconds + LONGEST_ROLL_S) break; // a counter that toggles at rest
  }
}
