// Which wire leads where, from one pulse of each bridge and what a person saw.
//
// As host/wheelwire/tools/setup/wiring.py: the first half of `wheelwire setup`.
import { DeviceRefused } from "../errors.js";
import { RefusalCode, SupervisorState } from "../generated/protocol.js";
import { DEFECTS, HIGHEST, SETUP } from "../generated/words.js";
import { fill } from "../text.js";
import {
  BOTH_SIDES,
  COUNTED_TICKS,
  RESTING_TICKS,
  SIDES,
  arm,
  pulse,
  pulseHarder,
  run,
  secondsBetween,
  setAtRest,
  show,
  travel,
  type Pair,
  type Pulsed,
  type Side,
} from "./driving.js";
import { SetupFailed, meaningOf, type SetupRobot } from "./robot.js";

/** A person's answers. */
export const [YES, NO, AGAIN, NONE, BOTH] = ["yes", "no", "again", "none", "both"] as const;
const [TURNED, HELD, SKIP] = ["turned", "held", "skip"] as const;
const WHEEL_AND_WAY = ["left forward", "left backward", "right forward", "right backward"];
const WAYS = ["forward", "backward"];

/** 0 is not measured. */
const LOWEST_SUPPLY_MV = 2000;
/** Fraction of `nominal_supply_v`: no battery worth measuring motors with is as empty. */
const LOW_SUPPLY = 0.6;
const STILL_S = 0.5;
const REPEATS = 3;
const CONFIRM_S = 0.3;
const CONFIRM_DUTY = [0.25, 0.6] as const;
const HAND_TURNS = 0.5;

export interface Question {
  readonly key: string;
  readonly text: string;
  readonly choices: readonly string[];
  /** A wheel to be turned by hand before the answer, forward. */
  readonly turn?: { readonly side: Side; readonly turns: number };
}

/** Answers questions, with one of their choices. */
export interface Person {
  answer: (question: Question) => Promise<string>;
  say: (text: string) => void;
}

/** The parameters that correct a wiring; 1: it is swapped, or inverted. */
export const CORRECTIONS = [
  "motors_swapped",
  "encoders_swapped",
  "left_motor_inverted",
  "right_motor_inverted",
  "left_encoder_inverted",
  "right_encoder_inverted",
] as const;
export type Wiring = Readonly<Record<(typeof CORRECTIONS)[number], 0 | 1>>;

/** What keeps a robot from being set up, and what no parameter mends. */
export class Unfit extends SetupFailed {
  override name = "Unfit";

  constructor(readonly problems: readonly string[]) {
    super(problems.join("; "));
  }
}

function problem(defect: keyof typeof DEFECTS, side?: Side, detail = ""): string {
  const name = side === undefined ? "" : SIDES[side];
  return DEFECTS[defect].replaceAll("{side}", name).replaceAll("{detail}", detail);
}

/** One bridge was pulsed forward: what the counters did, and what a person saw. */
class Seen {
  constructor(
    readonly pulsed: Pulsed,
    readonly answer: string,
  ) {}

  /** The one that turned; undefined for none and both. */
  get wheel(): Side | undefined {
    return BOTH_SIDES.find((side) => this.answer.startsWith(SIDES[side]));
  }

  get isBackward(): boolean {
    return this.answer.endsWith("backward");
  }

  /** The counters that counted. */
  get counters(): Side[] {
    return BOTH_SIDES.filter((side) => this.pulsed.counted(side));
  }
}

type Both = readonly [first: Seen, second: Seen];

/** What keeps the wiring from being deduced; not what keeps a wheel from turning. */
function findProblems(seen: Both): string[] {
  // A defect that concerns both wheels is returned alone: it explains what else was seen.
  if (seen.some((one) => one.answer === BOTH)) return [problem("BOTH_TURNED")];
  for (const { wheel, counters } of seen) {
    if (wheel !== undefined && counters.length === 2) return [problem("SAME_ENCODER", wheel)];
  }
  const found: string[] = [];
  for (const { wheel, counters, pulsed } of seen) {
    const toggled = BOTH_SIDES.filter((side) => pulsed.toggled(side));
    if (wheel === undefined) {
      if (pulsed.wasNoticed) found.push(problem("UNSEEN"));
    } else if (counters.length === 0) {
      if (toggled.length === 2) return [problem("CHANNELS_MIXED")];
      found.push(problem(toggled.length > 0 ? "CHANNEL_DEAD" : "NO_ENCODER", wheel));
    }
  }
  const [first, second] = seen.map(({ counters }) => counters[0]);
  if (found.length === 0 && first !== undefined && first === second) found.push(problem("SHARED_COUNTER"));
  return found;
}

/** The wiring, if no problems were found: each pulse turned one wheel and moved one counter. */
function deduce([first, second]: Both): Wiring {
  // Pulses come by bridge, corrections are by wheel.
  const isSwapped = first.wheel === 1;
  const [left, right] = isSwapped ? [second, first] : [first, second];
  const counterOf = (one: Seen): Side => one.counters[0] ?? 0;
  // Counting up while the wheel turns forward, or down while it turns backward, is right.
  const isReversed = (one: Seen): boolean => one.pulsed.ticks[counterOf(one)] < 0 !== one.isBackward;
  const bit = (value: boolean): 0 | 1 => (value ? 1 : 0);
  return {
    motors_swapped: bit(isSwapped),
    encoders_swapped: bit(counterOf(left) === 1),
    left_motor_inverted: bit(left.isBackward),
    right_motor_inverted: bit(right.isBackward),
    left_encoder_inverted: bit(isReversed(left)),
    right_encoder_inverted: bit(isReversed(right)),
  };
}

/**
 * Find the wiring, correct it, and save that after a yes.
 *
 * @return The wiring; undefined if the person does not want it saved: the robot has its previous
 *   parameters again.
 * @throws Unfit No wiring explains what was seen.
 * @throws SetupFailed, WheelwireError It cannot go on.
 */
export async function setUpWiring(robot: SetupRobot, whoAnswers: Person): Promise<Wiring | undefined> {
  const answer = (question: Question): Promise<string> => robot.unlessEnded(whoAnswers.answer(question));
  const person = { say: whoAnswers.say, answer };
  await robot.refuseContradictions(person.say);
  let saved: Wiring | undefined;
  await robot.trial(async (keep) => {
    await notWatching(robot, "rolling_velocity_mps", async () => {
      saved = await findAndTry(robot, person);
    });
    if (saved === undefined) return;
    // The device saves nothing while values are on trial.
    await keep();
    await robot.save(CORRECTIONS);
    person.say("saved");
  });
  return saved;
}

async function findAndTry(robot: SetupRobot, person: Person): Promise<Wiring | undefined> {
  if ((await person.answer({ key: "raised", text: SETUP.raised, choices: [YES, NO] })) !== YES) {
    throw new Unfit([problem("ON_THE_FLOOR")]);
  }
  await checkStill(robot);
  for (const low of await findLowBattery(robot)) person.say(low);
  // A correction that is active would be mistaken for the wires.
  for (const name of CORRECTIONS) await setAtRest(robot, name, 0);
  const { wiring, duties } = await findWiring(robot, person);
  for (const name of CORRECTIONS) await setAtRest(robot, name, wiring[name]);
  const wrong = CORRECTIONS.filter((name) => wiring[name] === 1);
  person.say(`found: ${wrong.join(", ") || "wired as expected"}`);
  person.say(SETUP.bothTurn);
  await confirm(robot, duties);
  // Both answers wrong in the same way make a robot that is sound, but the wrong way round.
  const question = { key: "save", text: `Did both wheels turn forward? ${SETUP.save}`, choices: [YES, NO] };
  return (await person.answer(question)) === YES ? wiring : undefined;
}

/** Set a threshold to its maximum for a while. After a failure the end of the trial restores it. */
async function notWatching(
  robot: SetupRobot,
  name: keyof typeof HIGHEST,
  act: () => Promise<void>,
): Promise<void> {
  const previous = await robot.get(name);
  await setAtRest(robot, name, HIGHEST[name]);
  await act();
  await setAtRest(robot, name, previous);
}

async function checkStill(robot: SetupRobot): Promise<void> {
  await clear(robot);
  const start = await robot.fresh();
  // USB may feed the board while the battery is switched off.
  if (start.battery_mv !== 0 && start.battery_mv < LOWEST_SUPPLY_MV) throw new Unfit([problem("NO_SUPPLY")]);
  let sample = start;
  while (secondsBetween(start, sample) < STILL_S) sample = await robot.read();
  if (largest(travel(start, sample)) > RESTING_TICKS) throw new SetupFailed(SETUP.turnsUndriven);
}

/** Clear everything that is latched. */
async function clear(robot: SetupRobot): Promise<void> {
  let sample = await robot.fresh();
  try {
    if (sample.supervisor === SupervisorState.ESTOPPED) {
      await robot.clear("ClearEstop");
      sample = await robot.fresh();
    }
    // A fault that the e-stop hid is active again once that is cleared.
    if (sample.supervisor === SupervisorState.FAULT) await robot.clear("ClearFault");
    // Even if nothing was latched: choosing a board has restarted the robot.
    await arm(robot);
  } catch (error) {
    if (!(error instanceof DeviceRefused) || error.code !== RefusalCode.CAUSE_PRESENT) throw error;
    // `sample` is from before the refused request, so its state tells which one that was.
    if (sample.supervisor === SupervisorState.ESTOPPED) throw new Unfit([problem("CONTACT_OPEN")]);
    throw new SetupFailed(fill(SETUP.faultLasts, meaningOf(sample.faults)));
  }
}

/** Whether the battery, as far as it is measured, is too empty to judge a motor by. */
async function findLowBattery(robot: SetupRobot): Promise<string[]> {
  const batteryV = (await robot.fresh()).battery_mv / 1000;
  const nominalV = await robot.get("nominal_supply_v");
  if (batteryV === 0 || batteryV >= LOW_SUPPLY * nominalV) return [];
  const detail = `${batteryV.toFixed(1)} V, and nominal_supply_v is ${Number(nominalV.toPrecision(6))}`;
  return [problem("LOW_BATTERY", undefined, detail)];
}

interface Found {
  readonly wiring: Wiring;
  /** The duty that set each wheel in motion. */
  readonly duties: Pair;
}

/** The wiring, by two pulses and two answers. No correction may be active. */
async function findWiring(robot: SetupRobot, person: Person): Promise<Found> {
  person.say(SETUP.pulsed);
  let seen: Both | undefined;
  // A wheel that counts against its drive is not a fault yet. The fault would end a pulse before anybody has seen the
  // wheel turn.
  await notWatching(robot, "reversal_duty", async () => {
    const first = await ask(robot, person, "first", 0, WHEEL_AND_WAY);
    person.say(SETUP.otherMotor);
    let second = await ask(robot, person, "second", 1, first.wheel === undefined ? WHEEL_AND_WAY : WAYS);
    // Asked about the other wheel alone, a person answers only which way it turned.
    if (first.wheel !== undefined && WAYS.includes(second.answer)) {
      second = new Seen(second.pulsed, `${SIDES[first.wheel === 0 ? 1 : 0]} ${second.answer}`);
    }
    seen = [first, second];
  });
  if (seen === undefined) throw new RangeError("there are two answers");
  const problems = findProblems(seen);
  // Pulses alone do not tell a dead motor from a blocked wheel or a missing supply: a hand does.
  if (problems.length === 0 || seen.some((one) => one.answer === NONE)) {
    problems.push(...(await motionless(robot, person, seen)));
  }
  if (problems.length > 0) {
    // A wheel that hardly moves looks like many things.
    const low = await findLowBattery(robot);
    throw new Unfit(low.length > 0 ? low : problems);
  }
  const wiring = deduce(seen);
  // Pulses are counted by bridge, the duties are by wheel.
  const [first, second] = [seen[0].pulsed.duty, seen[1].pulsed.duty];
  return { wiring, duties: wiring.motors_swapped === 1 ? [second, first] : [first, second] };
}

async function ask(
  robot: SetupRobot,
  person: Person,
  key: string,
  side: Side,
  choices: readonly string[],
): Promise<Seen> {
  const text = choices === WAYS ? SETUP.whichWay : SETUP.whichWheel;
  const question = { key, text, choices: [...choices, NONE, BOTH, AGAIN] };
  const seen = await askUntilSeen(robot, person, question, side, await pulse(robot, side));
  if (seen.pulsed.wasNoticed || seen.answer !== NONE) return seen;
  // A low supply, much friction or a weak motor: where nothing turned, nothing turns far.
  const harder = await pulseHarder(robot, side);
  if (harder.wasNoticed) return askUntilSeen(robot, person, question, side, harder);
  return new Seen(harder, NONE);
}

async function askUntilSeen(
  robot: SetupRobot,
  person: Person,
  question: Question,
  side: Side,
  first: Pulsed,
): Promise<Seen> {
  let pulsed = first;
  // No counter noticed this wheel, so nothing shows how far it has turned: it is shown only once more.
  const repeats = pulsed.wasNoticed ? REPEATS : 1;
  for (let repeat = 0; repeat < repeats; repeat++) {
    const answer = await person.answer(question);
    if (answer !== AGAIN) return new Seen(pulsed, answer);
    const shown = await show(robot, side, pulsed);
    if (!pulsed.wasNoticed) pulsed = shown;
  }
  // More turns would be too many for an unknown wheel.
  const last = { ...question, choices: question.choices.filter((choice) => choice !== AGAIN) };
  return new Seen(pulsed, await person.answer(last));
}

/** What is wrong with wheels that no pulse turned, found with a hand on them. */
async function motionless(robot: SetupRobot, person: Person, seen: Both): Promise<string[]> {
  const still = seen.filter((one) => one.answer === NONE);
  // If a counter moved, the wheel is not motionless: `findProblems` has reported the problem.
  if (still.length === 0 || still.some((one) => one.pulsed.wasNoticed)) return [];
  const wheels = BOTH_SIDES.filter((side) => seen.every((one) => one.wheel !== side));
  const hands: { side: Side; answer: string; counted: boolean }[] = [];
  for (const side of wheels) hands.push({ side, ...(await byHand(robot, person, side)) });
  const works = hands.filter(({ answer, counted }) => counted && answer !== HELD);
  const skipped = hands.filter(({ answer }) => answer === SKIP);
  // If both wheels count when they are turned by hand, what is missing is what the motors share.
  if (works.length === 2 || skipped.length === 2) return [problem("NO_SUPPLY")];
  return hands.map(({ side, answer, counted }) => {
    if (answer === HELD) return problem("BLOCKED", side);
    return problem(counted || answer === SKIP ? "NO_MOTOR" : "NO_ENCODER", side);
  });
}

async function byHand(
  robot: SetupRobot,
  person: Person,
  side: Side,
): Promise<{ answer: string; counted: boolean }> {
  const before = await robot.fresh();
  const answer = await person.answer({
    key: `hand_${SIDES[side]}`,
    text: fill(SETUP.byHand, SIDES[side]),
    choices: [TURNED, HELD, SKIP],
    turn: { side, turns: HAND_TURNS },
  });
  // Either counter: the encoders may be swapped.
  return { answer, counted: largest(travel(before, await robot.fresh())) >= COUNTED_TICKS };
}

/** Drive both wheels forward for a moment, with the corrections active. */
async function confirm(robot: SetupRobot, duties: Pair): Promise<void> {
  const [low, high] = CONFIRM_DUTY;
  const duty = Math.min(Math.max(1.5 * Math.max(...duties), low), high);
  let { ticks } = await run(robot, [duty, duty], CONFIRM_S);
  // With a low supply or much friction no wheel may turn. That proves nothing about the wiring.
  if (Math.min(...ticks.map(Math.abs)) < COUNTED_TICKS) ({ ticks } = await run(robot, [1, 1], CONFIRM_S));
  const wrong = BOTH_SIDES.filter((side) => ticks[side] < COUNTED_TICKS);
  if (wrong.length === 0) return;
  const detail = wrong.map((side) => `the ${SIDES[side]} wheel counted ${ticks[side]}`).join(" and ");
  throw new Unfit([problem("NOT_CONFIRMED", undefined, detail)]);
}

function largest(ticks: Pair): number {
  return Math.max(...ticks.map(Math.abs));
}
