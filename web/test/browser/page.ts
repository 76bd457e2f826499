// The page in a browser: served by a plain file server, watched for everything that it loads or says.
import { build, type Plugin } from "esbuild";
import { test as base, type Locator, type Page } from "@playwright/test";
import { readFileSync } from "node:fs";
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import type { AddressInfo } from "node:net";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { accept, type Socket } from "../serial/bridge.js";

const FILES = fileURLToPath(new URL("../../../build/web/", import.meta.url));
const PICTURES = fileURLToPath(new URL("../../../build/web-test/", import.meta.url));
const AXE = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const TYPES: Readonly<Record<string, string>> = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript",
  ".json": "application/json",
  ".bin": "application/octet-stream",
  ".css": "text/css",
  ".wasm": "application/wasm",
  ".svg": "image/svg+xml",
};

/** How far the page's time runs at once, and how often at most: half a minute. */
const STEP_MS = 250;
const MOST_STEPS = 120;
/** Later than any computer gets there by itself. */
const PAUSED_AT_MS = 3_600_000;

/** Files in place of those of the page, by name: a planted fault. */
export type Planted = Readonly<Record<string, Uint8Array | string>>;

/** The page's code with a fault in one of its files. */
export async function planted(file: string, from: string, to: string): Promise<Planted> {
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

/** The computer's sockets with what is plugged in there; `accept` has them at their numbers. */
export type Sockets = readonly Socket[];

/** Serve the page on the loopback interface; returns its address and what ends it. */
export async function serve(
  planted: Planted = {},
  sockets: Sockets = [],
): Promise<{ url: string; close: () => void }> {
  const server = createServer((request, response) => {
    const name = normalize(new URL(request.url ?? "/", "http://page").pathname).slice(1) || "index.html";
    const content = planted[name] ?? readFile(join(FILES, name));
    Promise.resolve(content).then(
      (body) => response.writeHead(200, { "content-type": TYPES[extname(name)] }).end(body),
      () => response.writeHead(404).end(),
    );
  });
  server.on("upgrade", (request, stream) => {
    accept(sockets, request, stream);
  });
  await new Promise<void>((resolve) => server.listen(0, "127.0.0.1", resolve));
  const { port } = server.address() as AddressInfo;
  return { url: `http://127.0.0.1:${port}/`, close: () => server.close() };
}

function isOpen(): boolean {
  return globalThis.wheelwire?.world.program.session.phase === "OPEN";
}

/** A page with a robot. */
export class RobotPage {
  readonly requests: string[] = [];
  readonly complaints: string[] = [];
  readonly status: Locator;

  constructor(
    readonly page: Page,
    readonly url: string,
  ) {
    this.status = page.getByRole("status");
    page.on("request", (request) => this.requests.push(request.url()));
    page.on("console", (message) => {
      if (["error", "warning"].includes(message.type())) this.complaints.push(message.text());
    });
    page.on("pageerror", (error) => this.complaints.push(error.message));
  }

  /** Open the page. Its own time stands still, but for `pass`: no busy computer holds the robot up. */
  async open(query = ""): Promise<void> {
    await this.page.clock.install({ time: 0 });
    await this.page.clock.pauseAt(PAUSED_AT_MS);
    await this.page.goto(this.url + query);
    await this.page.waitForFunction(() => globalThis.wheelwire !== undefined, undefined, { polling: 20 });
    await this.opens();
  }

  /** Let the page's own time run until the robot has answered. */
  async opens(): Promise<void> {
    await this.pass(() => this.page.evaluate(isOpen));
  }

  /** Open the page, in the computer's time. */
  async openLive(): Promise<void> {
    await this.page.goto(this.url);
    await this.page.waitForFunction(isOpen);
  }

  button(name: string): Locator {
    return this.page.getByRole("button", { name, exact: true });
  }

  /** Press `figure eight`, and wait until the robot drives. */
  async drive(): Promise<void> {
    await this.button("figure eight").click();
    await this.pass(async () => (await this.get("true.distance_m")) > 0.1);
  }

  /** Let the page's own time run fast until this holds. */
  async pass(holds: () => Promise<boolean>): Promise<void> {
    for (let steps = 0; !(await holds()); steps++) {
      base.expect(steps, "what is waited for never comes true").toBeLessThan(MOST_STEPS);
      await this.page.clock.runFor(STEP_MS);
    }
  }

  /** Let the page's own time run until the status is this. */
  async shows(status: string | RegExp): Promise<void> {
    const pattern = typeof status === "string" ? new RegExp(`^${status}$`) : status;
    await this.pass(async () => pattern.test(await this.status.innerText()));
  }

  /** It fits a computer and a phone, in the light and the dark, and axe finds nothing serious. */
  async looks(name: string): Promise<void> {
    // Not by a script element, which the page's policy forbids.
    await this.page.evaluate(AXE);
    for (const width of [1280, 390]) {
      for (const colorScheme of ["light", "dark"] as const) {
        await this.page.setViewportSize({ width, height: 844 });
        await this.page.emulateMedia({ colorScheme });
        const wide = await this.page.evaluate(() => document.documentElement.scrollWidth);
        base.expect(wide, `${width} px`).toBeLessThanOrEqual(width);
        const found = await this.page.evaluate(async () => {
          const { axe } = globalThis as unknown as { axe: { run: () => Promise<{ violations: { id: string; impact: string; nodes: { html: string }[] }[] }> } };
          const { violations } = await axe.run();
          return violations.map(({ id, impact, nodes }) => [impact, id, nodes[0]?.html]);
        });
        base.expect(found.filter(([impact]) => impact === "serious" || impact === "critical")).toEqual([]);
        await this.page.screenshot({ path: join(PICTURES, `${name}-${width}-${colorScheme}.png`), fullPage: true });
      }
    }
  }

  /** A variable of the simulation. */
  get(name: string): Promise<number> {
    return this.page.evaluate((name) => globalThis.wheelwire?.world.simulator.get(name) ?? NaN, name);
  }
}

/** A finger that drags the stick forward; returns what lifts it. */
export async function dragStick(page: Page): Promise<() => Promise<unknown>> {
  const stick = page.locator("#stick");
  await stick.scrollIntoViewIfNeeded();
  const box = await stick.boundingBox();
  if (box === null) throw new Error("the stick is not shown");
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const touch = await page.context().newCDPSession(page);
  const send = (type: "touchStart" | "touchMove" | "touchEnd", touchPoints: { x: number; y: number }[]): Promise<unknown> =>
    touch.send("Input.dispatchTouchEvent", { type, touchPoints });
  await send("touchStart", [{ x, y }]);
  await send("touchMove", [{ x, y: y - 30 }]);
  return () => send("touchEnd", []);
}

export const TOUCH = { hasTouch: true, viewport: { width: 390, height: 844 } };

export const test = base.extend<{ robot: RobotPage }, { url: string }>({
  url: [
    async ({}, use) => {
      const { url, close } = await serve();
      await use(url);
      close();
    },
    { scope: "worker" },
  ],
  robot: async ({ page, url }, use) => {
    const robot = new RobotPage(page, url);
    await use(robot);
    // Whatever a test does: no error is logged, and nothing is loaded but the page's own files.
    base.expect(robot.complaints).toEqual([]);
    base.expect(robot.requests.filter((one) => !one.startsWith(url))).toEqual([]);
  },
});
export { expect } from "@playwright/test";
