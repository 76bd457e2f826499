// Each button in the page itself: what it should do, it does, and a second press repairs it. The run
// is the same step by step in a native program.
import { BREAKS } from "../../src/breaks.js";
import { difference, replay } from "../replay.js";
import { expect, test } from "./page.js";

const NEEDS_CLEAR = /^(?:ESTOPPED|FAULT)/;

for (const one of BREAKS) {
  test(one.name, async ({ robot, page }) => {
    await robot.open("?record&seed=3");
    await robot.drive();
    const button = robot.button(one.name);
    await button.click();
    await expect(button).toHaveAttribute("aria-pressed", "true");
    const outcome = page.locator("li", { has: button }).locator(".outcome");
    await expect(outcome).toContainText(/^As it should: /, { timeout: 25_000 });
    await expect(page.getByRole("log")).toContainText(`${one.name}: `);
    await button.click();
    await expect(button).toHaveAttribute("aria-pressed", "false");
    await page.waitForFunction(() => globalThis.wheelwire?.world.program.session.phase === "OPEN");
    if (NEEDS_CLEAR.test(await robot.status.innerText())) {
      await page.waitForFunction(() => globalThis.wheelwire?.world.simulator.get("stands_still") === 1);
      await robot.button("clear").click();
      await expect(robot.status).toHaveText(/^IDLE/);
    }
    await robot.button("figure eight").click();
    await expect(robot.status).toHaveText(/^DRIVING/);
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
  const why = "The program stood still: nothing of it ran, not even its link.";
  await expect(page.locator("#why")).toContainText(why);
  const words = /drive removed \d\.\d ms after the deadline, standstill after 0\.\d\d s, \d+ mm/;
  await expect(page.locator("#stopped")).toHaveText(words);
});
