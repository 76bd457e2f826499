// The layout of a chip's flash: what an image consists of, and what writing it keeps. Sans-IO.
// The same as host/wheelwire/tools/flash.py.
import { WheelwireError } from "../errors.js";
import { Chip } from "../generated/protocol.js";
import { FLASH } from "../generated/words.js";
import { fill } from "../text.js";
import { hex, md5 } from "./md5.js";

/** Of flash: where the last partition of an image ends. */
export const NEEDED_BYTES = 4 << 20;
/** Where ESP-IDF's tools put the table by default, and the most that it takes up there. */
export const TABLE_OFFSET = 0x8000;
export const TABLE_BYTES = 0xc00;

const ERASED = 0xff;
const IMAGE_MAGIC = 0xe9;
const CHIP_ID_OFFSET = 12;
/** Offset of the boot loader, and the chip ids that its header may contain there. */
const BOOTLOADERS: readonly (readonly [offset: number, ids: Readonly<Record<number, number>>])[] = [
  [0x1000, { 0: Chip.ESP32 }],
  [0, { 9: Chip.ESP32S3, 13: Chip.ESP32C6 }],
];
const ENTRY_BYTES = 32;
const ENTRY_MAGIC = 0x50aa;
/** Marks the checksum instead of an entry: 14 bytes of 0xff follow, then the MD5 of all entries before. */
const DIGEST_MAGIC = 0xebeb;
const APPLICATION = 0;
const DATA = 1;
/** The subtype of the data that selects the application which the boot loader starts. */
const OTADATA = 0;

/** Nothing was flashed, or the chip's content is wrong. */
export class FlashFailed extends WheelwireError {
  override name = "FlashFailed";
}

/** One entry of a partition table; offset and size in bytes. */
export interface Partition {
  readonly name: string;
  readonly kind: number;
  readonly subtype: number;
  readonly offset: number;
  readonly size: number;
}

/** Bytes and their offset in flash. */
export interface Part {
  readonly name: string;
  readonly offset: number;
  readonly content: Uint8Array;
}

/** A merged image, split into the parts to write, and its partition table. */
export interface Image {
  readonly name: string;
  /** As in Chip. */
  readonly chip: number;
  readonly parts: readonly Part[];
  readonly table: readonly Partition[];
}

/** What flashing does to a chip. */
export interface Plan {
  /** In order of their offsets. A region is erased by writing 0xff. */
  readonly writes: readonly Part[];
  /** Names of the data partitions whose content stays on the chip. */
  readonly kept: readonly string[];
  /** The regions of data partitions with foreign content, as parts of 0xff. */
  readonly erased: readonly Part[];
  /** Why they are erased; empty if none is. */
  readonly reason: string;
}

function endOf(one: { readonly offset: number; readonly size: number }): number {
  return one.offset + one.size;
}

/** Whether it holds data of the user or the firmware, rather than a part of the image. */
function holdsData(one: Partition): boolean {
  return one.kind !== APPLICATION && !isOtadata(one);
}

function isOtadata(one: Partition): boolean {
  return one.kind === DATA && one.subtype === OTADATA;
}

/** The partitions of a table; none if it is not a table or is damaged. */
export function parseTable(raw: Uint8Array): Partition[] {
  const found: Partition[] = [];
  const view = new DataView(raw.buffer, raw.byteOffset, raw.length);
  for (let at = 0; at + ENTRY_BYTES <= Math.min(raw.length, TABLE_BYTES); at += ENTRY_BYTES) {
    const magic = view.getUint16(at, true);
    if (magic !== ENTRY_MAGIC) {
      // The digest, or erased flash: no entry follows. With wrong offsets foreign bytes would be
      // kept as our data.
      const isDamaged = hex(md5(raw.subarray(0, at))) !== hex(raw.subarray(at + 16, at + 32));
      if (magic === DIGEST_MAGIC && isDamaged) return [];
      break;
    }
    const label = new TextDecoder().decode(raw.subarray(at + 12, at + 28));
    found.push({
      name: label.split("\0")[0] ?? "",
      kind: view.getUint8(at + 2),
      subtype: view.getUint8(at + 3),
      offset: view.getUint32(at + 4, true),
      size: view.getUint32(at + 8, true),
    });
  }
  return found;
}

/** Without the filling up to the next part: erased flash is 0xff anyway. */
function trimmed(content: Uint8Array): Uint8Array {
  let end = content.length;
  while (end > 0 && content[end - 1] === ERASED) end--;
  return content.subarray(0, end);
}

/**
 * Split a merged image into its parts.
 *
 * @throws FlashFailed It is not an image for a supported chip.
 */
export function readImage(name: string, content: Uint8Array): Image {
  const table = parseTable(content.subarray(TABLE_OFFSET, TABLE_OFFSET + TABLE_BYTES));
  const applications = table
    // A slot that the image leaves empty is erased there, or lies beyond its end.
    .filter((one) => one.kind === APPLICATION && content[one.offset] === IMAGE_MAGIC)
    .map((one) => partOf(one, trimmed(content.subarray(one.offset, endOf(one)))));
  const bootloader = bootloaderOf(content);
  if (applications.length === 0 || bootloader === undefined) {
    throw new FlashFailed(fill(FLASH.notAnImage, name));
  }
  const { chip, offset } = bootloader;
  // Erased, it selects no slot: the boot loader starts the first one, which the image fills.
  const otadata = table.filter(isOtadata).map((one) => partOf(one, erased(one.size)));
  const parts = [
    { name: "bootloader", offset, content: trimmed(content.subarray(offset, TABLE_OFFSET)) },
    {
      name: "partition table",
      offset: TABLE_OFFSET,
      content: content.subarray(TABLE_OFFSET, TABLE_OFFSET + TABLE_BYTES),
    },
    ...otadata,
    ...applications,
  ];
  return { name, chip, parts, table };
}

function partOf({ name, offset }: Partition, content: Uint8Array): Part {
  return { name, offset, content };
}

function erased(size: number): Uint8Array {
  return new Uint8Array(size).fill(ERASED);
}

/**
 * Plan what writing an image changes on a chip with that partition table.
 *
 * A data partition stays where the chip has one of the same kind at the same offset. The rest of it
 * held something else, such as another firmware's code, which must not be read as data.
 */
export function planFlash(image: Image, chipTable: readonly Partition[]): Plan {
  const data = image.table.filter(holdsData);
  const gone = data
    .map((one) => ({ one, from: validUntil(one, chipTable) }))
    .filter(({ one, from }) => from < endOf(one))
    .map(({ one, from }) => ({ name: one.name, offset: from, content: erased(endOf(one) - from) }));
  const reason = chipTable.length > 0 ? "another partition table" : "no partition table";
  return {
    writes: [...image.parts, ...gone].sort((one, other) => one.offset - other.offset),
    kept: data.filter((one) => validUntil(one, chipTable) > one.offset).map((one) => one.name),
    erased: gone,
    reason: gone.length > 0 ? `the chip has ${reason}` : "",
  };
}

/** The offset up to which the chip holds valid content of a partition. */
function validUntil(wanted: Partition, chipTable: readonly Partition[]): number {
  // Only at the same offset: NVS, for example, can only be read from its beginning.
  const onChip = chipTable.find(
    ({ kind, subtype, offset }) =>
      kind === wanted.kind && subtype === wanted.subtype && offset === wanted.offset,
  );
  // The one on the chip may end sooner: what follows it there was never ours.
  return onChip === undefined ? wanted.offset : Math.min(endOf(onChip), endOf(wanted));
}

/** The chip that an image is for, and the offset of its boot loader. */
function bootloaderOf(content: Uint8Array): { chip: number; offset: number } | undefined {
  // The chip id alone proves nothing: another chip's boot loader may be at another offset.
  for (const [offset, ids] of BOOTLOADERS) {
    const at = offset + CHIP_ID_OFFSET;
    const chip = ids[(content[at] ?? ERASED) | ((content[at + 1] ?? ERASED) << 8)];
    if (content[offset] === IMAGE_MAGIC && chip !== undefined) return { chip, offset };
  }
  return undefined;
}

/** The plan, in sentences. */
export function describe(plan: Plan): string[] {
  const lines = [`keeps the data in: ${plan.kept.join(", ") || "nothing"}`];
  if (plan.erased.length > 0) {
    const regions = plan.erased.map(
      ({ name, offset, content }) =>
        `${name} 0x${offset.toString(16)} to 0x${(offset + content.length).toString(16)}`,
    );
    lines.push(`erases ${regions.join(", ")}: ${plan.reason}`);
  }
  return lines;
}
