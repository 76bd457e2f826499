// The page flashes a board and finds its wiring.
import { createHash } from "node:crypto";
import { FlashableChip } from "../serial/flashable.js";
import { ESP32 } from "../chip.js";
import { mergedImage } from "../image.js";
import { expect, test, text } from "./desk.js";

/** By the browser's list: the port, and its button. */
const CHOOSER_CLICKS = 2;
const MOST_CLICKS = 8;

test("a person's path: an empty board is connected, flashed, confirmed, and turns a wheel", async ({ page, desk: make }) => {
  const content = mergedImage(ESP32);
  const manifest = { version: "0.1.0", images: [{ file: "wheelwire-esp32.bin", sha256: createHash("sha256").update(content).digest("hex") }] };
  const board = new FlashableChip({ board_unwritten: 1, wheels_free: 1, motors_swapped: 1, "left.motor_reversed": 1 });
  const desk = make(board);
  const robot = await desk.open(page, {
    planted: { "firmware/manifest.json": JSON.stringify(manifest), "firmware/wheelwire-esp32.bin": content },
  });
  test.setTimeout(120_000);
  await page.waitForFunction(() => globalThis.wheelwire?.world.program.session.phase === "OPEN");
  let clicks = 0;
  const click = async (name: string): Promise<void> => {
    await robot.button(name).click();
    clicks++;
  };
  const turns = async (): Promise<number> => Math.abs(await board.robot.get("true.right_turns"));
  await click("connect");
  await expect(text(robot)).toContainText("Choose another port.", { timeout: 30_000 });
  await click("flash");
  await expect(page.locator("#flash-text")).toHaveText("flashed: the ESP32 runs the new firmware", { timeout: 45_000 });
  await expect(page.getByRole("log")).toContainText("keeps the data in: nothing");
  expect(Buffer.compare(board.esp.flash.subarray(0x100000, content.length), content.subarray(0x100000))).toBe(0);
  await click("confirm this wiring");
  await expect(robot.status).toHaveText("IDLE", { timeout: 20_000 });
  expect(await turns()).toBe(0);
  await click("find the wiring");
  await click("yes");
  await expect.poll(turns, { timeout: 20_000 }).toBeGreaterThan(0.01);
  clicks += CHOOSER_CLICKS * ((await page.evaluate(() => globalThis.choosers)) ?? 0);
  console.log(`page opened, connected, flashed, wheel turned: ${clicks} clicks`);
  expect(clicks).toBeLessThanOrEqual(MOST_CLICKS);
  await click("right forward");
  await click("backward");
  await click("yes");
  await expect(page.locator("#wire-said")).toContainText("found: motors_swapped, left_motor_inverted");
  await expect(page.locator("#wire-said")).toContainText("Next, on a computer: wheelwire setup");
  await robot.looks("flashed");
  expect(robot.complaints).toEqual([]);
});

const IMAGE = { name: "wheelwire-esp32.bin", mimeType: "application/octet-stream", buffer: Buffer.from(mergedImage(ESP32)) };

test("a file of one's own, to a board that enters its loader only by hand: the picture of BOOT, and on from there", async ({ page, desk: make }) => {
  test.setTimeout(120_000);
  const board = new FlashableChip({}, false);
  const desk = make(board);
  const robot = await desk.open(page);
  const flashText = page.locator("#flash-text");
  const picture = page.getByRole("img", { name: /the button BOOT is beside the socket/ });
  await page.getByText("Firmware of your own").click();
  const file = page.getByLabel("image, as wheelwire-esp32.bin");
  await file.setInputFiles({ ...IMAGE, name: "notes.bin", buffer: Buffer.alloc(100_000) });
  await robot.button("flash").click();
  await expect(flashText).toContainText("notes.bin is not a Wheelwire firmware image");
  expect(desk.socket.received).toBe(0);
  await file.setInputFiles(IMAGE);
  await robot.button("flash").click();
  await expect(picture).toBeVisible({ timeout: 40_000 });
  await expect(robot.button("go on")).toBeFocused();
  await robot.looks("boot");
  expect(board.esp.writes).toBe(0);
  board.enterByHand();
  await robot.button("go on").click();
  await expect(flashText).toHaveText("flashed: the ESP32 runs the new firmware", { timeout: 45_000 });
  await expect(picture).toBeHidden();
  expect(Buffer.compare(board.esp.flash.subarray(0x100000, IMAGE.buffer.length), IMAGE.buffer.subarray(0x100000))).toBe(0);
  await expect(text(robot)).toContainText("Connected to board");
  expect(await page.evaluate(() => globalThis.choosers)).toBe(1);
  expect(robot.complaints).toEqual([]);
});

test("firmware of another schema is flashed and then driven; a hand that is not there changes nothing", async ({ page, desk: make }) => {
  test.setTimeout(120_000);
  const board = new FlashableChip({}, false, { schema_hash: 1 });
  board.esp.flash.set(mergedImage(ESP32, 2, 12_345));
  board.esp.reset(false);
  const desk = make(board);
  const robot = await desk.open(page);
  await robot.button("connect").click();
  await expect(text(robot)).toContainText("flash the board to drive it", { timeout: 20_000 });
  await page.getByText("Firmware of your own").click();
  await page.getByLabel("image, as wheelwire-esp32.bin").setInputFiles(IMAGE);
  await robot.button("flash").click();
  await robot.button("not now").click({ timeout: 40_000 });
  await expect(page.locator("#flash-text")).toHaveText("the board did not enter its boot loader by itself");
  expect(board.esp.writes).toBe(0);
  await expect(text(robot)).toContainText("flash the board to drive it", { timeout: 20_000 });
  await robot.button("flash").click();
  await expect(robot.button("go on")).toBeVisible({ timeout: 40_000 });
  board.enterByHand();
  await robot.button("go on").click();
  await expect(page.locator("#flash-text")).toHaveText("flashed: the ESP32 runs the new firmware", { timeout: 45_000 });
  await expect(robot.status).toHaveText("IDLE");
  await expect(robot.button("enable driving")).toBeEnabled();
});
