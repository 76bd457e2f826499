// The button `flash`: what is written, how far it is, and where the board needs a hand.
import { LinkLost, WheelwireError, nameOf } from "../errors.js";
import { Chip } from "../generated/protocol.js";
import { FLASH } from "../generated/words.js";
import { element, put } from "../panel.js";
import type { Connection } from "../serial/connection.js";
import { fill } from "../text.js";
import { flashChip } from "./flash.js";
import { FlashFailed, readImage } from "./image.js";
import { releaseImage } from "./release.js";

const STANDSTILL_MS = 3000;
/** Short: the chip may hold no firmware at all. */
const PROBE_MS = 2000;
/** A chip with USB of its own disappears as it resets, and comes back. */
const RETURN_MS = 15_000;
const LOOK_MS = 20;

export class FlashPanel {
  readonly #button = element("flash") as HTMLButtonElement;
  readonly #file = element("image") as HTMLInputElement;
  readonly #bar = element("flash-bar") as HTMLProgressElement;
  readonly #hand = element("boot");

  /** @param choose Gives the port that a person chose; undefined: none. */
  constructor(
    readonly connection: Connection,
    readonly choose: () => Promise<(() => Promise<void>) | undefined>,
  ) {
    this.#button.addEventListener("click", () => {
      void this.#press();
    });
  }

  async #press(): Promise<void> {
    const buttons = ["flash", "connect", "disconnect", "another", "wire"].map((id) => element(id) as HTMLButtonElement);
    const could = buttons.map((button) => button.disabled);
    for (const button of buttons) button.disabled = true;
    try {
      await this.#flash();
    } catch (error) {
      if (!(error instanceof WheelwireError)) throw error;
      this.#say(error.message);
    } finally {
      buttons.forEach((button, at) => {
        button.disabled = could[at] ?? false;
      });
      this.#bar.hidden = this.#hand.hidden = true;
    }
  }

  async #flash(): Promise<void> {
    const { connection } = this;
    // Before anything is waited for: the browser shows its list only upon a click.
    const open = connection.isConnected ? undefined : await this.choose();
    if (!connection.isConnected && open === undefined) return;
    // What can be wrong without the chip is found before it is touched.
    const [file] = this.#file.files ?? [];
    const own = file && readImage(file.name, new Uint8Array(await file.arrayBuffer()));
    await open?.();
    await until(() => connection.program.session.phase === "OPEN" || !connection.isConnected, PROBE_MS);
    if (!connection.isConnected) return; // and it was said why
    await this.#standStill();
    this.#bar.value = 0;
    this.#bar.hidden = false;
    this.#say("flashing: leave the cable in");
    const load = (path: string): Promise<Response> => fetch(path);
    const chip = await connection.lend((handle) =>
      flashChip(handle, own === undefined ? (which) => releaseImage(which, load) : () => Promise.resolve(own), {
        say: (text) => { this.#say(text); },
        progress: (fraction) => { this.#bar.value = fraction; },
        holdBoot: () => this.#askForHand(),
      }),
    );
    await this.#verify(chip);
  }

  /** First: the next steps reset the chip, and its wheels would roll on. */
  async #standStill(): Promise<void> {
    const { program } = this.connection;
    if (program.session.phase !== "OPEN") return; // an empty chip, or another release
    // The acknowledgement means that the stop has begun: the wheels may still turn.
    await new Promise<void>((resolve) => {
      program.stop(this.connection.nowUs, resolve);
    });
    const before = program.sample;
    const stands = (): boolean => {
      const { sample } = program;
      // Exactly 0: so the firmware reports a wheel that has not ticked for half a second.
      return sample !== undefined && sample !== before && sample.left_mps === 0 && sample.right_mps === 0;
    };
    if (!(await until(stands, STANDSTILL_MS))) throw new FlashFailed(fill(FLASH.keepTurning, "this port"));
  }

  /** Connect to the new firmware. */
  async #verify(chip: number): Promise<void> {
    const { session } = this.connection.program;
    const isBack = await until(() => session.phase === "OPEN", RETURN_MS);
    if (!isBack) throw new LinkLost(`the firmware was written, but does not answer: ${session.error.message}`);
    const board = session.device?.board ?? Chip.SIMULATED;
    const [name, wanted] = [nameOf(Chip, board) ?? "", nameOf(Chip, chip) ?? ""];
    if (board !== chip) throw new FlashFailed(fill(FLASH.otherBoard, name, wanted, wanted));
    this.#say(`flashed: the ${wanted} runs the new firmware`);
  }

  #askForHand(): Promise<boolean> {
    this.#hand.hidden = false;
    return new Promise((resolve) => {
      for (const [id, answer] of [["boot-on", true], ["boot-off", false]] as const) {
        element(id).onclick = () => {
          this.#hand.hidden = true;
          resolve(answer);
        };
      }
      element("boot-on").focus();
    });
  }

  #say(text: string): void {
    put(element("flash-text"), text);
    this.connection.say(text);
  }
}

/** Wait for something; whether it came true in time. */
async function until(condition: () => boolean, ms: number): Promise<boolean> {
  const endMs = performance.now() + ms;
  while (!condition() && performance.now() < endMs) {
    await new Promise((resolve) => setTimeout(resolve, LOOK_MS));
  }
  return condition();
}
