// What becomes of a robot that is broken, in virtual time: as each button says beforehand.
import { describe, expect, test } from "vitest";
import { BREAKS, type Break } from "../src/breaks.js";
import { SupervisorState } from "../src/generated/protocol.js";
import { Observation } from "../src/observation.js";
import type { World } from "../src/world.js";
import { driving, opened } from "./world.js";

const { DRIVING, ESTOPPED, FAULT, IDLE } = SupervisorState;

/** Break it, and watch as the page does. */
function broken(world: World, one: Break): Observation {
  const seen = new Observation(world);
  const look = (): void => {
    one.tick?.(world, seen.elapsedUs);
    seen.look();
  };
  world.watchers.add(look);
  one.apply(world);
  for (let us = 0; us < one.watchUs && !seen.isSettled; us += 1000) world.run(1000);
  world.watchers.delete(look);
  return seen;
}

describe.each(BREAKS)("$name", (one) => {
  test("does what it should, and can be repaired", async () => {
    const world = await driving();
    const seen = broken(world, one);
    expect(one.isMet(seen), seen.text).toBe(true);
    one.repair(world);
    world.run(3_000_000);
    if (world.state === ESTOPPED || world.state === FAULT) {
      world.program.clear(world.nowUs);
      world.run(100_000);
      expect(world.state).toBe(IDLE);
    }
    const fromM = world.simulator.get("true.distance_m");
    world.program.stop(world.nowUs);
    world.program.drive({ mps: 0.2, radps: 0 });
    world.run(1_000_000);
    expect(world.state).toBe(DRIVING);
    expect(world.simulator.get("true.distance_m") - fromM).toBeGreaterThan(0.1);
  });

  test("nothing drives by itself after the repair", async () => {
    const world = await driving();
    const seen = broken(world, one);
    const wasDriving = world.state === DRIVING;
    one.repair(world);
    let drives = 0;
    world.watchers.add(() => {
      if (seen.stop !== undefined) drives += world.simulator.get("drive_on");
    });
    world.run(3_000_000);
    expect(drives).toBe(0);
    expect(wasDriving || world.state !== DRIVING).toBe(true);
  });
});

test("a button that is pressed at rest waits until the robot drives", async () => {
  const world = await opened();
  const [hang] = BREAKS;
  if (hang === undefined) throw new Error("there is none");
  const seen = broken(world, hang);
  expect(seen.droveFromUs).toBeUndefined();
  expect(hang.isMet(seen)).toBe(false);
});
