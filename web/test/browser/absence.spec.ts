// A tab that comes back after it was frozen or killed, or its computer asleep: nothing moves late.
import { expect, planted, serve, test } from "./page.js";
import { Tab, pause } from "./tabs.js";

const BROWSERS = 2;
const EVENTS = 200;

/** What the page counts for the test. */
interface Watch {
  /** From now on an absence counts. */
  armed: boolean;
  absent: boolean;
  /** The picture with which it came back. */
  wokeFrame: number;
  /** Slices of time in which the robot drove although nothing that is valid asks for it. */
  late: number;
}
declare global {
  var watch: Watch | undefined;
}

/** Count in the page what comes late: behind the setpoint's end, or once the page is back. */
function install(): void {
  const [TTL_US, GRACE_US, ABSENCE_MS] = [300_000, 5000, 320];
  const tools = globalThis.wheelwire;
  if (tools === undefined) throw new Error("there is no robot");
  const { world } = tools;
  const watch: Watch = { armed: false, absent: false, wokeFrame: 0, late: 0 };
  globalThis.watch = watch;
  let [frame, frameMs, sliceUs, limitUs] = [tools.frames, tools.drawnMs, world.nowUs, 0];
  world.watchers.add(() => {
    if (tools.frames !== frame) {
      // By when the page looked at its clock: two short halts on a busy computer are no absence.
      const nowMs = tools.drawnMs;
      if (watch.armed && !watch.absent && nowMs > frameMs + ABSENCE_MS) {
        watch.absent = true;
        watch.wokeFrame = tools.frames;
        limitUs = sliceUs + TTL_US + GRACE_US;
      }
      [frame, frameMs] = [tools.frames, nowMs];
    }
    sliceUs = world.nowUs;
    // The missed time is lived through within the first picture; within the second one, if the page
    // was halted when it had just looked at its clock.
    const isLate = watch.absent && (world.nowUs > limitUs || frame > watch.wokeFrame + 1);
    if (isLate && world.simulator.get("drive_on") !== 0) watch.late++;
  });
}

/** Press `figure eight` until the robot drives: a slow computer may have missed it. */
async function drive(tab: Tab): Promise<void> {
  for (let driven = false; !driven; ) {
    await tab.evaluate(() => {
      if (globalThis.watch !== undefined) globalThis.watch.armed = globalThis.watch.absent = false;
      document.getElementById("eight")?.click();
    });
    await pause(60);
    driven = await tab.evaluate(() => globalThis.wheelwire?.world.simulator.get("drive_on") === 1);
  }
}

type Way = "freeze" | "suspend" | "kill";
/** One of ten, at the end: a browser that has lost a tab's process does not always halt the next one. */
const KILLS = 0.1;

/** Whether the robot moved after the tab was away: frozen, or halted as by its computer's sleep. */
async function isLateAfter(tab: Tab, way: "freeze" | "suspend", ms: number): Promise<boolean> {
  await tab.evaluate(() => {
    if (globalThis.watch !== undefined) Object.assign(globalThis.watch, { armed: true, late: 0 });
  });
  await tab[way](ms);
  await tab.until(() => {
    const watch = globalThis.watch;
    return watch?.absent === true && (globalThis.wheelwire?.frames ?? 0) > watch.wokeFrame + 3;
  });
  return (await tab.evaluate(() => globalThis.watch?.late)) !== 0;
}

/** Whether the robot of a tab that was killed has moved, or is asked to, once its program is there again. */
async function isLateAfterKill(tab: Tab): Promise<boolean> {
  await tab.kill();
  await start(tab);
  return tab.evaluate(() => {
    const { simulator, program } = globalThis.wheelwire?.world ?? {};
    return program?.isDriving !== false || simulator?.get("true.distance_m") !== 0;
  });
}

/** Wait until the page drives nothing, but could. */
async function start(tab: Tab): Promise<void> {
  await tab.until(() => {
    const { world, frames } = globalThis.wheelwire ?? {};
    return world?.program.session.phase === "OPEN" && (frames ?? 0) > 10;
  });
  await tab.evaluate(install);
}

/** How many of `events` absences had a late motion. */
async function lateMotions(url: string, events: number, only?: Way): Promise<number> {
  const tab = await Tab.open(url);
  await start(tab);
  let late = 0;
  for (let event = 0; event < events; event++) {
    await drive(tab);
    const way = only ?? (event >= events * (1 - KILLS) ? "kill" : event % 2 === 0 ? "freeze" : "suspend");
    const isLate = way === "kill" ? isLateAfterKill(tab) : isLateAfter(tab, way, 340 + ((event * 37) % 60));
    late += Number(await isLate);
  }
  await tab.close();
  return late;
}

test(`${EVENTS} absences, no late motion`, async ({ url }) => {
  test.setTimeout(600_000);
  const each = Array.from({ length: BROWSERS }, () => lateMotions(url, EVENTS / BROWSERS));
  const late = (await Promise.all(each)).reduce((total, one) => total + one, 0);
  console.log(`${EVENTS} absences, ${late} with a late motion`);
  expect(late).toBe(0);
});

const PLANTS: readonly { what: string; file: string; from: string; to: string; way: Way }[] = [
  {
    way: "suspend",
    what: "a host that sends its old setpoint again on waking",
    file: "program.ts",
    from: "wake(nowUs: number): void {",
    to: `wake(nowUs: number): void {
      const { leftMps, rightMps } = this.#commanded;
      if (this.session.phase === "OPEN") this.session.drive(leftMps, rightMps, nowUs + TTL_US, nowUs);
      if (nowUs > 0) return;`,
  },
  {
    way: "suspend",
    what: "a page that goes on where it was",
    file: "page.ts",
    from: "if (elapsedUs > ABSENCE_US) {",
    to: "if (elapsedUs > ABSENCE_US) { world.run(16_000); } else if (elapsedUs < 0) {",
  },
  {
    way: "kill",
    what: "a page that remembers across its death that it drove",
    file: "page.ts",
    from: "const clock = new PageClock();",
    to: `const drove = sessionStorage.getItem("drove") !== null;
      sessionStorage.setItem("drove", "yes");
      const { program } = world;
      world.watchers.add(() => {
        if (drove && program.session.phase === "OPEN" && !program.isDriving) program.figureEight(world.nowUs);
      });
      const clock = new PageClock();`,
  },
];

for (const { what, file, from, to, way } of PLANTS) {
  test(`${what} is noticed`, async () => {
    const { url, close } = await serve(await planted(file, from, to));
    expect(await lateMotions(url, 8, way)).toBeGreaterThan(0);
    close();
  });
}
