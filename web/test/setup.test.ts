// The first half of setup, on simulated robots in virtual time, judged by the truth.
import { describe, expect, test } from "vitest";
import { WheelwireError } from "../src/errors.js";
import { ResetReason } from "../src/generated/protocol.js";
import { SetupFailed, SetupRobot } from "../src/setup/robot.js";
import { CORRECTIONS, setUpWiring, type Person, type Question, type Wiring } from "../src/setup/wiring.js";
import { SLICE_US, type World } from "../src/world.js";
import { opened } from "./world.js";

/** Variables of the simulator, in the order of CORRECTIONS. */
const VARIABLES = [
  "motors_swapped",
  "encoders_swapped",
  "left.motor_reversed",
  "right.motor_reversed",
  "left.encoder_reversed",
  "right.encoder_reversed",
] as const;
const SIDES = ["left", "right"] as const;
/** A person does not see a smaller turn. */
const SEEN_TURNS = 0.005;
/** Turns of a wheel, at most, before its direction is known. */
const MOST_TURNS = 1.5;
const HAND_LIMIT_US = 1_500_000;
const LONGEST_US = 120_000_000;

type Settings = Readonly<Record<string, number>>;

/** Answers by the truth of a simulated robot, and turns its wheels. */
class SimulatedPerson implements Person {
  readonly asked: string[] = [];
  readonly said: string[] = [];
  mostTurns = 0;
  #turns: readonly [number, number];
  #known = [false, false];

  constructor(
    readonly world: World,
    readonly answers: Readonly<Record<string, string>> = {},
  ) {
    this.#turns = this.#trueTurns;
  }

  say = (text: string): void => {
    this.said.push(text);
  };

  answer = async (question: Question): Promise<string> => {
    this.asked.push(question.key);
    const before = this.#turns;
    const now = (this.#turns = this.#trueTurns);
    const given = this.answers[question.key];
    if (given === "") return new Promise(() => undefined); // they think
    if (given !== undefined) return given;
    if (question.turn !== undefined) return this.#turn(question.turn.side, question.turn.turns);
    if (question.key === "raised") return this.world.simulator.get("wheels_free") === 1 ? "yes" : "no";
    if (question.key === "save") return "yes";
    const unknown = now.map((turns, side) => (this.#known[side] === true ? 0 : Math.abs(turns)));
    this.mostTurns = Math.max(this.mostTurns, ...unknown);
    this.#known = now.map((turns) => turns !== 0);
    const moved = SIDES.filter((_, side) => Math.abs((now[side] ?? 0) - (before[side] ?? 0)) > SEEN_TURNS);
    const [side] = moved;
    if (side === undefined || moved.length > 1) return side === undefined ? "none" : "both";
    const index = SIDES.indexOf(side);
    const way = (now[index] ?? 0) > (before[index] ?? 0) ? "forward" : "backward";
    return question.choices.includes(way) ? way : `${side} ${way}`;
  };

  async #turn(side: 0 | 1, turns: number): Promise<string> {
    const name = `${SIDES[side]}.hand_turns`;
    const { simulator } = this.world;
    simulator.set(name, turns);
    const endUs = this.world.nowUs + HAND_LIMIT_US;
    while (simulator.get(name) !== 0 && this.world.nowUs < endUs) await turn();
    const isHeld = simulator.get(name) !== 0;
    simulator.set(name, 0);
    this.#turns = this.#trueTurns;
    return isHeld ? "held" : "turned";
  }

  get #trueTurns(): readonly [number, number] {
    const { simulator } = this.world;
    return [simulator.get("true.left_turns"), simulator.get("true.right_turns")];
  }
}

/** What is waited for has a chance to go on. */
function turn(): Promise<void> {
  return new Promise((resolve) => {
    setImmediate(resolve);
  });
}

interface Outcome {
  readonly world: World;
  readonly person: SimulatedPerson;
  readonly result: Wiring | WheelwireError | undefined;
}

/** Let time pass until something ends; `during` is called after each slice. */
async function ended<T>(world: World, ends: Promise<T>, during: () => void = () => undefined): Promise<T> {
  const state = { isOver: false };
  const end = (): void => { state.isOver = true; };
  void ends.then(end, end);
  while (!state.isOver) {
    world.run(SLICE_US);
    during();
    await turn();
  }
  return ends;
}

/** Set a raised robot up; `during` is called after each slice. */
async function setUp(
  settings: Settings,
  answers: Readonly<Record<string, string>> = {},
  during: (world: World, person: SimulatedPerson) => void = () => undefined,
): Promise<Outcome> {
  const world = await opened();
  for (const [name, value] of Object.entries({ wheels_free: 1, ...settings })) world.simulator.set(name, value);
  const person = new SimulatedPerson(world, answers);
  const robot = new SetupRobot(world.program, () => world.nowUs);
  const found = setUpWiring(robot, person).catch((error: unknown) => {
    if (error instanceof WheelwireError) return error;
    throw error;
  });
  const result = await ended(world, found, () => {
    during(world, person);
    if (world.nowUs > LONGEST_US) throw new Error(`it does not end: ${person.asked.join(", ")}`);
  });
  robot.release();
  return { world, person, result };
}

function messageOf(result: Outcome["result"]): string {
  return result instanceof Error ? result.message : "no failure";
}

function wiringOf(wired: readonly number[]): Wiring {
  return Object.fromEntries(CORRECTIONS.map((name, at) => [name, wired[at] ?? 0])) as Wiring;
}

async function parameters(world: World): Promise<Settings> {
  const robot = new SetupRobot(world.program, () => world.nowUs);
  const found: Record<string, number> = {};
  for (const name of [...CORRECTIONS, "reversal_duty", "rolling_velocity_mps"] as const) {
    found[name] = await ended(world, robot.get(name));
  }
  return found;
}

const WIRINGS = Array.from({ length: 64 }, (_, bits) => VARIABLES.map((_, at) => (bits >> at) & 1));

test("all 64 wirings are found, corrected and saved", async () => {
  let most = 0;
  for (const wired of WIRINGS) {
    const settings = Object.fromEntries(VARIABLES.map((name, at) => [name, wired[at] ?? 0]));
    const { result, person, world } = await setUp({ ...settings, counts_per_revolution: 1440 });
    expect(result).toEqual(wiringOf(wired));
    expect(person.asked).toEqual(["raised", "first", "second", "save"]);
    most = Math.max(most, person.mostTurns);
    // A reset loses what was not saved.
    world.simulator.set("reset", ResetReason.POWER_ON);
    world.run(2_000_000);
    expect(await parameters(world)).toMatchObject({ ...wiringOf(wired), reversal_duty: expect.closeTo(0.3) as number });
  }
  expect(most).toBeLessThan(MOST_TURNS);
});

/** Robots that no parameter mends, and how what is said of them begins. */
const DEFECTIVE: readonly (readonly [settings: Settings, said: string])[] = [
  [{ "left.encoder_dead": 1 }, "left motor without encoder"],
  [{ "right.encoder_dead": 1, motors_swapped: 1 }, "right motor without encoder"],
  [{ "left.motor_open": 1 }, "left encoder without motor"],
  [{ "right.motor_open": 1, encoders_swapped: 1 }, "right encoder without motor"],
  [{ "left.stuck_channel": 1 }, "left encoder has one dead channel"],
  [{ "right.stuck_channel": 2 }, "right encoder has one dead channel"],
  [{ encoders_same: 1 }, "both encoders on one wheel"],
  [{ channels_mixed: 1 }, "A of one encoder with B of the other"],
  [{ supply_v: 0 }, "no motor supply"],
  [{ supply_v: 0, battery_v: 0.5 }, "no motor supply"],
  [{ estop_open: 1 }, "e-stop contact open"],
  [{ wheels_free: 0 }, "wheels on the floor"],
  [{ "left.blocked": 1 }, "left wheel blocked"],
];

test.each(DEFECTIVE)("%o is named", async (settings, said) => {
  const { result, world } = await setUp(settings);
  expect(messageOf(result).slice(0, said.length + 1)).toBe(`${said}:`);
  await leftAsItWas(world);
});

/** It stands, and its parameters are those of before. */
async function leftAsItWas(world: World): Promise<void> {
  world.run(3_000_000);
  expect(world.simulator.get("drive_on")).toBe(0);
  expect(await parameters(world)).toEqual({
    ...wiringOf([]),
    reversal_duty: expect.closeTo(0.3) as number,
    rolling_velocity_mps: expect.closeTo(0.25) as number,
  });
}

test("what is not to be saved is not", async () => {
  const { result, world, person } = await setUp({ motors_swapped: 1 }, { save: "no" });
  expect(result).toBeUndefined();
  expect(person.said).toContain("found: motors_swapped");
  await leftAsItWas(world);
});

test("an encoder that fails before both wheels turn is noticed, and nothing is saved", async () => {
  const { result, world } = await setUp({}, {}, (world, person) => {
    if (person.asked.includes("second")) world.simulator.set("left.encoder_dead", 1);
  });
  expect(messageOf(result)).toContain("wiring not confirmed: driven forward with the corrections, the left wheel counted ");
  await leftAsItWas(world);
});

test("a low battery is said, and the wiring found all the same", async () => {
  const { result, person } = await setUp({ supply_v: 2.2, battery_v: 2.2, motors_swapped: 1 });
  expect(result).toEqual(wiringOf([1]));
  expect(person.said[0]).toContain("battery low: it measures 2.2 V, and nominal_supply_v is 7.4: ");
});

test("a pulse is repeated three times, then an answer is due", async () => {
  const { person } = await setUp({}, { first: "again" });
  expect(person.asked.filter((key) => key === "first")).toHaveLength(4);
});

describe("in the middle of the first pulse", () => {
  /** Do something once when the wheel is driven. */
  function once(act: (world: World) => void): (world: World) => void {
    let isDone = false;
    return (world) => {
      if (isDone || world.simulator.get("drive_on") === 0) return;
      isDone = true;
      act(world);
    };
  }

  test("the e-stop ends it", async () => {
    const { result, world, person } = await setUp({}, {}, once((world) => {
      world.program.estop(world.nowUs);
    }));
    expect(messageOf(result)).toContain("the e-stop was pressed; begin again when the robot may move");
    expect(person.asked).toEqual(["raised"]);
    await leftAsItWas(world);
  });

  test("whoever cancels ends it, also while a question waits for its answer", async () => {
    for (const isAsked of [false, true]) {
      const { result, world } = await setUp({}, isAsked ? { first: "" } : {}, (world, person) => {
        const isDue = isAsked ? person.asked.includes("first") : world.simulator.get("drive_on") === 1;
        if (isDue) (world.program.observer as SetupRobot).fail(new SetupFailed("cancelled"));
      });
      expect(messageOf(result)).toBe("cancelled");
      await leftAsItWas(world);
    }
  });

  test("a reset of the board ends it, by name", async () => {
    const { result, world } = await setUp({}, {}, once((world) => {
      world.simulator.set("reset", ResetReason.BROWNOUT);
    }));
    expect(messageOf(result)).toContain("the board was reset while the wheels turned");
    await leftAsItWas(world);
  });

  test("a cable that is pulled for a while ends it", async () => {
    let untilUs = 0;
    const { result, world } = await setUp({}, {}, (world) => {
      if (untilUs === 0 && world.simulator.get("drive_on") === 1) {
        untilUs = world.nowUs + 2_500_000;
        world.cable.pulled = true;
      }
      if (world.nowUs === untilUs) world.cable.pulled = false;
    });
    expect(messageOf(result)).toContain("the link was lost for a while: check the cable, then begin again");
    await leftAsItWas(world);
  });

  test("a cable that stays out ends it, and the robot has its values back by itself", async () => {
    const { result, world } = await setUp({}, {}, once((world) => {
      world.cable.pulled = true;
    }));
    expect(messageOf(result)).toBe("the device fell silent; saying hello until it answers");
    world.run(3_000_000);
    world.cable.pulled = false;
    await leftAsItWas(world);
  });
});
