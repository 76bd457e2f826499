// The line between program and robot: it carries bytes, loses all of them, or damages some.
import type { Random } from "./random.js";

export class Cable {
  pulled = false;
  /** The share of the bytes that become others. */
  corruption = 0;
  /** Bytes that became others. */
  damaged = 0;

  constructor(readonly random: Random) {}

  carry(bytes: Uint8Array): Uint8Array {
    if (this.pulled) return new Uint8Array();
    if (this.corruption === 0) return bytes;
    return bytes.map((byte) => {
      if (this.random.unit() >= this.corruption) return byte;
      this.damaged++;
      return byte ^ (1 + Math.floor(this.random.unit() * 255));
    });
  }
}
