// The page in a browser: served by a plain file server, watched for everything that it loads or says.
import { test as base, type Locator, type Page } from "@playwright/test";
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import type { AddressInfo } from "node:net";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";

const FILES = fileURLToPath(new URL("../../../build/web/", import.meta.url));
const TYPES: Readonly<Record<string, string>> = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript",
  ".css": "text/css",
  ".wasm": "application/wasm",
  ".svg": "image/svg+xml",
};

/** Files in place of those of the page, by name: a planted fault. */
export type Planted = Readonly<Record<string, Uint8Array | string>>;

/** Serve the page on the loopback interface; returns its address and what ends it. */
export async function serve(planted: Planted = {}): Promise<{ url: string; close: () => void }> {
  const server = createServer((request, response) => {
    const name = normalize(new URL(request.url ?? "/", "http://page").pathname).slice(1) || "index.html";
    const content = planted[name] ?? readFile(join(FILES, name));
    Promise.resolve(content).then(
      (body) => response.writeHead(200, { "content-type": TYPES[extname(name)] }).end(body),
      () => response.writeHead(404).end(),
    );
  });
  await new Promise<void>((resolve) => server.listen(0, "127.0.0.1", resolve));
  const { port } = server.address() as AddressInfo;
  return { url: `http://127.0.0.1:${port}/`, close: () => server.close() };
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

  async open(query = ""): Promise<void> {
    await this.page.goto(this.url + query);
    await this.page.waitForFunction(
      () => globalThis.wheelwire?.world.program.session.phase === "OPEN",
    );
  }

  button(name: string): Locator {
    return this.page.getByRole("button", { name, exact: true });
  }

  /** Press `figure eight`, and wait until the robot drives. */
  async drive(): Promise<void> {
    await this.button("figure eight").click();
    await this.page.waitForFunction(() => (globalThis.wheelwire?.world.simulator.get("true.distance_m") ?? 0) > 0.1);
  }

  /** A variable of the simulation. */
  get(name: string): Promise<number> {
    return this.page.evaluate((name) => globalThis.wheelwire?.world.simulator.get(name) ?? NaN, name);
  }
}

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
