// The page drives a robot by Web Serial, with its port, its chip and the tab failing in turn.
import { SupervisorState } from "../../src/generated/protocol.js";
import { TTL_US } from "../../src/program.js";
import { Random } from "../../src/random.js";
import { FAULTS } from "../faults.js";
import { CP210X, NATIVE_USB, SimulatedChip, Talker } from "../serial/bridge.js";
import { connect, drive, expect, isConnected, stands, test, text, timeOut } from "./desk.js";
import { RobotPage, TOUCH, dragStick, planted } from "./page.js";

test("connect, enable driving, drive, disconnect, and again without a question; the chip is never reset", async ({ page, desk: make }) => {
  const desk = make(new SimulatedChip());
  const robot = await desk.open(page);
  await connect(robot);
  await expect(robot.status).toHaveText("IDLE");
  await page.keyboard.down("ArrowUp");
  await expect(page.getByRole("log")).toContainText("nothing moves before you press enable driving");
  await page.keyboard.up("ArrowUp");
  await expect(robot.button("enable driving")).toHaveAccessibleDescription(/Both wheels will turn/);
  await drive(robot, desk);
  await page.keyboard.press("Escape");
  await expect(robot.status).toHaveText("ESTOPPED, held by ESTOP");
  await page.keyboard.up("ArrowUp");
  await robot.button("clear").click();
  await expect(robot.status).toHaveText("IDLE");
  await drive(robot, desk);
  await robot.button("disconnect").click();
  await expect(robot.button("connect")).toBeVisible();
  await stands(desk);
  await connect(robot);
  expect(await page.evaluate(() => globalThis.choosers)).toBe(1);
  // The tab is closed in the middle of a drive.
  await drive(robot, desk);
  expect(robot.complaints).toEqual([]);
  await page.close();
  await stands(desk);
  const lateUs = (await desk.chip.get("drive_removed_us")) - (await desk.chip.get("deadline_us"));
  expect(lateUs).toBeLessThanOrEqual(1000);
  expect(desk.socket.resets).toBe(0);
});

test("signals in the wrong order reset the chip, which is noticed", async ({ page, desk: make }) => {
  const desk = make(new SimulatedChip());
  const wrong = await planted("serial/port.ts", '["requestToSend", "dataTerminalReady"]', '["dataTerminalReady", "requestToSend"]');
  const robot = await desk.open(page, { planted: wrong });
  await connect(robot);
  await robot.button("disconnect").click();
  await expect(robot.button("connect")).toBeVisible();
  expect(desk.socket.resets).toBeGreaterThan(0);
});

test("what is no robot is named, and another port chosen; a port that another tab has is tried again", async ({ page, context, desk: make }) => {
  const lidar = new Talker(Uint8Array.from({ length: 47 }, (_, at) => (0x54 + 57 * at) & 0xff), 115_200);
  const desk = make(lidar, new SimulatedChip({}, CP210X, 460_800));
  const robot = await desk.open(page);
  await robot.button("connect").click();
  await expect(text(robot)).toHaveText(/No robot answers: \d+ bytes came, such as .*a lidar sounds like that\. Choose another port\./, { timeout: 30_000 });
  expect(desk.socket.resets).toBe(0);
  await page.evaluate(() => { globalThis.chosenPort = 1; });
  await robot.button("choose another").click();
  await isConnected(robot);
  const second = await desk.open(await context.newPage());
  await second.page.evaluate(() => { globalThis.chosenPort = 1; });
  await second.button("connect").click();
  await expect(text(second)).toContainText("another tab or program has it");
  await robot.button("disconnect").click();
  await expect(robot.button("connect")).toBeVisible();
  await connect(second);
  await expect(robot.status).toHaveText("IDLE");
});

test("a robot whose answer is late, but whose frames come, is waited for at its rate", async ({ page, desk: make }) => {
  const desk = make(new SimulatedChip());
  const robot = await desk.open(page);
  await connect(robot); // from now on it sends frames, whoever listens
  await robot.button("disconnect").click();
  await expect(robot.button("connect")).toBeVisible();
  desk.socket.toChip = () => new Uint8Array();
  await robot.button("connect").click();
  await page.waitForTimeout(6000); // all rates together take less
  await expect(text(robot)).toHaveText("Looking for the robot: the device has not answered yet.");
  desk.socket.toChip = (bytes) => bytes;
  await isConnected(robot);
});

for (const keepsHandle of [false, true]) {
  const kind = keepsHandle ? "the same handle" : "a new handle";
  test(`a chip that resets its USB comes back by ${kind}, and nothing else is opened`, async ({ page, desk: make }) => {
    const desk = make(new SimulatedChip({}, NATIVE_USB), new SimulatedChip({}, NATIVE_USB));
    const robot = await desk.open(page, { keepsHandle });
    // The page may open its sister as well.
    await page.evaluate(async () => {
      for (const port of [1, 0]) {
        globalThis.chosenPort = port;
        await navigator.serial.requestPort();
      }
    });
    await robot.button("connect").click();
    await isConnected(robot);
    await drive(robot, desk);
    desk.chip.reset();
    desk.socket.plug(false);
    await expect(text(robot)).toContainText("the port is gone");
    desk.socket.plug(true);
    await isConnected(robot);
    await expect(robot.button("enable driving")).toHaveAttribute("aria-pressed", "false");
    expect(await desk.chip.get("drive_on")).toBe(0);
    expect(desk.sockets[1]?.received).toBe(0);
    expect(await page.evaluate(() => globalThis.choosers)).toBe(3);
  });
}

test("another board at the same port is refused by name, and moves only if a person means it", async ({ page, desk: make }) => {
  const [first, second] = [new SimulatedChip(), new SimulatedChip()];
  first.hello = { board_id: 0x11n };
  second.hello = { board_id: 0x22n };
  const desk = make(first, second);
  const robot = await desk.open(page);
  await connect(robot);
  await expect(text(robot)).toContainText("Connected to board 000000000011");
  await drive(robot, desk);
  desk.socket.plug(false);
  desk.socket.insert(second);
  desk.socket.plug(true);
  await expect(text(robot)).toHaveText(
    "board 000000000022 answers at this port, not 000000000011: press connect if you mean it",
    { timeout: 20_000 },
  );
  expect(await second.get("true.distance_m")).toBe(0);
  await page.keyboard.up("ArrowUp");
  await connect(robot);
  await expect(text(robot)).toContainText("Connected to board 000000000022");
  await expect(robot.button("enable driving")).toHaveAttribute("aria-pressed", "false");
});

test("firmware of another schema obeys stop and each e-stop, and the page offers to flash it", async ({ page, desk: make }) => {
  const chip = new SimulatedChip();
  await timeOut(chip);
  const desk = make(chip);
  const other = await planted("generated/protocol.ts", "export const SCHEMA_HASH = 0x", "export const SCHEMA_HASH = 1 + 0x");
  const robot = await desk.open(page, { planted: other });
  await robot.button("connect").click();
  await expect(text(robot)).toContainText("Stop and e-stop work; flash the board to drive it", { timeout: 20_000 });
  await expect(robot.button("flash")).toBeEnabled();
  expect(await chip.get("state")).toBe(SupervisorState.TIMED_OUT);
  await page.keyboard.press("ArrowUp"); // to let it go is a stop
  await expect.poll(() => chip.get("state")).toBe(SupervisorState.IDLE);
  // No session repeats an e-stop that is lost: a person does.
  const { received } = desk.socket;
  desk.socket.toChip = () => new Uint8Array();
  await robot.button("e-stop").click();
  await expect(page.getByRole("log")).toContainText("no session confirms it; press it again");
  await expect.poll(() => desk.socket.received).toBeGreaterThan(received + 100);
  expect(await chip.get("state")).toBe(SupervisorState.IDLE);
  desk.socket.toChip = (bytes) => bytes;
  await page.keyboard.press("Escape");
  await expect.poll(() => chip.get("state")).toBe(SupervisorState.ESTOPPED);
});

for (const way of ["toChip", "toPage"] as const) {
  test(`ten faults of the line, ${way}: it drives on or stops in time, and nothing moves until it is asked again`, async ({ page, desk: make }) => {
    test.setTimeout(150_000);
    const desk = make(new SimulatedChip());
    const robot = await desk.open(page);
    await connect(robot);
    const random = new Random(13);
    expect(FAULTS).toHaveLength(10);
    for (const [what, fault] of FAULTS) {
      await test.step(what, async () => {
        await drive(robot, desk);
        desk.socket[way] = (bytes) => fault(bytes, random);
        await page.waitForTimeout(400);
        await page.keyboard.up("ArrowUp");
        const letGoUs = await desk.chip.get("device_us");
        await stands(desk);
        expect((await desk.chip.get("drive_removed_us")) - letGoUs).toBeLessThanOrEqual(TTL_US + 1000);
        desk.socket[way] = (bytes) => bytes;
        await expect(robot.status).toHaveText("IDLE");
        expect(await desk.chip.get("drive_on")).toBe(0);
      });
    }
  });
}

test("a killed tab: the robot stops in time, and another tab moves it only when asked", async ({ page, context, desk: make }) => {
  const desk = make(new SimulatedChip());
  for (let kill = 0, tab = page; kill < 3; kill++, tab = await context.newPage()) {
    const robot = await desk.open(tab);
    await connect(robot);
    await expect(robot.status).toHaveText("IDLE");
    const wasM = await desk.chip.get("true.distance_m");
    await tab.waitForTimeout(300);
    expect(await desk.chip.get("true.distance_m")).toBe(wasM);
    await drive(robot, desk);
    const crashed = tab.waitForEvent("crash");
    const browser = await context.newCDPSession(tab);
    void browser.send("Page.crash").catch(() => undefined);
    await crashed;
    const killedUs = await desk.chip.get("device_us");
    await stands(desk);
    const [removedUs, deadlineUs] = [await desk.chip.get("drive_removed_us"), await desk.chip.get("deadline_us")];
    expect(removedUs - deadlineUs).toBeLessThanOrEqual(1000);
    expect(removedUs - killedUs).toBeLessThanOrEqual(TTL_US + 1000);
    await tab.close();
  }
});

test.describe("with a touch screen", () => {
  test.use(TOUCH);

  test("the stick drives the connected robot while it is held, once driving is enabled", async ({ page, desk: make }) => {
    const desk = make(new SimulatedChip());
    const robot = await desk.open(page);
    await connect(robot);
    await (await dragStick(page))();
    await expect(page.getByRole("log")).toContainText("nothing moves before you press enable driving");
    expect(await desk.chip.get("true.distance_m")).toBe(0);
    await robot.button("enable driving").click();
    // A busy computer may have ended the drive: then again.
    await expect(async () => {
      const lift = await dragStick(page);
      await expect.poll(() => desk.chip.get("true.x_m"), { timeout: 3000 }).toBeGreaterThan(0.05).finally(lift);
    }).toPass();
    await expect(robot.status).toHaveText("IDLE");
    await stands(desk);
    expect(robot.complaints).toEqual([]);
  });
});

test("a fresh chip's wiring is shown and confirmed, a parameter tried and saved, a black box read; and it looks well", async ({ page, desk: make }) => {
  test.setTimeout(180_000);
  const desk = make(new SimulatedChip({ board_unwritten: 1, estop_open: 0 }));
  const robot = await desk.open(page);
  await connect(robot);
  await expect(page.getByRole("img", { name: "Wiring of L298N, ESP32-DevKitC" })).toBeVisible();
  await expect(page.locator("#board-text")).toContainText("Is the robot wired like this?");
  await robot.button("confirm this wiring").click();
  await expect(page.locator("#board-text")).toHaveText(/It was confirmed\.$/, { timeout: 20_000 });
  await page.locator("#parameter").selectOption("max_velocity_mps");
  await expect(page.locator("#bounds")).toContainText("by default 0.4");
  await page.locator("#value").fill("0.3");
  await robot.button("try").click();
  await expect(page.locator("#bounds")).toContainText("On trial");
  await robot.button("save").click();
  await expect(page.getByRole("log")).toContainText("saved: max_velocity_mps");
  await expect(async () => {
    await page.locator("#value").fill("99");
    await robot.button("try").click();
    await expect(page.getByRole("log")).toContainText("OUT_OF_RANGE", { timeout: 3000 });
  }).toPass();
  await robot.button("revert").click();
  await robot.button("e-stop").click();
  await expect(robot.status).toHaveText("ESTOPPED, held by ESTOP");
  const downloading = page.waitForEvent("download");
  await expect(async () => {
    await robot.button("download the newest").click();
    await expect(page.locator("#box-text")).toContainText(/%|wheelwire why/, { timeout: 1000 });
  }).toPass();
  const download = await downloading;
  expect(download.suggestedFilename()).toMatch(/^\d+-estop\.box$/);
  await robot.looks("connected");
  await page.reload();
  await connect(robot);
  await page.locator("#parameter").selectOption("max_velocity_mps");
  await expect(page.locator("#value")).toHaveValue("0.3");
  expect(robot.complaints).toEqual([]);
});

for (const { what, sentence } of [
  { what: "a browser without Web Serial", sentence: "This browser gives a page no serial ports" },
  { what: "a page that did not come over https", sentence: "This page did not come over https" },
]) {
  test(`${what} shows one sentence, and the simulated robot`, async ({ page, url }) => {
    const isSecure = sentence.startsWith("This browser");
    if (isSecure) await page.addInitScript("Object.defineProperty(navigator, 'serial', { value: undefined })");
    const robot = new RobotPage(page, isSecure ? url : url.replace("127.0.0.1", "not-secure.test"));
    await robot.open();
    expect(await page.evaluate(() => isSecureContext)).toBe(isSecure);
    await expect(text(robot)).toContainText(sentence);
    for (const name of ["connect", "flash"]) await expect(robot.button(name)).toBeDisabled();
    await robot.drive();
    expect(robot.complaints).toEqual([]);
  });
}
