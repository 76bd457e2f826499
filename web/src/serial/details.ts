// What a connected robot has stored: its parameters, its configuration, its black box.
import { LinkLost, WheelwireError, nameOf } from "../errors.js";
import { PICTURES } from "../generated/boards.js";
import {
  BoxCause,
  ConfigurationState,
  ConfigurationStateDocs,
  GROUP_HASHES,
  Group,
  Parameter,
  TrialAction,
  type Messages,
} from "../generated/protocol.js";
import { element, put } from "../panel.js";
import type { Connection } from "./connection.js";

const TRIAL_S = 3;
const RENEW_MS = 500;
/** A browser has begun a download by then. */
const DOWNLOAD_MS = 10_000;
/** In the order of the wire: what a board's picture shows. */
const PINS = [
  "left_enable", "left_in1", "left_in2", "left_pwm", "left_dir", "left_encoder_a", "left_encoder_b",
  "right_enable", "right_in1", "right_in2", "right_pwm", "right_dir", "right_encoder_a",
  "right_encoder_b", "standby", "estop", "battery", "led",
] as const;

type Board = Messages["ConfigurationValue"];

export class Details {
  readonly #parameter = element("parameter") as HTMLSelectElement;
  readonly #value = element("value") as HTMLInputElement;
  readonly #picture = element("board-picture") as HTMLImageElement;
  #entries = new Map<number, Messages["ParameterEntry"]>();
  #tried = new Set<number>();
  #renewal: ReturnType<typeof setInterval> | undefined;
  #board: Board | undefined;
  /** The session that all this belongs to. */
  #session = 0;

  constructor(readonly connection: Connection) {
    this.#parameter.addEventListener("change", () => { this.#showParameter(); });
    this.#on("try", () => this.#try());
    this.#on("save", () => this.#save());
    this.#on("revert", () => this.#end(TrialAction.REVERT));
    this.#on("confirm", () => this.#confirm());
    this.#on("box", () => this.#download());
  }

  /** The connection has changed: read again what belongs to another session. */
  show(): void {
    const { session } = this.connection.program;
    element("details").hidden = session.phase !== "OPEN";
    if (session.phase !== "OPEN" || session.id === this.#session) return;
    this.#session = session.id;
    this.#endTrial();
    this.#entries.clear();
    void this.#attempt("read", async () => {
      await this.#readBoard();
      for (let at = 0, count = 1; at < count; at++) {
        const entry = await this.connection.program.ask("ParameterList", { parameter_index: at });
        count = entry.parameter_count;
        this.#entries.set(entry.parameter, entry);
      }
      const options = [...this.#entries.keys()].map((id) => new Option(nameOf(Parameter, id) ?? `${id}`, `${id}`));
      this.#parameter.replaceChildren(...options);
      this.#showParameter();
    });
  }

  #on(id: string, act: () => Promise<void>): void {
    element(id).addEventListener("click", () => { void this.#attempt(element(id).textContent, act); });
  }

  async #attempt(what: string, act: () => Promise<void>): Promise<void> {
    try {
      await act();
    } catch (error) {
      if (!(error instanceof WheelwireError)) throw error;
      if (error instanceof LinkLost) return; // it is shown next to the port
      this.connection.say(`${what}: ${error.message}`);
    }
  }

  // --- parameters ----------------------------------------------------------------------------------

  get #chosen(): Messages["ParameterEntry"] | undefined {
    return this.#entries.get(Number(this.#parameter.value));
  }

  #showParameter(): void {
    const entry = this.#chosen;
    if (entry === undefined) return;
    this.#value.value = short(entry.value);
    const isTried = this.#tried.has(entry.parameter);
    const bounds = `${short(entry.minimum)} to ${short(entry.maximum)}, by default ${short(entry.default_value)}.`;
    put(element("bounds"), isTried ? `${bounds} On trial: it goes back by itself if this page does.` : bounds);
  }

  async #try(): Promise<void> {
    const entry = this.#chosen;
    if (entry === undefined) return;
    const { program } = this.connection;
    if (this.#renewal === undefined) {
      await program.ask("ParameterTrial", { action: TrialAction.BEGIN, timeout_s: TRIAL_S });
      this.#renewal = setInterval(() => {
        const renewal = { action: TrialAction.RENEW, timeout_s: TRIAL_S };
        void this.#attempt("trial", async () => {
          await program.ask("ParameterTrial", renewal).catch((error: unknown) => {
            this.#endTrial();
            throw error;
          });
        });
      }, RENEW_MS);
    }
    const { parameter } = entry;
    entry.value = (await program.ask("ParameterSet", { parameter, value: Number(this.#value.value) })).value;
    this.#tried.add(parameter);
    this.#showParameter();
  }

  async #save(): Promise<void> {
    const saved = [...this.#tried];
    if (saved.length === 0) {
      this.connection.say("save: nothing is on trial; try a value first");
      return;
    }
    await this.#end(TrialAction.KEEP);
    for (const parameter of saved) await this.connection.program.ask("ParameterSave", { parameter });
    this.connection.say(`saved: ${saved.map((id) => nameOf(Parameter, id) ?? id).join(", ")}`);
  }

  async #end(action: number): Promise<void> {
    const { program } = this.connection;
    const tried = [...this.#tried];
    clearInterval(this.#renewal); // what it would renew is over
    await program.ask("ParameterTrial", { action, timeout_s: TRIAL_S });
    this.#endTrial();
    for (const parameter of tried) {
      const entry = this.#entries.get(parameter);
      if (entry !== undefined) entry.value = (await program.ask("ParameterGet", { parameter })).value;
    }
    this.#showParameter();
  }

  #endTrial(): void {
    clearInterval(this.#renewal);
    this.#renewal = undefined;
    this.#tried.clear();
  }

  // --- configuration -------------------------------------------------------------------------------

  async #has(group: keyof typeof Group): Promise<boolean> {
    const info = await this.connection.program.ask("GroupGet", { group: Group[group] });
    return info.hash === GROUP_HASHES[group];
  }

  async #readBoard(): Promise<void> {
    const board = (await this.#has("CONFIGURATION"))
      ? await this.connection.program.ask("ConfigurationGet", {})
      : undefined;
    this.#board = board;
    const state = board === undefined ? undefined : nameOf(ConfigurationState, board.state);
    const isNew = state === "BUILT_IN" || state === "TRIAL";
    element("confirm").hidden = !isNew;
    if (board === undefined || state === undefined || state === "DAMAGED") {
      this.#picture.hidden = true;
      put(element("board-pins"), "");
      put(element("board-text"), state === undefined ? "The firmware tells no configuration." : ConfigurationStateDocs[state]);
      return;
    }
    const name = new TextDecoder().decode(board.name).replaceAll("\0", "");
    const question = isNew ? " Is the robot wired like this? If not, its wheels may run away." : "";
    put(element("board-text"), `${name}: ${ConfigurationStateDocs[state]}${question}`);
    const pins = PINS.filter((pin) => board[pin] >= 0).map((pin) => `${pin.replaceAll("_", " ")} ${board[pin]}`);
    put(element("board-pins"), `GPIO: ${pins.join(", ")}. Peripherals: ${board.peripheral_count}.`);
    const picture = pictureOf(board);
    this.#picture.hidden = picture === undefined;
    if (picture === undefined) return;
    this.#picture.src = `boards/${picture}.svg`;
    this.#picture.alt = `Wiring of ${name}`;
  }

  async #confirm(): Promise<void> {
    if (this.#board === undefined) return;
    const { fingerprint } = this.#board;
    await this.connection.program.ask("ConfigurationConfirm", { fingerprint });
    this.connection.say("the wiring is confirmed: the robot restarts, then it can be driven");
    element("confirm").hidden = true;
  }

  // --- black box -----------------------------------------------------------------------------------

  async #download(): Promise<void> {
    const { program, say } = this.connection;
    const box = (await this.#has("RECORDER")) ? await program.ask("BoxGet", { age: 0 }) : undefined;
    if (box === undefined || box.number === 0) {
      say("the robot has no black box: it stores one at a fault, an e-stop or a crash");
      return;
    }
    const parts: Uint8Array<ArrayBuffer>[] = [];
    for (let offset = 0; offset < box.size; ) {
      const part = await program.ask("BoxRead", { number: box.number, offset });
      if (part.size === 0) {
        say(`black box ${box.number} is no longer there: a newer one took its place; download that one`);
        return;
      }
      parts.push(part.data.slice(0, part.size));
      offset += part.size;
      put(element("box-text"), `${Math.round((100 * offset) / box.size)} % of ${box.size} bytes`);
    }
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob(parts));
    link.download = `${box.number}-${nameOf(BoxCause, box.cause)?.toLowerCase() ?? box.cause}.box`;
    link.click();
    setTimeout(() => { URL.revokeObjectURL(link.href); }, DOWNLOAD_MS);
    put(element("box-text"), `${link.download}: read it by wheelwire why ${link.download}`);
  }
}

/** The name of the picture that shows this wiring and no other. */
function pictureOf(board: Board): string | undefined {
  const pins = PINS.map((pin) => board[pin]);
  return PICTURES[[board.chip, board.stage, ...pins, board.pulldowns].join(" ")];
}

/** As a person writes what travelled in 32 bits. */
function short(value: number): string {
  return `${Number(value.toPrecision(7))}`;
}
