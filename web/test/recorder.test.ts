// The same seed and the same calls give the same run, and the record says which calls.
import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { Recorder } from "../src/recorder.js";
import { loadSimulator } from "../src/simulator.js";
import { World } from "../src/world.js";

const WASM = new URL("../../build/web/robot.wasm", import.meta.url);

async function run(seed: number): Promise<readonly string[]> {
  const recorder = new Recorder(await loadSimulator(readFileSync(WASM), seed), seed);
  const world = new World(recorder, seed, () => undefined);
  world.run(400_000);
  world.cable.corruption = 0.01;
  world.program.figureEight(world.nowUs);
  world.run(1_500_000);
  recorder.set("estop_open", 1);
  world.run(500_000);
  return recorder.lines;
}

test("a seed repeats its run, and another one does not", async () => {
  const [first, again, other] = [await run(3), await run(3), await run(4)];
  expect(again).toEqual(first);
  expect(other).not.toEqual(first);
  expect(first.filter((line) => line.includes('"set"'))).toHaveLength(1);
});
