// Tabs of a browser that is driven by nothing but its own protocol: one that can really be frozen.
// Playwright keeps each page in the foreground, where a browser freezes none.
import { spawn, type ChildProcess } from "node:child_process";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import type { Readable, Writable } from "node:stream";

const EXECUTABLE = "/usr/bin/chromium";
const REPLY_MS = 20_000;

/** What reaches a tab between its death and its new process is never answered. */
class NoReply extends Error {}

interface Reply {
  readonly id?: number;
  readonly method?: string;
  readonly sessionId?: string;
  readonly result?: unknown;
  readonly error?: { readonly message: string };
}

/** A browser of its own, on a pipe. */
export class TabBrowser {
  readonly #open = new Map<number, (reply: Reply) => void>();
  readonly #events = new Map<string, () => void>();
  #number = 0;
  #unread = "";

  private constructor(
    readonly process: ChildProcess,
    readonly profile: string,
  ) {
    (process.stdio[4] as Readable).on("data", (data: Buffer) => {
      const parts = (this.#unread + data.toString()).split("\0");
      this.#unread = parts.pop() ?? "";
      for (const part of parts) this.#take(JSON.parse(part) as Reply);
    });
  }

  static async start(): Promise<TabBrowser> {
    const profile = await mkdtemp(join(tmpdir(), "wheelwire-tabs-"));
    const options = ["--no-sandbox", "--headless=new", "--no-first-run", "--remote-debugging-pipe", "--window-size=400,300"];
    const child = spawn(EXECUTABLE, [...options, `--user-data-dir=${profile}`, "about:blank"], {
      stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"],
    });
    return new TabBrowser(child, profile);
  }

  async stop(): Promise<void> {
    const ended = new Promise((resolve) => this.process.once("exit", resolve));
    await this.send("Browser.close");
    await ended;
    await rm(this.profile, { recursive: true, force: true, maxRetries: 5 });
  }

  /** A tab in front of an empty one. */
  async tab(url: string): Promise<Tab> {
    const behind = await this.#create("about:blank");
    const targetId = await this.#create(url);
    const attached = await this.send("Target.attachToTarget", { targetId, flatten: true });
    const { sessionId } = attached as { sessionId: string };
    const tab = new Tab(this, targetId, sessionId, behind);
    await tab.send("Debugger.enable");
    await tab.send("Inspector.enable");
    await tab.toFront();
    return tab;
  }

  async #create(url: string): Promise<string> {
    const created = await this.send("Target.createTarget", { url });
    return (created as { targetId: string }).targetId;
  }

  send(method: string, params: object = {}, sessionId?: string): Promise<unknown> {
    const id = ++this.#number;
    (this.process.stdio[3] as Writable).write(JSON.stringify({ id, method, params, sessionId }) + "\0");
    return new Promise((resolve, reject) => {
      const timer = setTimeout(reject, REPLY_MS, new NoReply(method));
      this.#open.set(id, ({ result, error }) => {
        clearTimeout(timer);
        if (error === undefined) resolve(result);
        else reject(new Error(`${method}: ${error.message}`));
      });
    });
  }

  /** The next event of this name in a session. */
  once(method: string, sessionId: string): Promise<void> {
    return new Promise((resolve) => {
      this.#events.set(method + sessionId, resolve);
    });
  }

  #take(reply: Reply): void {
    if (reply.id !== undefined) {
      this.#open.get(reply.id)?.(reply);
      this.#open.delete(reply.id);
    } else if (reply.method !== undefined) {
      this.#events.get(reply.method + (reply.sessionId ?? ""))?.();
    }
  }
}

/** One tab. */
export class Tab {
  constructor(
    readonly browser: TabBrowser,
    readonly targetId: string,
    readonly sessionId: string,
    readonly behind: string,
  ) {}

  send(method: string, params: object = {}): Promise<unknown> {
    return this.browser.send(method, params, this.sessionId);
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
    let isHidden = true;
    while (isHidden) {
      await this.browser.send("Target.activateTarget", { targetId: this.targetId });
      await pause(15);
      isHidden = await this.evaluate(() => document.hidden);
    }
  }

  /** The browser freezes the tab behind another one, and notifies the page of both. */
  async freeze(ms: number): Promise<void> {
    await this.browser.send("Target.activateTarget", { targetId: this.behind });
    await this.until(() => document.hidden);
    await this.send("Page.setWebLifecycleState", { state: "frozen" });
    await pause(ms);
    await this.send("Page.setWebLifecycleState", { state: "active" });
    await this.toFront();
  }

  /** Its process is killed, and the browser loads it anew, as when memory was short. */
  async kill(): Promise<void> {
    const killed = this.browser.once("Inspector.targetCrashed", this.sessionId);
    this.send("Page.crash").catch(() => undefined); // nobody is left to answer it
    await killed;
    await this.send("Page.reload");
  }

  /** Nothing of the page runs, and nothing announces it: as if the computer slept. */
  async suspend(ms: number): Promise<void> {
    const paused = this.browser.once("Debugger.paused", this.sessionId);
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
