// Merged firmware images as ESP-IDF makes them, with an application of a few kilobytes.
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { md5 } from "../src/flash/md5.js";
import { Random } from "../src/random.js";
import type { ChipKind } from "./chip.js";

const TABLE_OFFSET = 0x8000;
const PARTITIONS = new URL("../../firmware/esp32/partitions.csv", import.meta.url);
const TYPES: Readonly<Record<string, number>> = { app: 0, data: 1 };
const SUBTYPES: Readonly<Record<string, number>> = {
  factory: 0,
  ota_0: 0x10,
  ota_1: 0x11,
  ota: 0,
  phy: 1,
  nvs: 2,
  coredump: 3,
  undefined: 6,
};

export interface Row {
  readonly name: string;
  readonly type: string;
  readonly subtype: string;
  readonly offset: number;
  readonly size: number;
}

/** The partitions in partitions.csv. */
export const OUR_LAYOUT: readonly Row[] = readFileSync(PARTITIONS, "utf8")
  .split("\n")
  .filter((line) => line !== "" && !line.startsWith("#"))
  .map((line) => {
    const [name = "", type = "", subtype = "", offset, size] = line.split(",").map((cell) => cell.trim());
    return { name, type, subtype, offset: Number(offset), size: Number(size) };
  });

/** ESP-IDF's own default, which a board of another firmware has. */
export const FACTORY_LAYOUT: readonly Row[] = [
  { name: "nvs", type: "data", subtype: "nvs", offset: 0x9000, size: 0x6000 },
  { name: "phy_init", type: "data", subtype: "phy", offset: 0xf000, size: 0x1000 },
  { name: "factory", type: "app", subtype: "factory", offset: 0x10000, size: 0x100000 },
];

/** A partition table as stored in flash, with its digest. */
export function tableBytes(rows: readonly Row[]): Uint8Array {
  const table = Buffer.alloc(0xc00, 0xff);
  rows.forEach(({ name, type, subtype, offset, size }, index) => {
    const entry = Buffer.alloc(32);
    entry.set([0xaa, 0x50, TYPES[type] ?? 0, SUBTYPES[subtype] ?? 0]);
    entry.writeUInt32LE(offset, 4);
    entry.writeUInt32LE(size, 8);
    entry.write(name, 12, "ascii");
    table.set(entry, 32 * index);
  });
  const end = 32 * rows.length;
  table.set([0xeb, 0xeb], end);
  table.set(md5(table.subarray(0, end)), end + 16);
  return table;
}

/** A program as esptool takes it: header, one segment, checksum and hash. */
export function program(kind: ChipKind, size: number, seed: number): Uint8Array {
  const random = new Random(seed);
  const content = Uint8Array.from({ length: size & ~3 }, () => random.bits() & 0xff);
  const header = Buffer.alloc(32);
  header.set([0xe9, 1, 2, 0x20]);
  header.writeUInt32LE(0x40080000, 4);
  header.writeUInt16LE(kind.chipId, 12);
  header[23] = 1; // a hash follows
  header.writeUInt32LE(0x3fff0000, 24);
  header.writeUInt32LE(content.length, 28);
  const padded = Math.ceil((header.length + content.length + 1) / 16) * 16;
  const image = Buffer.alloc(padded);
  image.set(header);
  image.set(content, header.length);
  image[padded - 1] = content.reduce((sum, byte) => sum ^ byte, 0xef);
  return Buffer.concat([image, createHash("sha256").update(image).digest()]);
}

/** Boot loader, table and one application, 0xff between them. */
export function mergedImage(kind: ChipKind, seed = 1, size = 9001): Uint8Array {
  const start = Math.min(...OUR_LAYOUT.filter(({ type }) => type === "app").map(({ offset }) => offset));
  const application = program(kind, size, seed);
  const content = new Uint8Array(start + application.length).fill(0xff);
  content.set(program(kind, 5003, seed + 1), kind.bootloader);
  content.set(tableBytes(OUR_LAYOUT), TABLE_OFFSET);
  content.set(application, start);
  return content;
}
