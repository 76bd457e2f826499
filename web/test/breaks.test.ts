// What becomes of a robot that is broken, in virtual time: as each button says beforehand.
import { describe, expect, test } from "vitest";
import { BREAKS, type Break } from "../src/breaks.js";
import { Held, SupervisorState } from "../src/generated/protocol.js";
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

test("a robot that backs out from its bumper does as it should, and one that drives on does not", async () => {
  const bumper = BREAKS.find((one) => one.name === "press the front bumper");
  if (bumper === undefined) throw new Error("there is none");
  for (const [mps, isMet] of [[-0.2, true], [0.2, false]] as const) {
    const world = await driving();
    const pressed = isMet ? bumper : { ...bumper, apply: () => undefined };
    const watched = { ...pressed, tick: () => { if (!world.program.isDriving) world.program.drive({ mps, radps: 0 }); } };
    world.program.stop(world.nowUs);
    const seen = broken(world, watched);
    if (!isMet) seen.held = Held.BUMPER_FRONT_LEFT | Held.BUMPER_FRONT_RIGHT;
    expect(seen.movedM).toBeGreaterThan(0.2);
    expect(bumper.isMet(seen), seen.text).toBe(isMet);
  }
});

test("a stop ends where the robot is driven again before it stands", async () => {
  const world = await driving();
  world.program.stop(world.nowUs);
  world.run(100_000);
  world.program.drive({ mps: 0.2, radps: 0 });
  world.run(3_000_000);
  expect(world.stopped).toMatch(/^\d+ mm until it was driven again$/);
  world.program.stop(world.nowUs);
  world.run(2_000_000);
  expect(world.stopped).toMatch(/^standstill after/);
});
