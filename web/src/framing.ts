// Frames on the wire: a delimiter on both sides, COBS between them, a CRC-32 inside. Sans-IO.
import { CRC_RESIDUE, MIN_PAYLOAD, crc32, decodePayload, encodePayload, type Message, type Name } from "./codec.js";
import { MAX_PAYLOAD, type Messages } from "./generated/protocol.js";

const MAX_ENCODED = MAX_PAYLOAD + 1;
const SEQ_MODULUS = 1 << 16;
/** A frame at most this far behind is late or a repeat; further behind, the sender restarted. */
const REPEAT_WINDOW = 64;

const COUNTED = { frames: 0, bad_crc: 0, bad_cobs: 0, unknown_id: 0, wrong_length: 0, seq_lost: 0, repeated: 0 };

/** What a decoder has seen. Every chunk that is dropped is counted here. */
export type Counters = typeof COUNTED;

/** COBS of a payload of at most 253 bytes, with its delimiters. */
export function frameOf(payload: Uint8Array): Uint8Array {
  const frame = new Uint8Array(payload.length + 3);
  let code = 1;
  let distance = 1;
  for (const byte of payload) {
    if (byte === 0) {
      frame[code] = distance;
      code += distance;
      distance = 1;
    } else {
      frame[code + distance] = byte;
      distance++;
    }
  }
  frame[code] = distance;
  return frame;
}

/** Decode the COBS of a chunk without zeros; undefined if it is not valid. */
function unstuff(chunk: Uint8Array): Uint8Array | undefined {
  const payload = chunk.slice();
  let at = 0;
  while (at < payload.length) {
    const code = payload[at] ?? 0;
    payload[at] = 0;
    at += code;
  }
  return at === payload.length ? payload.subarray(1) : undefined;
}

/** Encodes messages to frames, each with the next sequence number. */
export class Encoder {
  encoded = 0;

  /** @throws RangeError A field does not fit its type; then no number is used up. */
  encode<N extends Name>(name: N, fields: Messages[N]): Uint8Array {
    const frame = frameOf(encodePayload(name, fields, this.encoded % SEQ_MODULUS));
    this.encoded++;
    return frame;
  }
}

/** Decodes bytes, cut anywhere, to messages. */
export class Decoder {
  readonly counters: Counters = { ...COUNTED };
  readonly #partial = new Uint8Array(MAX_ENCODED);
  #size = 0;
  #overlong = false;
  #expected: number | undefined;
  /** Frames so far, including missing ones: `#missing` counts in it. */
  #position = 0;
  #missing = new Set<number>();

  /** The messages of the frames that `data` completes, in order. */
  feed(data: Uint8Array): Message[] {
    const messages: Message[] = [];
    for (const byte of data) {
      if (byte !== 0) {
        this.#add(byte);
        continue;
      }
      if (this.#size > 0 && !this.#overlong) this.#take(messages);
      this.#size = 0;
      this.#overlong = false;
    }
    return messages;
  }

  /** Accept any sequence number next, because the sender has restarted. */
  restartSequence(): void {
    this.#expected = undefined;
  }

  /** Forget a partial frame and the sequence: the line was reopened. Keeps the counters. */
  restart(): void {
    this.#size = 0;
    this.#overlong = false;
    this.restartSequence();
  }

  #add(byte: number): void {
    if (this.#size < MAX_ENCODED) {
      this.#partial[this.#size++] = byte;
    } else if (!this.#overlong) {
      // Counted here, not at its end: a line without delimiters is to be noticed, too.
      this.#overlong = true;
      this.counters.bad_cobs++;
    }
  }

  #take(messages: Message[]): void {
    const payload = unstuff(this.#partial.subarray(0, this.#size));
    if (payload === undefined || payload.length < MIN_PAYLOAD) {
      this.counters.bad_cobs++;
      return;
    }
    if (crc32(payload) !== CRC_RESIDUE) {
      this.counters.bad_crc++;
      return;
    }
    this.#countGap((payload[1] ?? 0) | ((payload[2] ?? 0) << 8));
    const message = decodePayload(payload);
    if (typeof message === "string") {
      this.counters[message]++;
    } else {
      this.counters.frames++;
      messages.push(message);
    }
  }

  #countGap(seq: number): void {
    const expected = this.#expected;
    const ahead = expected === undefined ? 0 : (seq - expected + SEQ_MODULUS) % SEQ_MODULUS;
    const behind = SEQ_MODULUS - ahead;
    if (expected !== undefined && behind <= REPEAT_WINDOW) {
      if (this.#missing.delete(this.#position - behind)) this.counters.seq_lost--;
      else this.counters.repeated++;
      return;
    }
    if (expected === undefined || ahead >= SEQ_MODULUS / 2) {
      // The sender restarted: frames that were missing before can no longer arrive late.
      this.#missing.clear();
    } else {
      this.counters.seq_lost += ahead;
      for (let lost = Math.max(0, ahead - REPEAT_WINDOW); lost < ahead; lost++) {
        this.#missing.add(this.#position + lost);
      }
      this.#position += ahead;
    }
    this.#position++;
    this.#expected = (seq + 1) % SEQ_MODULUS;
    for (const lost of this.#missing) {
      if (lost >= this.#position - REPEAT_WINDOW) break;
      this.#missing.delete(lost);
    }
  }
}
