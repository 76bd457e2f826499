// A tab that comes back after it was frozen, or its computer asleep: nothing moves late.
import { build, type Plugin } from "esbuild";
import { readFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { expect, serve, test, type Planted } from "./page.js";
import { TabBrowser, pause, type Tab } from "./tabs.js";

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

type Way = "freeze" | "suspend";

/** How many of `events` absences had a late motion. */
async function lateMotions(
  url: string,
  events: number,
  ways: readonly Way[] = ["freeze", "suspend"],
): Promise<number> {
  const browser = await TabBrowser.start();
  const tab = await browser.tab(url);
  await tab.until(() => globalThis.wheelwire?.world.program.session.phase === "OPEN");
  await tab.evaluate(install);
  let late = 0;
  for (let event = 0; event < events; event++) {
    await drive(tab);
    await tab.evaluate(() => {
      if (globalThis.watch !== undefined) Object.assign(globalThis.watch, { armed: true, late: 0 });
    });
    const ms = 340 + ((event * 37) % 60);
    if (ways[event % ways.length] === "freeze") await tab.freeze(ms);
    else await tab.suspend(ms);
    await tab.until(() => {
      const watch = globalThis.watch;
      return watch?.absent === true && (globalThis.wheelwire?.frames ?? 0) > watch.wokeFrame + 3;
    });
    late += Number((await tab.evaluate(() => globalThis.watch?.late)) !== 0);
  }
  await browser.stop();
  return late;
}

/** The page's code with a fault in one of its files. */
async function planted(file: string, from: string, to: string): Promise<Planted> {
  const plant: Plugin = {
    name: "plant",
    setup(builder) {
      builder.onLoad({ filter: new RegExp(`/src/${file}$`) }, async ({ path }) => {
        const text = await readFile(path, "utf8");
        if (!text.includes(from)) throw new Error(`${file} has no ${from}`);
        return { contents: text.replace(from, to), loader: "ts" };
      });
    },
  };
  const { outputFiles } = await build({
    entryPoints: [fileURLToPath(new URL("../../src/page.ts", import.meta.url))],
    bundle: true,
    format: "esm",
    write: false,
    plugins: [plant],
  });
  return { "page.js": outputFiles[0]?.text ?? "" };
}

test(`${EVENTS} absences, no late motion`, async ({ url }) => {
  test.setTimeout(150_000);
  const each = Array.from({ length: BROWSERS }, () => lateMotions(url, EVENTS / BROWSERS));
  const late = (await Promise.all(each)).reduce((total, one) => total + one, 0);
  console.log(`${EVENTS} absences, ${late} with a late motion`);
  expect(late).toBe(0);
});

const PLANTS = [
  {
    what: "a host that sends its old setpoint again on waking",
    file: "program.ts",
    from: "wake(nowUs: number): void {",
    to: `wake(nowUs: number): void {
      const { leftMps, rightMps } = this.#commanded;
      this.session.drive(leftMps, rightMps, nowUs + TTL_US, nowUs);
      if (nowUs > 0) return;`,
  },
  {
    what: "a page that goes on where it was",
    file: "page.ts",
    from: "if (elapsedUs > ABSENCE_US) {",
    to: "if (elapsedUs > ABSENCE_US) { world.run(16_000); } else if (elapsedUs < 0) {",
  },
];

for (const { what, file, from, to } of PLANTS) {
  test(`${what} is noticed`, async () => {
    const { url, close } = await serve(await planted(file, from, to));
    expect(await lateMotions(url, 8, ["suspend"])).toBeGreaterThan(0);
    close();
  });
}
