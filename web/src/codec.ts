// Messages to and from payload bytes, by the generated layouts: `id u8, seq u16, body, crc u32`,
// little-endian and packed.
import { LAYOUTS, type Messages } from "./generated/protocol.js";

export type Name = keyof Messages;

/** A message with its name, which tells the type of its fields. */
export type Message = { [N in Name]: { readonly name: N; readonly fields: Messages[N] } }[Name];

export const HEADER_SIZE = 3;
export const CRC_SIZE = 4;
export const MIN_PAYLOAD = HEADER_SIZE + CRC_SIZE;
/** CRC-32 of any payload followed by its own CRC-32: one call checks it. */
export const CRC_RESIDUE = 0x2144df1c;

type Value = number | bigint | Uint8Array;
type Fields = Record<string, Value>;

interface Field {
  readonly name: string;
  readonly size: number;
  readonly put: (view: DataView, at: number, value: Value) => void;
  readonly get: (view: DataView, at: number) => Value;
}

interface Layout {
  readonly name: Name;
  readonly id: number;
  readonly fields: readonly Field[];
  /** Bytes of the whole payload. */
  readonly size: number;
}

const INTEGER_BITS: Readonly<Record<string, number>> = { b: 8, h: 16, l: 32, i: 32 };

function integer(name: string, format: string, bits: number): Field {
  const signed = format === format.toLowerCase();
  const least = signed ? -(2 ** (bits - 1)) : 0;
  const greatest = 2 ** (signed ? bits - 1 : bits) - 1;
  const kind = `${signed ? "Int" : "Uint"}${bits}` as "Int8" | "Int16" | "Uint16" | "Int32";
  return {
    name,
    size: bits / 8,
    put(view, at, value) {
      // A DataView would wrap it: a number that does not fit must not become another one.
      if (!Number.isInteger(value) || Number(value) < least || Number(value) > greatest) {
        throw new RangeError(`${name} is ${String(value)}: give a whole number of ${bits} bits`);
      }
      view[`set${kind}`](at, Number(value), true);
    },
    get: (view, at) => view[`get${kind}`](at, true),
  };
}

function wide(name: string, format: string): Field {
  return {
    name,
    size: 8,
    put(view, at, value) {
      const fits = format === "Q" ? BigInt.asUintN(64, value as bigint) : BigInt.asIntN(64, value as bigint);
      if (fits !== value) throw new RangeError(`${name} is ${String(value)}: it has 64 bits`);
      view.setBigUint64(at, BigInt.asUintN(64, value), true);
    },
    get: (view, at) => (format === "Q" ? view.getBigUint64(at, true) : view.getBigInt64(at, true)),
  };
}

function real(name: string): Field {
  return {
    name,
    size: 4,
    put(view, at, value) {
      if (Number.isFinite(value) && !Number.isFinite(Math.fround(Number(value)))) {
        throw new RangeError(`${name} is ${String(value)}: too large for 32 bits`);
      }
      view.setFloat32(at, Number(value), true);
    },
    get: (view, at) => view.getFloat32(at, true),
  };
}

function text(name: string, size: number): Field {
  return {
    name,
    size,
    put(view, at, value) {
      const bytes = value as Uint8Array;
      if (bytes.length > size) throw new RangeError(`${name} has more than ${size} bytes`);
      new Uint8Array(view.buffer, view.byteOffset + at, size).set(bytes);
    },
    get: (view, at) => new Uint8Array(view.buffer, view.byteOffset + at, size).slice(),
  };
}

function field(definition: string): Field {
  const [name = "", format = ""] = definition.split(":");
  const bits = INTEGER_BITS[format.toLowerCase()];
  if (bits !== undefined) return integer(name, format, bits);
  if (format === "f") return real(name);
  return format.endsWith("s") ? text(name, Number.parseInt(format, 10)) : wide(name, format);
}

function layout(name: Name): Layout {
  const [id, definition] = LAYOUTS[name];
  const fields = definition.split(" ").map(field);
  const body = fields.reduce((sum, one) => sum + one.size, 0);
  return { name, id, fields, size: MIN_PAYLOAD + body };
}

const BY_NAME = new Map((Object.keys(LAYOUTS) as Name[]).map((name) => [name, layout(name)]));
const BY_ID = new Map([...BY_NAME.values()].map((one) => [one.id, one]));

/** The id byte of a message. */
export function idOf(name: Name): number {
  return LAYOUTS[name][0];
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let bit = 0; bit < 8; bit++) value = value & 1 ? (value >>> 1) ^ 0xedb88320 : value >>> 1;
  return value >>> 0;
});

/** Some bytes after each other. */
export function joined(parts: readonly Uint8Array[]): Uint8Array {
  const bytes = new Uint8Array(parts.reduce((total, part) => total + part.length, 0));
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}

/** CRC-32 as in zlib. */
export function crc32(data: Uint8Array): number {
  let register = 0xffffffff;
  for (const byte of data) register = (register >>> 8) ^ (CRC_TABLE[(register ^ byte) & 0xff] ?? 0);
  return (register ^ 0xffffffff) >>> 0;
}

/**
 * The payload of a message.
 *
 * @throws RangeError A field does not fit its type.
 */
export function encodePayload<N extends Name>(name: N, fields: Messages[N], seq: number): Uint8Array {
  const { id, fields: definitions, size } = BY_NAME.get(name) as Layout;
  const payload = new Uint8Array(size);
  const view = new DataView(payload.buffer);
  view.setUint8(0, id);
  view.setUint16(1, seq, true);
  let at = HEADER_SIZE;
  for (const one of definitions) {
    one.put(view, at, (fields as unknown as Fields)[one.name] as Value);
    at += one.size;
  }
  view.setUint32(at, crc32(payload.subarray(0, at)), true);
  return payload;
}

/** What is wrong with a payload whose CRC is right. */
export type Problem = "unknown_id" | "wrong_length";

/** The message of a payload whose CRC was checked. */
export function decodePayload(payload: Uint8Array): Message | Problem {
  const known = BY_ID.get(payload[0] ?? 0);
  if (known === undefined) return "unknown_id";
  if (payload.length !== known.size) return "wrong_length";
  const view = new DataView(payload.buffer, payload.byteOffset, payload.length);
  const fields: Fields = {};
  let at = HEADER_SIZE;
  for (const one of known.fields) {
    fields[one.name] = one.get(view, at);
    at += one.size;
  }
  return { name: known.name, fields: fields as unknown } as Message;
}
