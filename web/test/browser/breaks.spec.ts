// Each button in the page itself: what it should do, it does, and a second press repairs it. The run
// is the same step by step in a native program. The page's clock runs as fast as the computer can.
import { BREAKS } from "../../src/breaks.js";
import { difference, replay } from "../replay.js";
import { IGNORES_TTL, wasmWith } from "../wasm.js";
import { RobotPage, expect, serve, test } from "./page.js";

const NEEDS_CLEAR = /^(?:ESTOPPED|FAULT)/;

for (const one of BREAKS) {
  test(one.name, async ({ robot, page }) => {
    await page.clock.install();
    await robot.open("?record&seed=3");
    const shows = (what: RegExp) => async (): Promise<boolean> => what.test(await robot.status.innerText());
    await robot.driveUntil(async () => (await robot.get("true.distance_m")) > 0.1);
    const button = robot.button(one.name);
    await button.click();
    await expect(button).toHaveAttribute("aria-pressed", "true");
    const outcome = page.locator("li", { has: button }).locator(".outcome");
    await robot.pass(async () => /^(?:Not a|A)s it should: /.test(await outcome.innerText()));
    await expect(outcome).toContainText(/^As it should: /);
    await expect(page.getByRole("log")).toContainText(`${one.name}: `);
    await button.click();
    await expect(button).toHaveAttribute("aria-pressed", "false");
    await robot.pass(() => page.evaluate(() => globalThis.wheelwire?.world.program.session.phase === "OPEN"));
    if (await shows(NEEDS_CLEAR)()) {
      await robot.pass(async () => (await robot.get("stands_still")) === 1);
      await robot.button("clear").click();
      await robot.pass(shows(/^IDLE/));
    }
    await robot.driveUntil(shows(/^DRIVING/));
    const calls = await page.evaluate(() => globalThis.wheelwire?.calls() ?? []);
    expect(calls.length).toBeGreaterThan(1000);
    expect(difference(calls, replay(calls))).toBeUndefined();
  });
}

test("the banner says why, in ms and mm", async ({ robot, page }) => {
  await robot.open();
  await robot.drive();
  await robot.button("hang the program").click();
  await expect(robot.status).toHaveText("TIMED_OUT");
  const why = "The program was frozen: not even its link ran.";
  await expect(page.locator("#why")).toContainText(why);
  const words = /drive removed \d\.\d ms after the deadline, standstill after 0\.\d\d s, \d+ mm/;
  await expect(page.locator("#stopped")).toHaveText(words);
});

test("a core that ignores the ttl is noticed: it drives on, and the page says so", async ({ page }) => {
  const { url, close } = await serve({ "robot.wasm": await wasmWith(IGNORES_TTL) });
  const robot = new RobotPage(page, url);
  await page.clock.install();
  await robot.open();
  await robot.button("figure eight").click();
  await robot.pass(async () => (await robot.get("true.distance_m")) > 0.1);
  const button = robot.button("hang the program");
  await button.click();
  const outcome = page.locator("li", { has: button }).locator(".outcome");
  await robot.pass(async () => /^Not as it should: /.test(await outcome.innerText()));
  close();
});
