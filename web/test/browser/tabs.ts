// Tabs that can really be frozen: Playwright attaches to their browser without its defaults, which keep
// each page in the foreground, where a browser freezes none.
import { spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { chromium, type CDPSession, type Page } from "@playwright/test";

const EXECUTABLE = "/usr/bin/chromium";
const REPLY_MS = 20_000;

/** What reaches a tab between its death and its new process is never answered. */
class NoReply extends Error {}

/** A tab in front of an empty one, in a browser of its own. */
export class Tab {
  private constructor(
    readonly page: Page,
    readonly behind: Page,
    readonly session: CDPSession,
    readonly close: () => Promise<void>,
  ) {}

  static async open(url: string): Promise<Tab> {
    const profile = await mkdtemp(join(tmpdir(), "wheelwire-tabs-"));
    const options = ["--no-sandbox", "--headless=new", "--no-first-run", "--remote-debugging-port=0", "--window-size=400,300"];
    const child = spawn(EXECUTABLE, [...options, `--user-data-dir=${profile}`, "about:blank"], { stdio: ["ignore", "ignore", "pipe"] });
    let said = "";
    child.stderr.on("data", (data: Buffer) => { said += data.toString(); });
    let address: string | undefined;
    while ((address = /ws:\S+/.exec(said)?.[0]) === undefined) await pause(15);
    const browser = await chromium.connectOverCDP(address, { noDefaults: true });
    const [context] = browser.contexts();
    if (context === undefined) throw new Error("the browser has no context");
    const [behind, page] = [await context.newPage(), await context.newPage()];
    const session = await context.newCDPSession(page);
    const tab = new Tab(page, behind, session, async () => {
      child.kill();
      await once(child, "exit");
      await rm(profile, { recursive: true, force: true, maxRetries: 5 });
    });
    await page.goto(url);
    await tab.send("Debugger.enable");
    await tab.send("Inspector.enable");
    await tab.toFront();
    return tab;
  }

  send(method: Parameters<CDPSession["send"]>[0], params: object = {}): Promise<unknown> {
    const reply = this.session.send(method, params);
    return Promise.race([reply, pause(REPLY_MS).then(() => { throw new NoReply(method); })]);
  }

  async evaluate<Result>(action: () => Result): Promise<Result> {
    const expression = `(${action.toString()})()`;
    const reply = await this.send("Runtime.evaluate", { expression, returnByValue: true });
    const { result, exceptionDetails } = reply as {
      result: { value: Result };
      exceptionDetails?: { text: string; exception?: { description?: string } };
    };
    if (exceptionDetails !== undefined) {
      throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    }
    return result.value;
  }

  async until(condition: () => boolean): Promise<void> {
    const endMs = Date.now() + 90_000;
    while (Date.now() < endMs) {
      const isTrue = await this.evaluate(condition).catch((error: unknown) => {
        if (error instanceof NoReply) return false; // ask again
        throw error;
      });
      if (isTrue) return;
      await pause(15);
    }
    throw new Error(`never came true: ${condition.toString()}`);
  }

  async toFront(): Promise<void> {
    for (let isHidden = true; isHidden; ) {
      await this.session.send("Page.bringToFront");
      await pause(15);
      isHidden = await this.evaluate(() => document.hidden);
    }
  }

  /** The browser freezes the tab behind another one, and notifies the page of both. */
  async freeze(ms: number): Promise<void> {
    await this.behind.bringToFront();
    await this.until(() => document.hidden);
    await this.send("Page.setWebLifecycleState", { state: "frozen" });
    await pause(ms);
    await this.send("Page.setWebLifecycleState", { state: "active" });
    await this.toFront();
  }

  /** Its process is killed, and the browser loads it anew, as when memory was short. */
  async kill(): Promise<void> {
    const killed = new Promise((resolve) => this.session.once("Inspector.targetCrashed", resolve));
    this.session.send("Page.crash").catch(() => undefined); // nobody is left to answer it
    await killed;
    await this.send("Page.reload");
  }

  /** Nothing of the page runs, and nothing announces it: as if the computer slept. */
  async suspend(ms: number): Promise<void> {
    const paused = new Promise((resolve) => this.session.once("Debugger.paused", resolve));
    await this.send("Debugger.pause");
    await paused;
    await pause(ms);
    await this.send("Debugger.resume");
  }
}

export function pause(ms: number): Promise<void> {
  return new Promise((resolve) => {
    setTimeout(resolve, ms);
  });
}
