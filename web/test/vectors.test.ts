// The vectors of protocol/vectors/, which every language has to pass: built by plain construct, or by
// hand from SPEC.md.
import { readFileSync } from "node:fs";
import { describe, expect, test } from "vitest";
import { encodePayload, type Name } from "../src/codec.js";
import { Decoder, frameOf } from "../src/framing.js";
import { LAYOUTS } from "../src/generated/protocol.js";

interface FrameVector {
  readonly name: string;
  readonly message: string;
  readonly seq: number;
  readonly fields: Readonly<Record<string, number | string>>;
  readonly payload: string;
  readonly frame: string;
}

interface StreamVector {
  readonly name: string;
  readonly bytes: readonly string[];
  readonly delivered: readonly { message: string; fields: Record<string, number | string> }[];
  readonly counters: Readonly<Record<string, number>>;
}

interface Vectors {
  readonly frames: readonly FrameVector[];
  readonly streams?: readonly StreamVector[];
}

/** The vectors of a file. A number of 64 bits becomes text, for JSON.parse would round it. */
function load(name: string): Vectors {
  const text = readFileSync(new URL(`../../protocol/vectors/${name}.json`, import.meta.url), "utf8");
  return JSON.parse(text.replaceAll(/: (-?\d{16,})(?=[,}])/g, ': "$1"')) as Vectors;
}

function bytesOf(hex: string): Uint8Array {
  return Uint8Array.from(hex.match(/[0-9a-f]{2}/g) ?? [], (digits) => Number.parseInt(digits, 16));
}

function hexOf(bytes: Uint8Array): string {
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** Fields as the codec has them. */
function fieldsOf(message: string, fields: Readonly<Record<string, number | string>>): unknown {
  const formats = new Map(
    LAYOUTS[message as Name][1].split(" ").map((field) => field.split(":") as [string, string]),
  );
  return Object.fromEntries(
    Object.entries(fields).map(([name, value]) => {
      const format = formats.get(name) ?? "";
      if (format.endsWith("s")) return [name, bytesOf(String(value))];
      return [name, /[qQ]/.test(format) ? BigInt(value) : value];
    }),
  );
}

/** Comparable text of a decoded message. */
function textOf(message: string, fields: unknown): string {
  const text = JSON.stringify(fields, (_, value: unknown) => {
    if (typeof value === "bigint") return String(value);
    return value instanceof Uint8Array ? hexOf(value) : value;
  });
  return `${message} ${text}`;
}

/** What the codec does otherwise than the frames of these vectors. */
function checkFrames({ frames }: Vectors): string[] {
  const differences: string[] = [];
  for (const vector of frames) {
    const label = `${vector.message}, ${vector.name}`;
    const fields = fieldsOf(vector.message, vector.fields);
    const payload = encodePayload(vector.message as Name, fields as never, vector.seq);
    const [frame, expected] = [hexOf(frameOf(payload)), vector.frame.replaceAll(" ", "")];
    if (frame !== expected) differences.push(`${label}: encoded ${frame}, not ${expected}`);
    const decoded = new Decoder().feed(bytesOf(vector.frame));
    const texts = decoded.map((one) => textOf(one.name, one.fields)).join("; ");
    if (texts !== textOf(vector.message, fields)) differences.push(`${label}: decoded ${texts}`);
  }
  return differences;
}

/** What the decoder does otherwise than the streams of these vectors, in one piece and by byte. */
function checkStreams({ streams = [] }: Vectors): string[] {
  return streams.flatMap((vector) => [
    ...checkStream(vector, vector.bytes.map(bytesOf)),
    ...checkStream(vector, [...bytesOf(vector.bytes.join(" "))].map((byte) => Uint8Array.of(byte))),
  ]);
}

function checkStream(vector: StreamVector, pieces: readonly Uint8Array[]): string[] {
  const decoder = new Decoder();
  const decoded = pieces.flatMap((piece) => decoder.feed(piece));
  const texts = decoded.map((one) => textOf(one.name, one.fields)).join("; ");
  const expected = vector.delivered
    .map((one) => textOf(one.message, fieldsOf(one.message, one.fields)))
    .join("; ");
  const differences = texts === expected ? [] : [`${vector.name}: decoded ${texts}`];
  for (const [name, count] of Object.entries(decoder.counters)) {
    const right = vector.counters[name] ?? 0;
    if (count !== right) differences.push(`${vector.name}: ${name} is ${count}, not ${right}`);
  }
  return differences;
}

describe.each(["generated", "handmade"])("%s vectors", (name) => {
  const vectors = load(name);

  test("frames are encoded and decoded", () => {
    expect(vectors.frames.length).toBeGreaterThan(0);
    expect(checkFrames(vectors)).toEqual([]);
  });

  test("streams are cut into frames, and counted", () => {
    expect(checkStreams(vectors)).toEqual([]);
  });
});

test("the check notices a wrong vector", () => {
  const vectors = load("handmade");
  const [frame] = vectors.frames;
  if (frame === undefined) throw new Error("no vector");
  const wrong = { ...frame, fields: { ...frame.fields, mode: 1 } };
  expect(checkFrames({ frames: [wrong] })).toHaveLength(2);
});
