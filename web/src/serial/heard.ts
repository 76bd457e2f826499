// What comes from a port at which no robot answers: a chip's text, other bytes, or nothing.

/** Bytes that are searched together, because a text may arrive in parts. */
const TAIL = 512;
const LINE = /[ -~]{16,}/g;
const KNOWN: readonly (readonly [RegExp, string])[] = [
  [/brown-?out/i, "the chip's supply dips each time it starts: use a short, thick cable, and disconnect the motors meanwhile."],
  [/waiting for download|DOWNLOAD/, "the chip waits for a download: release BOOT and press EN (reset)."],
  [/invalid header|flash read err|No bootable app|csum err/, "the chip has no firmware: flash it."],
  [/Guru Meditation|abort\(\) was called/, "the firmware on the chip crashes as it starts: flash it anew."],
];

export class Heard {
  #count = 0;
  #tail = "";
  #bytes = new Uint8Array();
  /** The meaning of the newest text, or the text itself. */
  #text: string | undefined;

  /** Note what came, and pass it on. */
  note(bytes: Uint8Array): Uint8Array {
    if (bytes.length === 0) return bytes;
    this.#count += bytes.length;
    this.#bytes = bytes.slice(0, 8);
    this.#tail = (this.#tail + String.fromCharCode(...bytes.subarray(-TAIL))).slice(-TAIL);
    return bytes;
  }

  /** What comes from now on is heard at another rate. */
  next(): void {
    const known = KNOWN.find(([pattern]) => pattern.test(this.#tail))?.[1];
    const line = this.#tail.match(LINE)?.at(-1)?.trim().slice(0, 80);
    this.#text = known ?? this.#text ?? (line && `what is there says “${line}”.`);
    this.#tail = "";
  }

  /** All of it in a sentence, after so many rates. */
  text(rates: number): string {
    this.next();
    if (this.#text !== undefined) return `No robot answers: ${this.#text}`;
    if (this.#count === 0) return `No robot answers: nothing came at ${rates} baud rates.`;
    const hex = Array.from(this.#bytes, (byte) => byte.toString(16).padStart(2, "0")).join(" ");
    return `No robot answers: ${this.#count} bytes came, such as ${hex}, and no frame of a robot; a lidar sounds like that.`;
  }
}
