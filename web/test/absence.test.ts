// A page that did not run for a while: nothing moves late, whatever it did before.
import { expect, test, vi } from "vitest";
import { clockStepUs } from "../src/absence.js";
import { TTL_US } from "../src/program.js";
import { Random } from "../src/random.js";
import type { World } from "../src/world.js";
import { opened } from "./world.js";

const EVENTS = 200;
/** After this a drive is late: the newest setpoint has expired, or the stop has arrived. */
const GRACE_US = 5000;

/** Let the page be away at random moments; how many times the robot drove late. */
async function lateMotions(wake: (world: World, us: number) => void): Promise<number> {
  const random = new Random(7);
  const world = await opened();
  let late = 0;
  for (let event = 0; event < EVENTS; event++) {
    world.program.drive({ mps: 0.3 * random.unit(), radps: 2 * random.unit() - 1 });
    world.run(50_000 + Math.floor(random.unit() * 200_000));
    const awayUs = Math.floor(random.unit() * 900_000) + 251_000;
    let isLate = false;
    const watch = (limitUs: number) => () => {
      isLate ||= world.nowUs > limitUs && world.simulator.get("drive_on") !== 0;
    };
    const away = watch(world.nowUs + TTL_US + GRACE_US);
    world.watchers.add(away);
    wake(world, awayUs);
    world.watchers.delete(away);
    const back = watch(world.nowUs + GRACE_US);
    world.watchers.add(back);
    world.run(400_000);
    world.watchers.delete(back);
    late += Number(isLate);
  }
  return late;
}

test(`${EVENTS} absences, no late motion`, async () => {
  expect(await lateMotions((world, us) => { world.wake(us); })).toBe(0);
});

test("a host that sends its old setpoint again on waking is noticed", async () => {
  const late = await lateMotions((world, us) => {
    const { leftMps, rightMps } = world.program.commanded(world.nowUs);
    world.wake(us);
    // Behind the stop, as if nothing had happened.
    world.program.session.drive(leftMps, rightMps, world.nowUs + TTL_US, world.nowUs);
  });
  expect(late).toBe(EVENTS);
});

test("a page that lets no time pass for the robot is noticed", async () => {
  const late = await lateMotions((world) => {
    world.run(400_000); // goes on as if it had never been away
  });
  expect(late).toBeGreaterThan(EVENTS / 2);
});

test("what the robot sent meanwhile is read, and the link goes on", async () => {
  const world = await opened();
  world.wake(1_000_000);
  world.run(10_000);
  expect(world.program.session.count).toBe(1);
  expect(world.program.sample?.tUs).toBeGreaterThan(world.simulator.get("device_us") - 20_000);
  world.wake(5_000_000);
  world.run(500_000);
  expect(world.program.session.phase).toBe("OPEN");
});

test("a page that was held up while it looked at its clock knows the clock's step all the same", () => {
  let [reads, heldMs] = [0, 0];
  const clock = vi.spyOn(performance, "now").mockImplementation(() => {
    if (++reads === 15) heldMs = 440;
    return Math.floor(reads * 0.2) / 10 + heldMs;
  });
  expect(clockStepUs()).toBe(100);
  clock.mockRestore();
});
