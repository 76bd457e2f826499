// What becomes of a robot that is broken, in virtual time: as each button says beforehand.
import { describe, expect, test } from "vitest";
import { BREAKS, type Break } from "../src/breaks.js";
import { Decoder, Encoder } from "../src/framing.js";
import { SupervisorState, type Messages } from "../src/generated/protocol.js";
import { Observation } from "../src/observation.js";
import type { Simulator } from "../src/simulator.js";
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

/** A robot that renews its newest setpoint by itself, as a core would that ignores the ttl. */
class IgnoresTtl implements Simulator {
  readonly #decoder = new Decoder();
  readonly #encoder = new Encoder();
  #newest: Messages["SetWheelVelocity"] | undefined;

  constructor(readonly simulator: Simulator) {}

  get nowUs(): number {
    return this.simulator.nowUs;
  }

  advance(us: number): void {
    const newest = this.#newest;
    const nowUs = this.simulator.get("device_us");
    if (newest !== undefined && Number(newest.expiry_us) < nowUs + 50_000) {
      newest.command_seq++;
      newest.expiry_us = BigInt(Math.round(nowUs) + 300_000);
      this.simulator.write(this.#encoder.encode("SetWheelVelocity", newest));
    }
    this.simulator.advance(us);
  }

  write(bytes: Uint8Array): void {
    for (const { name, fields } of this.#decoder.feed(bytes)) {
      if (name === "SetWheelVelocity") this.#newest = { ...fields };
      else if (name === "Stop") this.#newest = undefined;
    }
    this.simulator.write(bytes);
  }

  read(): Uint8Array {
    return this.simulator.read();
  }

  set(name: string, value: number): void {
    this.simulator.set(name, value);
  }

  get(name: string): number {
    return this.simulator.get(name);
  }
}

test.each(["hang the program", "pull the cable"])(
  "a robot that ignores the ttl is noticed by: %s",
  async (name) => {
    const one = BREAKS.find((each) => each.name === name);
    if (one === undefined) throw new Error("there is none");
    const world = await driving(1, (simulator) => new IgnoresTtl(simulator));
    const seen = broken(world, one);
    expect(one.isMet(seen), seen.text).toBe(false);
    expect(world.state).toBe(DRIVING);
  },
);

test("a button that is pressed at rest waits until the robot drives", async () => {
  const world = await opened();
  const [hang] = BREAKS;
  if (hang === undefined) throw new Error("there is none");
  const seen = broken(world, hang);
  expect(seen.droveFromUs).toBeUndefined();
  expect(hang.isMet(seen)).toBe(false);
});
