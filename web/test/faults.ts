// What a line does to what is sent on it.
import type { Random } from "../src/random.js";

/** What comes of some bytes. */
export type Fault = (bytes: Uint8Array, random: Random) => Uint8Array;
export const sound: Fault = (bytes) => bytes;

export const FAULTS: readonly (readonly [string, Fault])[] = [
  ["bits flip", (bytes, random) => bytes.map((byte) => (random.unit() < 0.01 ? byte ^ (1 << Math.floor(random.unit() * 8)) : byte))],
  ["every byte is another", (bytes) => bytes.map((byte) => byte ^ 0x5a)],
  ["bytes are lost", (bytes, random) => bytes.filter(() => random.unit() > 0.02)],
  ["chunks are lost", (bytes, random) => (random.unit() < 0.2 ? new Uint8Array() : bytes)],
  ["all is lost", () => new Uint8Array()],
  ["bytes come twice", (bytes, random) => Uint8Array.from([...bytes].flatMap((byte) => (random.unit() < 0.02 ? [byte, byte] : [byte])))],
  ["chunks come twice", (bytes) => Uint8Array.from([...bytes, ...bytes])],
  ["noise comes between", (bytes, random) => Uint8Array.from([...bytes, ...Array.from({ length: 5 }, () => Math.floor(random.unit() * 256))])],
  ["delimiters are lost", (bytes) => bytes.filter((byte) => byte !== 0)],
  ["delimiters come between", (bytes, random) => Uint8Array.from([...bytes].flatMap((byte) => (random.unit() < 0.05 ? [0, byte] : [byte])))],
];
