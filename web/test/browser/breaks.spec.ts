// Each button in the page itself: what it should do, it does, and a second press repairs it. The run
// is the same step by step in the simulator of a computer.
import { BREAKS } from "../../src/breaks.js";
import { difference, replay } from "../replay.js";
import { IGNORES_TTL, wasmWith } from "../wasm.js";
import { RobotPage, expect, serve, test } from "./page.js";

/** By then the program has noticed that the robot was away. */
const SILENCE_MS = 2500;
const NEEDS_CLEAR = /^(?:ESTOPPED|FAULT)/;

for (const one of BREAKS) {
  test(one.name, async ({ robot, page }) => {
    await robot.open("?record&seed=3");
    await robot.drive();
    const button = robot.button(one.name);
    await button.click();
    await expect(button).toHaveAttribute("aria-pressed", "true");
    const outcome = page.locator("li", { has: button }).locator(".outcome");
    await robot.pass(async () => /^(?:Not a|A)s it should: /.test(await outcome.innerText()));
    await expect(outcome).toContainText(/^As it should: /);
    await expect(page.getByRole("log")).toContainText(`${one.name}: `);
    await button.click();
    await expect(button).toHaveAttribute("aria-pressed", "false");
    await page.clock.runFor(SILENCE_MS);
    await robot.opens();
    if (NEEDS_CLEAR.test(await robot.status.innerText())) {
      await robot.pass(async () => (await robot.get("stands_still")) === 1);
      await robot.button("clear").click();
      await robot.shows(/^IDLE/);
    }
    await robot.shows(/^[A-Z_]+$/); // nothing holds it any more
    await robot.button("figure eight").click();
    await robot.shows("DRIVING");
    const calls = await page.evaluate(() => globalThis.wheelwire?.calls() ?? []);
    expect(calls.length).toBeGreaterThan(1000);
    expect(difference(calls, replay(calls))).toBeUndefined();
  });
}

test("the banner says why, in ms and mm", async ({ robot, page }) => {
  await robot.open();
  await robot.drive();
  await robot.button("hang the program").click();
  await robot.shows("TIMED_OUT");
  const why = "The program was frozen: not even its link ran.";
  await expect(page.locator("#why")).toContainText(why);
  const words = /drive removed \d\.\d ms after the deadline, standstill after 0\.\d\d s, \d+ mm/;
  await robot.pass(async () => words.test(await page.locator("#stopped").innerText()));
  await robot.button("hang the program").click();
  await robot.shows("IDLE");
  await expect(page.locator("#why")).toContainText(why); // still known, now that it is repaired
});

test("a robot that a bumper holds is not shown as one that drives", async ({ robot, page }) => {
  await robot.open();
  await robot.drive();
  const edge = (): Promise<string> =>
    page.locator("#banner").evaluate((banner) => getComputedStyle(banner).borderLeftColor);
  const driving = await edge();
  const bumper = robot.button("press the front bumper");
  await bumper.click();
  await robot.shows(/^DRIVING, held by /);
  expect(await edge()).not.toBe(driving);
  await bumper.click();
  await robot.shows("TIMED_OUT");
  // The bumper removed the drive, long before the deadline of the setpoints.
  await expect(page.locator("#stopped")).not.toContainText("after the deadline");
  await robot.button("figure eight").click();
  await robot.shows("DRIVING");
  expect(await edge()).toBe(driving);
});

test("a core that ignores the ttl is noticed: it drives on, and the page says so", async ({ page }) => {
  const { url, close } = await serve({ "robot.wasm": await wasmWith(IGNORES_TTL) });
  const robot = new RobotPage(page, url);
  await robot.open();
  await robot.drive();
  const button = robot.button("hang the program");
  await button.click();
  const outcome = page.locator("li", { has: button }).locator(".outcome");
  await robot.pass(async () => /^Not as it should: /.test(await outcome.innerText()));
  close();
});
