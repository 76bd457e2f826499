// A DevKit at a port: its loader answers once its lines say so, and what boots is a simulated robot.
import { Chip as ChipName, type Messages } from "../../src/generated/protocol.js";
import { ESP32, EspChip } from "../chip.js";
import { CP210X, SimulatedChip, type Chip } from "./bridge.js";

/** Its reset pin rises slowly: a capacitor holds it low for so long. */
const RESET_RISE_MS = 20;

export class FlashableChip implements Chip {
  readonly device = CP210X;
  readonly esp: EspChip;
  readonly robot: SimulatedChip;
  onBytes: (bytes: Uint8Array) => void = () => undefined;
  #baudRate = 0;
  #lines = [false, false];
  #isHeld = false;

  /**
   * @param settings Of the robot; see docs/simulator.md.
   * @param hasBootCircuit Its signals pull its BOOT pin low; otherwise only a finger does.
   * @param older What its firmware says of itself until it is flashed.
   */
  constructor(
    settings: Readonly<Record<string, number>>,
    readonly hasBootCircuit = true,
    older: Partial<Messages["DeviceHello"]> = {},
  ) {
    const board = ChipName.ESP32; // the robot takes itself for no chip
    this.robot = new SimulatedChip(settings);
    this.robot.hello = { ...older, board };
    this.esp = new EspChip(ESP32, {
      feed: (bytes) => { this.robot.write(bytes); },
      take: () => new Uint8Array(), // it is passed on as it comes
      reset: () => {
        if (this.esp.writes > 0) this.robot.hello = { board };
        this.robot.reset();
      },
    });
    this.robot.onBytes = (bytes) => {
      if (!this.esp.isLoading && this.esp.boots) this.onBytes(bytes);
    };
  }

  /** A finger holds BOOT, and presses EN once. */
  enterByHand(): void {
    this.esp.reset(true);
  }

  hears(baudRate: number): boolean {
    this.#baudRate = baudRate;
    return true;
  }

  write(bytes: Uint8Array): void {
    this.esp.feed(bytes, this.#baudRate);
    const answer = this.esp.take();
    if (answer.length > 0) this.onBytes(answer);
  }

  /** Two transistors: RTS without DTR holds it in reset, DTR without RTS pulls its BOOT pin low. */
  signals(dtr: boolean, rts: boolean): void {
    this.#lines = [dtr, rts];
    const wasHeld = this.#isHeld;
    this.#isHeld = rts && !dtr;
    if (!wasHeld || this.#isHeld) return;
    setTimeout(() => {
      const [pulls = false, resets = false] = this.#lines;
      this.esp.reset(this.hasBootCircuit && pulls && !resets);
    }, RESET_RISE_MS);
  }

  reset(): void {
    // `signals` knows more.
  }

  stop(): void {
    this.robot.stop();
  }
}
