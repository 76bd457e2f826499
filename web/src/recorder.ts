// The calls on a simulator with their times, as lines of JSON: the same run again, elsewhere.
import type { Simulator } from "./simulator.js";

function hex(bytes: Uint8Array): string {
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** A simulator that records what it is asked, and what it answers. */
export class Recorder implements Simulator {
  readonly lines: string[] = [];

  constructor(
    readonly simulator: Simulator,
    seed: number,
  ) {
    this.#put("seed", { seed });
  }

  get nowUs(): number {
    return this.simulator.nowUs;
  }

  advance(us: number): void {
    this.#put("advance", { us });
    this.simulator.advance(us);
  }

  write(bytes: Uint8Array): void {
    this.#put("write", { bytes: hex(bytes) });
    this.simulator.write(bytes);
  }

  read(): Uint8Array {
    const bytes = this.simulator.read();
    const [left, right] = [this.get("true.left_ticks"), this.get("true.right_ticks")];
    this.#put("read", { bytes: hex(bytes), state: this.get("state"), ticks: [left, right] });
    return bytes;
  }

  set(name: string, value: number): void {
    this.#put("set", { name, value });
    this.simulator.set(name, value);
  }

  get(name: string): number {
    return this.simulator.get(name);
  }

  #put(call: string, details: object): void {
    this.lines.push(JSON.stringify({ t: this.nowUs, call, ...details }));
  }
}
