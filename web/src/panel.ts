// What the page says in words: the banner, the buttons that break things, and the log.
import { BREAKS, type Break } from "./breaks.js";
import { nameOf } from "./errors.js";
import { SupervisorState } from "./generated/protocol.js";
import { Observation } from "./observation.js";
import type { Robot } from "./robot.js";
import { heldNames, why } from "./why.js";
import type { World } from "./world.js";

const LONGEST_LOG = 200;

/** The element with this id. */
export function element(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`the page has no element ${id}`);
  return found;
}

/** Change an element's text. */
export function put(target: HTMLElement, text: string): void {
  // Only when it changes: a live region is read aloud at each change.
  if (target.textContent !== text) target.textContent = text;
}

/** A log; each line begins with the time of the run. */
export class Log {
  readonly #list = element("log");

  say(text: string, nowUs: number): void {
    const line = document.createElement("p");
    const at = document.createElement("time");
    at.textContent = `${(nowUs / 1e6).toFixed(1)} s`;
    const words = document.createElement("span");
    words.textContent = text;
    line.append(at, words);
    this.#list.append(line);
    while (this.#list.childElementCount > LONGEST_LOG) this.#list.firstElementChild?.remove();
    this.#list.scrollTop = this.#list.scrollHeight;
  }

  clear(): void {
    this.#list.replaceChildren();
  }
}

/** The state, what holds the robot, why, and the newest stop. */
export class Banner {
  readonly #frame = element("banner");
  readonly #status = element("status");
  readonly #why = element("why");
  readonly #stopped = element("stopped");
  #shown = "";

  show(robot: Robot): void {
    const { state, hold, stopped, program } = robot;
    const name = state === undefined ? "not known" : (nameOf(SupervisorState, state) ?? "BOOT");
    const held = heldNames(hold);
    const shown = [name, ...held].join(" ");
    if (shown !== this.#shown) {
      this.#shown = shown;
      this.#frame.dataset["state"] = name;
      this.#frame.toggleAttribute("data-held", held.length > 0);
      const parts: (string | Node)[] = [strong(name)];
      if (held.length > 0) parts.push(", held by ", strong(held.join(", ")));
      this.#status.replaceChildren(...parts);
    }
    if (state === undefined) {
      put(this.#why, program.session.error.message);
    } else {
      const { faults, hostCause } = robot;
      const { sentence, lookAt } = why({ state, faults, hold, hostCause });
      put(this.#why, lookAt === "" ? sentence : `${sentence} Look first at ${lookAt}.`);
    }
    put(this.#stopped, stopped === "" ? "" : `Its newest stop: ${stopped}.`);
  }
}

function strong(text: string): HTMLElement {
  const found = document.createElement("strong");
  found.textContent = text;
  return found;
}

/** One button, and what became of it. */
class BreakButton {
  readonly #button = document.createElement("button");
  readonly #outcome = document.createElement("p");
  #seen: Observation | undefined;

  constructor(
    readonly one: Break,
    number: number,
    readonly world: () => World,
    readonly say: (text: string) => void,
  ) {
    const should = document.createElement("p");
    should.id = `should-${number}`;
    should.textContent = one.should;
    this.#button.type = "button";
    this.#button.textContent = one.name;
    this.#button.setAttribute("aria-pressed", "false");
    this.#button.setAttribute("aria-describedby", should.id);
    this.#button.addEventListener("click", () => {
      this.#press();
    });
    this.#outcome.className = "outcome";
    const item = document.createElement("li");
    item.append(this.#button, should, this.#outcome);
    element("breaks").append(item);
  }

  /** To be called after each slice. */
  look(): void {
    const seen = this.#seen;
    if (seen === undefined) return;
    if (this.#isPressed) this.one.tick?.(seen.world, seen.elapsedUs);
    if (!this.#isWatching) return;
    seen.look();
    const fromUs = this.one.needsDrive ? seen.droveFromUs : seen.beganUs;
    const isLong = fromUs !== undefined && seen.world.nowUs >= fromUs + this.one.watchUs;
    if (seen.isSettled || isLong) this.#conclude(seen);
  }

  /** Another run has begun. */
  restart(): void {
    this.#seen = undefined;
    this.#isWatching = false;
    this.#button.setAttribute("aria-pressed", "false");
    this.#outcome.textContent = "";
    this.#outcome.className = "outcome";
  }

  #isWatching = false;

  get #isPressed(): boolean {
    return this.#button.getAttribute("aria-pressed") === "true";
  }

  #press(): void {
    const world = this.world();
    if (this.#isPressed) {
      this.one.repair(world);
      this.#button.setAttribute("aria-pressed", "false");
      if (this.#isWatching) this.#outcome.textContent = "";
      this.#isWatching = false;
      this.say(`${this.one.name}: repaired.${hintOf(world)}`);
      return;
    }
    this.#button.setAttribute("aria-pressed", "true");
    this.#seen = new Observation(world);
    this.#isWatching = true;
    this.#outcome.className = "outcome";
    const stands = this.one.needsDrive && world.state !== SupervisorState.DRIVING;
    this.#outcome.textContent = stands ? "It stands: drive it, to see what happens." : "Watching…";
    this.one.apply(world);
  }

  #conclude(seen: Observation): void {
    this.#isWatching = false;
    const met = this.one.isMet(seen);
    const note = this.one.note?.(seen);
    const verdict = document.createElement("span");
    verdict.className = "verdict";
    verdict.textContent = met ? "As it should: " : "Not as it should: ";
    const text = [seen.text, note].filter(Boolean).join(" ");
    this.#outcome.className = `outcome ${met ? "met" : "unmet"}`;
    this.#outcome.replaceChildren(verdict, text);
    this.say(`${this.one.name}: ${text}`);
  }
}

function hintOf(world: World): string {
  const isLatched =
    world.state === SupervisorState.ESTOPPED || world.state === SupervisorState.FAULT;
  return isLatched ? " What is latched stays: press clear, then drive." : "";
}

/** All buttons that break things. */
export class Breaks {
  readonly #buttons: readonly BreakButton[];

  constructor(world: () => World, say: (text: string) => void) {
    this.#buttons = BREAKS.map((one, number) => new BreakButton(one, number, world, say));
  }

  look(): void {
    for (const button of this.#buttons) button.look();
  }

  restart(): void {
    for (const button of this.#buttons) button.restart();
  }
}
