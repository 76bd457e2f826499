// A person's own robot in the page: its buttons, its port's state in words, and the page's parts for it.
import { element, put } from "../panel.js";
import { nameOfBoard, type Connection } from "./connection.js";
import { Details } from "./details.js";
import { webSerial } from "./port.js";

const NO_SERIAL =
  "This browser gives a page no serial ports: to connect your robot, use Chrome or Edge on a computer, Chrome on Android, or Firefox on a computer. Here is the simulated one.";
const NOT_SECURE =
  "This page did not come over https, and gets no serial ports: open it by https to connect your robot. Here is the simulated one.";
/** Parts of the simulated robot, and of a connected one. */
const SIMULATED = ["floor-section", "breaks-section", "eight", "again", "connect"] as const;
const CONNECTED = ["disconnect", "enable", "enable-text"] as const;

export class Own {
  readonly #details: Details;
  readonly #serial = webSerial();
  #said = "";
  #wasConnected = false;

  /** @param before Called before another robot is shown. */
  constructor(
    readonly connection: Connection,
    readonly before: () => void,
  ) {
    this.#details = new Details(connection);
    this.#on("connect", () => this.#connect(false));
    this.#on("another", () => this.#connect(true));
    this.#on("disconnect", () => this.connection.disconnect());
    this.#on("enable", () => {
      connection.isEnabled = !connection.isEnabled && connection.state !== undefined;
      if (!connection.isEnabled) connection.program.stop(connection.nowUs);
      this.show();
      return Promise.resolve();
    });
    for (const id of ["connect", "flash"]) (element(id) as HTMLButtonElement).disabled = this.#serial === undefined;
    if (this.#serial === undefined) put(element("own-text"), isSecureContext ? NO_SERIAL : NOT_SECURE);
  }

  /** The newest report stays next to the buttons while nothing is connected. */
  note(text: string): void {
    this.#said = text;
  }

  show(): void {
    const { connection } = this;
    const { isConnected } = connection;
    if (isConnected !== this.#wasConnected) {
      this.before();
      this.#wasConnected = isConnected;
      for (const id of SIMULATED) element(id).hidden = isConnected;
      for (const id of CONNECTED) element(id).hidden = !isConnected;
    }
    element("another").hidden = isConnected || this.#said === "";
    element("enable").setAttribute("aria-pressed", String(connection.isEnabled));
    put(element("own-text"), isConnected ? this.#text() : this.#said);
    this.#details.show();
  }

  #text(): string {
    const { session } = this.connection.program;
    const { device } = session;
    if (this.connection.needsFlash) return `${session.error.message}. Stop and e-stop work; flash the board to drive it.`;
    if (session.phase !== "OPEN" || device === undefined) return `Looking for the robot: ${session.error.message}.`;
    const version = [device.version_major, device.version_minor, device.version_patch].join(".");
    return `Connected to board ${nameOfBoard(device.board_id)}, firmware ${version}.`;
  }

  #on(id: string, act: () => Promise<void>): void {
    element(id).addEventListener("click", () => {
      void act();
    });
  }

  async #connect(asks: boolean): Promise<void> {
    await (await this.choose(asks))?.();
  }

  /** Returns what opens the port chosen before. Asks if there is none, or for another port. */
  async choose(asks = false): Promise<(() => Promise<void>) | undefined> {
    const serial = this.#serial;
    if (serial === undefined || this.connection.isConnected) return undefined;
    const [granted, ...more] = await serial.getPorts();
    const isKnown = granted !== undefined && more.length === 0 && !asks;
    // If a person closes the browser's list, nothing needs reporting.
    const port = isKnown ? granted : await serial.requestPort().catch(() => undefined);
    return port && (() => this.connection.connect(serial, port));
  }
}
