// What a person finds in the page: at both sizes, light and dark, by keyboard, by touch, offline.
import { readFileSync } from "node:fs";
import { gzipSync } from "node:zlib";
import { BREAKS } from "../../src/breaks.js";
import { SupervisorState } from "../../src/generated/protocol.js";
import { TOUCH, dragStick, expect, test } from "./page.js";

test("at both sizes, light and dark, everything fits, and axe finds nothing serious", async ({ robot, page }) => {
  await robot.open();
  await robot.drive();
  await robot.button("open the e-stop contact").click();
  await robot.shows("ESTOPPED, held by CONTACT, ESTOP");
  await page.clock.resume(); // axe needs time
  await robot.looks("simulated");
});

test("each of the buttons has its name, and says beforehand what should happen", async ({ robot, page }) => {
  await robot.open();
  for (const name of ["figure eight", "e-stop", "clear", "start again"]) {
    await expect(robot.button(name)).toHaveCount(1);
  }
  for (const one of BREAKS) {
    await expect(robot.button(one.name)).toHaveAccessibleDescription(one.should);
    await expect(robot.button(one.name)).toHaveAttribute("aria-pressed", "false");
  }
  expect(await page.locator("#breaks button").count()).toBe(13);
  expect(await page.locator('[role=status], output, [aria-live]').count()).toBe(1);
  expect(await page.locator("[role=log]").count()).toBe(1);
});

test("the status holds the state and the codes, and nothing else in capitals", async ({ robot }) => {
  await robot.open();
  await robot.shows("IDLE");
  await robot.button("e-stop").click();
  await robot.shows("ESTOPPED, held by ESTOP");
  await robot.button("clear").click();
  await robot.shows("IDLE");
  await robot.button("press the front bumper").click();
  await robot.shows("IDLE, held by BUMPER_FRONT_LEFT, BUMPER_FRONT_RIGHT");
});

test("by keyboard alone: drive while an arrow is held, break, repair, clear", async ({ robot, page }) => {
  await robot.open();
  await page.keyboard.down("ArrowUp");
  await robot.shows("DRIVING");
  await robot.pass(async () => (await robot.get("true.x_m")) > 0.1);
  await page.keyboard.up("ArrowUp");
  await robot.shows("IDLE");
  const names: string[] = [];
  for (let press = 0; press < 30; press++) {
    await page.keyboard.press("Tab");
    names.push(await page.evaluate(() => document.activeElement?.textContent ?? ""));
    if (names.at(-1) === "open the e-stop contact") break;
  }
  expect(names).toEqual(expect.arrayContaining(["figure eight", "e-stop", "clear", "start again"]));
  await page.keyboard.press("Space");
  await robot.shows("ESTOPPED, held by CONTACT, ESTOP");
  await page.keyboard.press("Space");
  await robot.button("clear").focus();
  await page.keyboard.press("Enter");
  await robot.shows("IDLE");
});

test("a key that is held through a fault drives no more, until it is pressed anew", async ({ robot, page }) => {
  await robot.open();
  await page.keyboard.down("ArrowUp");
  await robot.shows("DRIVING");
  await robot.button("e-stop").click();
  await robot.button("clear").click();
  await robot.shows("IDLE");
  await page.keyboard.down("ArrowUp"); // the keyboard's repeat
  await page.clock.runFor(1500);
  await expect(robot.status).toHaveText("IDLE");
  await page.keyboard.up("ArrowUp");
  await page.keyboard.down("ArrowUp");
  await robot.shows("DRIVING");
  await page.keyboard.up("ArrowUp");
});

test.describe("with a touch screen", () => {
  test.use(TOUCH);

  test("the stick drives while it is held", async ({ robot, page }) => {
    await robot.open();
    const lift = await dragStick(page);
    await robot.shows("DRIVING");
    await robot.pass(async () => (await robot.get("true.x_m")) > 0.05);
    await lift();
    await robot.shows("IDLE");
  });
});

test("a hidden page sends a stop", async ({ robot, page }) => {
  await robot.open("?record");
  await robot.drive();
  const state = await page.evaluate(() => {
    Object.defineProperty(document, "hidden", { value: true });
    document.dispatchEvent(new Event("visibilitychange"));
    return globalThis.wheelwire?.world.program.isDriving;
  });
  expect(state).toBe(false);
  await robot.shows("IDLE");
  await expect(page.getByRole("log")).toContainText("this page was hidden: it stopped the robot");
});

test("once loaded it needs no network, and a seed repeats a run", async ({ robot, page, context }) => {
  await robot.open("?seed=7");
  await context.setOffline(true);
  const bootIds = new Set([await robot.get("boot_id")]);
  await page.clock.runFor(3000);
  await robot.button("start again").click();
  await expect.poll(() => page.evaluate(() => globalThis.wheelwire?.world.nowUs)).toBeLessThan(2e6);
  bootIds.add(await robot.get("boot_id"));
  expect(bootIds.size).toBe(1);
  await robot.opens();
  await robot.drive();
  expect(await robot.get("state")).toBe(SupervisorState.DRIVING);
});

test("the policy allows WebAssembly, and no inline script", async ({ robot, page }) => {
  await robot.open();
  const policy = await page.locator('meta[http-equiv="Content-Security-Policy"]').getAttribute("content");
  expect(policy).toContain("script-src 'self' 'wasm-unsafe-eval';");
  expect(policy).not.toContain("unsafe-inline");
  const ran = await page.evaluate(() => {
    const script = document.createElement("script");
    script.textContent = "globalThis.inlineRan = true";
    document.body.append(script);
    return "inlineRan" in globalThis;
  });
  expect(ran).toBe(false);
  robot.complaints.length = 0; // the browser's own about that script
});

for (const { what, files, budget } of [
  { what: "the page's code", files: ["index.html", "page.js", "page.css", "icon.svg"], budget: 150_000 },
  { what: "what flashes, loaded when it is needed", files: ["esptool.js", "boot.svg"], budget: 80_000 },
]) {
  test(`${what} is within its budget`, () => {
    const size = files.reduce((total, name) => {
      const path = new URL(`../../../build/web/${name}`, import.meta.url);
      return total + gzipSync(readFileSync(path), { level: 9 }).length;
    }, 0);
    console.log(`${what}: ${size} bytes gzipped`);
    expect(size).toBeLessThanOrEqual(budget);
  });
}

test("what flashes is not loaded before it is needed", async ({ robot }) => {
  await robot.open();
  expect(robot.requests.filter((one) => one.includes("esptool"))).toEqual([]);
});
