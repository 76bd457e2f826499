// The robot in the page is the robot of a computer: ticks, states and bytes, step by step.
import { readFileSync } from "node:fs";
import { describe, expect, test } from "vitest";
import { BREAKS, type Break } from "../src/breaks.js";
import { ResetReason, SupervisorState } from "../src/generated/protocol.js";
import { Observation } from "../src/observation.js";
import { Recorder } from "../src/recorder.js";
import { loadSimulator, type Simulator } from "../src/simulator.js";
import { World } from "../src/world.js";
import { difference, replay } from "./replay.js";

const WASM = readFileSync(new URL("../../build/web/robot.wasm", import.meta.url));

/** Drive a figure eight, break it, repair it, drive on; what was recorded. */
async function record(one: Break, seed: number): Promise<readonly string[]> {
  const recorder = new Recorder(await loadSimulator(WASM, seed), seed);
  const world = new World(recorder, seed, () => undefined);
  world.run(400_000);
  world.program.figureEight(world.nowUs);
  world.run(1_500_000);
  expect(world.state).toBe(SupervisorState.DRIVING);
  const seen = new Observation(world);
  const tick = (): void => one.tick?.(world, seen.elapsedUs);
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

describe.each(BREAKS.map((one, number) => ({ name: one.name, one, seed: number + 1 })))(
  "$name",
  ({ one, seed }) => {
    test("is the same step by step in the native program", async () => {
      const page = await record(one, seed);
      expect(page.filter((line) => line.includes('"read"')).length).toBeGreaterThan(7000);
      expect(difference(page, replay(page))).toBeUndefined();
    });
  },
);

test("a step that differs is found", async () => {
  const [one] = BREAKS;
  if (one === undefined) throw new Error("there is none");
  const page = await record(one, 1);
  const late = page.map((line) => line.replace('{"t":900000,"call":"advance","us":1000}', '{"t":900000,"call":"advance","us":1001}'));
  expect(late).not.toEqual(page);
  const found = difference(page, replay(late));
  expect(found?.line).toBe(page.indexOf('{"t":900000,"call":"advance","us":1000}'));
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

test("seeds differ, and one repeats", async () => {
  const ids = [];
  for (const seed of [1, 2, 1]) ids.push((await booted(seed)).get("boot_id"));
  expect(ids[0]).not.toBe(ids[1]);
  expect(ids[0]).toBe(ids[2]);
});
