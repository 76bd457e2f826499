// The line between program and simulated robot: it carries bytes, loses them, or damages some.
import type { Random } from "./random.js";
import type { Transport } from "./serial/port.js";
import type { Simulator } from "./simulator.js";

/** What waits for a program that hangs, as in a computer's buffer. */
const BUFFER_SIZE = 1 << 16;

export class Cable implements Transport {
  pulled = false;
  /** The share of the bytes that become others. */
  corruption = 0;
  #waiting: number[] = [];

  constructor(
    readonly simulator: Simulator,
    readonly random: Random,
  ) {}

  /** Take what the robot sends, as it sends it. */
  advance(): Uint8Array {
    const sent = this.simulator.read();
    const came = this.#carry(sent);
    if (this.#waiting.length + came.length <= BUFFER_SIZE) this.#waiting.push(...came);
    return sent;
  }

  take(): Uint8Array {
    return Uint8Array.from(this.#waiting.splice(0));
  }

  write(bytes: Uint8Array): void {
    const arrived = this.#carry(bytes);
    if (arrived.length > 0) this.simulator.write(arrived);
  }

  #carry(bytes: Uint8Array): Uint8Array {
    if (this.pulled) return new Uint8Array();
    if (this.corruption === 0) return bytes;
    return bytes.map((byte) => {
      if (this.random.unit() >= this.corruption) return byte;
      return byte ^ (1 + Math.floor(this.random.unit() * 255));
    });
  }
}
