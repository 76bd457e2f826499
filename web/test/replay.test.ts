// The robot in the page is the robot of a computer: ticks, states and bytes, step by step.
import { gzipSync } from "node:zlib";
import { describe, expect, test } from "vitest";
import { BREAKS, type Break } from "../src/breaks.js";
import { ResetReason, SupervisorState } from "../src/generated/protocol.js";
import { Observation } from "../src/observation.js";
import { Recorder } from "../src/recorder.js";
import { loadSimulator, type Simulator } from "../src/simulator.js";
import { World } from "../src/world.js";
import { difference, replay } from "./replay.js";
import { WASM } from "./wasm.js";

const BUDGET = 400_000;
const SHARE_OF_A_CORE = 0.05;

type Fault = Pick<Break, "name" | "apply" | "tick" | "repair">;

/** What no button does: the power fails in the middle of a write, not between two steps. */
const CUTS: readonly Fault[] = [1, 2].map((write) => ({
  name: `cut the power in write ${write} of a save`,
  apply: (world) => {
    world.simulator.set("power_cut_at_write", write);
    world.program.save(world.nowUs);
  },
  repair: (world) => {
    expect(world.simulator.get("power_cut_at_write")).toBe(0);
    expect(world.simulator.get("reset")).toBe(ResetReason.POWER_ON);
  },
}));

/** Drive a figure eight, break it, repair it, drive on; what was recorded. */
async function record(one: Fault, seed: number): Promise<readonly string[]> {
  const recorder = new Recorder(await loadSimulator(WASM, seed), seed);
  const world = new World(recorder, seed, () => undefined);
  world.run(400_000);
  world.program.figureEight(world.nowUs);
  world.run(1_500_000);
  expect(world.state).toBe(SupervisorState.DRIVING);
  const seen = new Observation(world);
  const tick = (): void => {
    one.tick?.(world, seen.elapsedUs);
  };
  world.watchers.add(tick);
  one.apply(world);
  world.run(3_500_000);
  world.watchers.delete(tick);
  one.repair(world);
  world.run(1_000_000);
  world.program.clear(world.nowUs);
  world.program.figureEight(world.nowUs);
  world.run(1_000_000);
  return recorder.lines;
}

describe.each([...BREAKS, ...CUTS].map((one, number) => ({ name: one.name, one, seed: number + 1 })))(
  "$name",
  ({ one, seed }) => {
    test("is the same step by step in the simulator of a computer", async () => {
      const page = await record(one, seed);
      expect(page.filter((line) => line.includes('"read"')).length).toBeGreaterThan(7000);
      expect(difference(page, replay(page))).toBeUndefined();
    });
  },
);

test("a wheel that drags by a hair in one of them is found", async () => {
  const [one] = BREAKS;
  if (one === undefined) throw new Error("there is none");
  const page = await record(one, 1);
  const drag = '{"t":900000,"call":"set","name":"left.load_nm","value":0.0001}';
  const at = page.findIndex((line) => line.startsWith('{"t":900000,'));
  const native = replay([...page.slice(0, at), drag, ...page.slice(at)]);
  expect(native.splice(at, 1)).toEqual([drag]);
  const found = difference(page, native);
  expect(found?.line).toBeGreaterThan(at);
  expect(found?.page).toContain('"call":"read"');
});

/** The robot before it hears from a program: it says its hello by itself. */
async function booted(seed: number): Promise<Simulator> {
  const simulator = await loadSimulator(WASM, seed);
  simulator.advance(200_000);
  return simulator;
}

test("a reset is a new start, and its reason can be read", async () => {
  const simulator = await booted(1);
  const before = simulator.get("boot_id");
  simulator.set("reset", ResetReason.PANIC);
  expect(simulator.get("reset")).toBe(ResetReason.PANIC);
  expect(simulator.get("boot_id")).not.toBe(before);
  expect(simulator.get("state")).toBe(SupervisorState.BOOT);
  simulator.advance(60_000);
  expect(simulator.get("state")).toBe(SupervisorState.IDLE);
});

test("what the simulator refuses throws", async () => {
  const simulator = await booted(1);
  expect(() => {
    simulator.set("no_such", 1);
  }).toThrow("no_such = 1: there is no such variable");
  expect(() => simulator.get("no_such")).toThrow(RangeError);
  expect(() => {
    simulator.set("state", 1);
  }).toThrow("state = 1: it is read-only");
  expect(() => {
    simulator.set("slope_rad", 2);
  }).toThrow("slope_rad = 2: out of range");
  expect(() => {
    simulator.advance(-1);
  }).toThrow("advance by -1 us: not allowed");
});

test("a seed repeats its run, and another one does not", async () => {
  const noise: Fault = {
    name: "noise",
    apply: (world) => { world.cable.corruption = 0.01; },
    repair: (world) => { world.cable.corruption = 0; },
  };
  const [first, again, other] = [await record(noise, 3), await record(noise, 3), await record(noise, 4)];
  expect(again).toEqual(first);
  expect(other).not.toEqual(first);
});

test("the robot is within its budget, and asks little of a system", async () => {
  const size = gzipSync(WASM).length;
  console.log(`the robot: ${size} bytes gzipped`);
  expect(size).toBeLessThanOrEqual(BUDGET);
  const imports = WebAssembly.Module.imports(await WebAssembly.compile(WASM));
  // Of some C++ libraries, for what they say when they fail.
  const ofLibraries = new Set(["fd_close", "fd_seek", "fd_write"]);
  expect(imports.map((one) => one.name).filter((name) => !ofLibraries.has(name))).toEqual([]);
});

test("a second of a driving robot costs little of a second's processor time", async () => {
  const world = new World(await loadSimulator(WASM, 1), 1, () => undefined);
  world.run(400_000);
  world.program.drive({ mps: 0.2, radps: 0.5 });
  world.run(1_000_000);
  const before = process.cpuUsage();
  world.run(10_000_000);
  const { user, system } = process.cpuUsage(before);
  expect(world.state).toBe(SupervisorState.DRIVING);
  const share = (user + system) / 10_000_000;
  console.log(`the robot, its cable and its program: ${(100 * share).toFixed(1)} % of a core`);
  expect(share).toBeLessThan(SHARE_OF_A_CORE);
});
