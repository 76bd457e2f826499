// A computer with robots at its ports, and a page there: what `wheelwire sim` runs, behind a stand-in of
// the browser's ports. The page's policy stays in place: the stand-in's WebSocket is of the page's own
// address.
import type { Locator, Page } from "@playwright/test";
import { build } from "esbuild";
import { fileURLToPath } from "node:url";
import { SupervisorState } from "../../src/generated/protocol.js";
import { Program } from "../../src/program.js";
import { Socket, type Chip, type SimulatedChip } from "../serial/bridge.js";
import { RobotPage, expect, serve, test as base, type Planted } from "./page.js";

const STAND_IN = build({
  entryPoints: [fileURLToPath(new URL("../serial/stand_in.ts", import.meta.url))],
  bundle: true,
  format: "iife",
  globalName: "standIn",
  write: false,
}).then(({ outputFiles }) => outputFiles[0]?.text ?? "");

export interface Options {
  readonly keepsHandle?: boolean;
  readonly planted?: Planted;
}

/** A computer with chips in its sockets, and what serves it the page. */
export class Desk {
  readonly sockets: Socket[];
  #served: Awaited<ReturnType<typeof serve>> | undefined;

  constructor(readonly chips: readonly Chip[]) {
    this.sockets = chips.map((chip) => new Socket(chip));
  }

  get socket(): Socket {
    return this.sockets[0] as Socket;
  }

  get chip(): SimulatedChip {
    return this.chips[0] as SimulatedChip;
  }

  async open(page: Page, { keepsHandle = false, planted }: Options = {}): Promise<RobotPage> {
    this.#served ??= await serve(planted, this.sockets);
    const { url } = this.#served;
    const devices = JSON.stringify(this.chips.map((chip) => chip.device));
    const address = `${url.replace("http", "ws")}port/`;
    const install = `standIn.install("${address}", ${devices}, ${String(keepsHandle)}); globalThis.chosenPort = 0;`;
    await page.addInitScript({ content: `${await STAND_IN}; ${install}` });
    const robot = new RobotPage(page, url);
    // Of a planted fault the simulated robot may have a part.
    await (planted === undefined ? robot.openLive() : page.goto(url));
    return robot;
  }

  close(): void {
    for (const chip of this.chips) chip.stop();
    this.#served?.close();
  }
}

export const test = base.extend<{ desk: (...chips: Chip[]) => Desk }>({
  desk: async ({}, use) => {
    const made: Desk[] = [];
    await use((...chips) => {
      const desk = new Desk(chips);
      made.push(desk);
      return desk;
    });
    for (const desk of made) desk.close();
  },
});

export function text(robot: RobotPage): Locator {
  return robot.page.locator("#own-text");
}

export async function isConnected(robot: RobotPage): Promise<void> {
  await expect(text(robot)).toContainText("Connected to board", { timeout: 20_000 });
}

export async function connect(robot: RobotPage): Promise<void> {
  await robot.button("connect").click();
  await isConnected(robot);
}

/** Hold the arrow until the robot drives: a busy computer may have ended the drive before. */
export async function drive(robot: RobotPage, { chip }: Desk): Promise<void> {
  const enable = robot.button("enable driving");
  await expect(async () => {
    if ((await enable.getAttribute("aria-pressed")) !== "true") await enable.click();
    await robot.page.keyboard.up("ArrowUp");
    await robot.page.keyboard.down("ArrowUp");
    await expect.poll(() => chip.get("drive_on"), { timeout: 2000 }).toBe(1);
  }).toPass();
}

export async function stands({ chip }: Desk): Promise<void> {
  await expect.poll(() => chip.get("drive_on")).toBe(0);
}

/** Drive a robot that is at no port yet, until its program is silent and its deadline passes. */
export async function timeOut(chip: SimulatedChip): Promise<void> {
  const came: Uint8Array[] = [];
  chip.onBytes = (bytes) => { came.push(bytes); };
  const program = new Program(() => 1, () => undefined);
  const nowUs = (): number => Math.round(performance.now() * 1000);
  program.session.connect(nowUs());
  const line = { take: () => Buffer.concat(came.splice(0)), write: (bytes: Uint8Array) => { chip.write(bytes); } };
  const timer = setInterval(() => {
    if (program.session.phase === "OPEN" && !program.isDriving) program.drive({ mps: 0.1, radps: 0 });
    program.run(line, nowUs());
  }, 5);
  await expect.poll(() => chip.get("state")).toBe(SupervisorState.DRIVING);
  clearInterval(timer);
  await expect.poll(() => chip.get("state")).toBe(SupervisorState.TIMED_OUT);
}

export { expect };
