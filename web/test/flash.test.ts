// esptool-js and the steps of `wheelwire flash` against a stand-in for a board and its flash.
import { execFile } from "node:child_process";
import { createHash } from "node:crypto";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";
import { describe, expect, test as sequential, vi } from "vitest";
import { flashChip, type Person } from "../src/flash/flash.js";
import { FlashFailed, NEEDED_BYTES, readImage, type Image } from "../src/flash/image.js";
import { md5 } from "../src/flash/md5.js";
import { releaseImage } from "../src/flash/release.js";
import { Chip } from "../src/generated/protocol.js";
import { Random } from "../src/random.js";
import { BoardPort } from "./board.js";
import { ESP32, ESP32C3, ESP32C6, ESP32S3, EspChip, type ChipKind } from "./chip.js";
import { FACTORY_LAYOUT, OUR_LAYOUT, mergedImage, tableBytes } from "./image.js";

const PYTHON = fileURLToPath(new URL("../../.venv/bin/python", import.meta.url));
const OTADATA_AT = 0x11000;
const IMAGE = mergedImage(ESP32);

/** They mostly wait, as esptool-js does for a chip. */
const test = sequential.concurrent;
const SILENT = { feed: () => undefined, take: () => new Uint8Array(), reset: () => undefined };

/** A person who does nothing but read. */
class Reader implements Person {
  readonly said: string[] = [];
  fraction = 0;
  asked = 0;
  onAsked: () => boolean = () => false;

  onSaid: () => unknown = () => undefined;

  say = (text: string): void => {
    this.onSaid();
    this.said.push(text);
  };
  progress = (fraction: number): void => {
    expect(fraction).toBeGreaterThanOrEqual(this.fraction);
    this.fraction = fraction;
  };
  holdBoot = (): Promise<boolean> => {
    this.asked++;
    return Promise.resolve(this.onAsked());
  };
}

/** A board with an earlier release of ours, or an empty one. */
function board(kind: ChipKind = ESP32, isEmpty = false, usb = false): { chip: EspChip; port: BoardPort; person: Reader } {
  const chip = new EspChip(kind, SILENT);
  if (!isEmpty) chip.flash.set(mergedImage(kind, 2, 12_345));
  return { chip, port: new BoardPort(chip, usb), person: new Reader() };
}

const ours = (kind: ChipKind, content = mergedImage(kind)) => (): Promise<Image> =>
  Promise.resolve(readImage("wheelwire-esp32.bin", content));

/** Something in every data partition of ours; returns what. */
function fillData(chip: EspChip): Map<string, Uint8Array> {
  const random = new Random(5);
  const held = new Map<string, Uint8Array>();
  for (const { name, type, subtype, offset, size } of OUR_LAYOUT) {
    if (type !== "data" || subtype === "ota") continue;
    const content = Uint8Array.from({ length: size }, () => random.bits() & 0xff);
    chip.flash.set(content, offset);
    held.set(name, content);
  }
  return held;
}

/** The image is in flash to the byte, and boots. */
async function holds(chip: EspChip, content: Uint8Array): Promise<void> {
  const app = 0x100000;
  const ranges = [[chip.kind.bootloader, 0x8000], [0x8000, 0x8c00], [app, content.length]] as const;
  for (const [start, end] of ranges) {
    expect(Buffer.compare(chip.flash.subarray(start, end), content.subarray(start, end))).toBe(0);
  }
  expect(chip.boots).toBe(true);
  expect(chip.application).toBe(app);
  await running(chip);
}

/** Its reset line rises slowly. */
function running(chip: EspChip): Promise<unknown> {
  return vi.waitUntil(() => !chip.isLoading);
}

test("what the chip saved is there afterwards, and the new application starts", async () => {
  const { chip, port, person } = board();
  const held = fillData(chip);
  const selected = Buffer.alloc(32, 0xff);
  selected.writeUInt32LE(2);
  chip.flash.set(selected, OTADATA_AT);
  chip.flash[0x280000] = 0xe9;
  expect(chip.application).toBe(0x280000);
  expect(await flashChip(port, ours(ESP32), person)).toBe(Chip.ESP32);
  expect(person.said).toEqual(["keeps the data in: nvs, recorder, coredump"]);
  for (const { name, offset, size } of OUR_LAYOUT) {
    const content = held.get(name);
    if (content !== undefined) {
      expect(Buffer.compare(chip.flash.subarray(offset, offset + size), content)).toBe(0);
    }
  }
  await holds(chip, IMAGE);
  expect(person.fraction).toBe(1);
  expect(port.readable).toBeNull();
});

test("another layout's leftovers are erased and named", async () => {
  const { chip, port, person } = board();
  fillData(chip);
  chip.flash.set(tableBytes(FACTORY_LAYOUT), 0x8000);
  const saved = chip.flash.slice(0x9000, 0xf000);
  await flashChip(port, ours(ESP32), person);
  expect(person.said).toEqual([
    "keeps the data in: nvs",
    "erases nvs 0xf000 to 0x11000, recorder 0x20000 to 0x70000, coredump 0x70000 to 0x90000: the chip has another partition table",
  ]);
  expect(Buffer.compare(chip.flash.subarray(0x9000, 0xf000), saved)).toBe(0);
  for (const [start, end] of [[0xf000, 0x13000], [0x20000, 0x90000]] as const) {
    expect(chip.flash.subarray(start, end).every((byte) => byte === 0xff)).toBe(true);
  }
  await holds(chip, IMAGE);
});

test.each([
  ["ESP32-S3", ESP32S3, Chip.ESP32S3],
  ["ESP32-C6", ESP32C6, Chip.ESP32C6],
])("an empty %s, by its own USB", async (_, kind, expected) => {
  const { chip, port, person } = board(kind, true, true);
  expect(await flashChip(port, ours(kind), person)).toBe(expected);
  expect(person.said[0]).toBe("keeps the data in: nothing");
  await holds(chip, mergedImage(kind));
});

test("esptool takes what is in flash for images of this chip", async () => {
  const { chip, port, person } = board(ESP32S3);
  await flashChip(port, ours(ESP32S3), person);
  const folder = mkdtempSync(join(tmpdir(), "wheelwire-image-"));
  for (const at of [0, 0x100000]) {
    const path = join(folder, `${at}.bin`);
    writeFileSync(path, chip.flash.subarray(at, at + (at === 0 ? 0x8000 : 0x180000)));
    const { stdout } = await promisify(execFile)(PYTHON, ["-m", "esptool", "image-info", path]);
    expect(stdout).toContain("Detected image type: ESP32-S3");
    expect(stdout).toMatch(/Checksum: 0x\w\w \(valid\)/);
    expect(stdout).toMatch(/Validation hash: \w{64} \(valid\)/);
  }
  rmSync(folder, { recursive: true });
});

describe("refusals, before anything is written", () => {
  async function refused(port: BoardPort, person: Reader, imageFor = ours(ESP32)): Promise<string> {
    const failure = await flashChip(port, imageFor, person).catch((error: unknown) => error);
    expect(failure).toBeInstanceOf(FlashFailed);
    expect(port.chip).toHaveProperty("writes", 0);
    expect(port.readable).toBeNull();
    return (failure as Error).message;
  }

  test("an image for another chip", async () => {
    const { port, person } = board(ESP32S3);
    expect(await refused(port, person)).toBe(
      "wheelwire-esp32.bin is for the ESP32, but the chip at this port is an ESP32S3: choose the release's wheelwire-esp32s3.bin",
    );
    await running(port.chip);
  });

  test("a chip without the peripherals", async () => {
    const { port, person } = board(ESP32C3);
    expect(await refused(port, person)).toContain("the chip at this port is an ESP32-C3, which is not supported");
  });

  test.each([
    [0x1540ef, "has 2 MB of flash"],
    [0x1340c8, "has 512 KB of flash"],
  ])("a module with too little flash, by name", async (flashId, told) => {
    const { chip, port, person } = board();
    chip.flashId = flashId;
    const message = await refused(port, person);
    expect(message).toContain(told);
    expect(message).toContain("the ESP32-D0WDQ6 at this port");
    expect(message).toContain("needs 4 MB");
  });

  test("a file that is no image", () => {
    expect(() => readImage("notes.bin", new Uint8Array(100_000))).toThrow(
      "notes.bin is not a Wheelwire firmware image for a supported chip; use wheelwire-<board>.bin from a release",
    );
  });

  test("a release's file that is not the one in its manifest", async () => {
    const content = mergedImage(ESP32);
    const sha256 = createHash("sha256").update(content).digest("hex");
    const files = new Map<string, Uint8Array>([
      ["firmware/wheelwire-esp32.bin", content],
      ["firmware/manifest.json", Buffer.from(JSON.stringify({ version: "0.1.0", images: [{ file: "wheelwire-esp32.bin", sha256 }] }))],
    ]);
    const load = (path: string): Promise<Response> => {
      const found = files.get(path);
      return Promise.resolve(found === undefined ? new Response(null, { status: 404 }) : new Response(found as BodyInit));
    };
    const { port, person } = board();
    expect((await releaseImage(Chip.ESP32, load)).chip).toBe(Chip.ESP32);
    content[content.length - 40] = (content[content.length - 40] ?? 0) ^ 1;
    const message = await refused(port, person, () => releaseImage(Chip.ESP32, load));
    expect(message).toMatch(/^wheelwire-esp32\.bin is not the file that the release names: its SHA-256 is [0-9a-f]{64}, not /);
    expect(await refused(board(ESP32C6).port, person, () => releaseImage(Chip.ESP32C6, load))).toContain(
      "wheelwire-esp32c6.bin is not beside this page",
    );
    files.clear();
    expect(await refused(board().port, person, () => releaseImage(Chip.ESP32, load))).toContain("is not beside this page");
  });
});

test("a larger flash and an unknown one are not refused", async () => {
  for (const flashId of [0x1840ef, 0x770000]) {
    const { chip, port, person } = board();
    chip.flashId = flashId;
    await flashChip(port, ours(ESP32), person);
    await holds(chip, IMAGE);
  }
});

describe("a board whose bridge sets its signals too slowly", () => {
  test("goes on once a person holds BOOT", async () => {
    const { chip, port, person } = board();
    port.signalMs = 30;
    person.onAsked = () => (port.isBootPressed = true);
    person.onSaid = () => (port.isBootPressed = false); // let go as soon as it writes
    await flashChip(port, ours(ESP32), person);
    expect(person.asked).toBe(1);
    await holds(chip, IMAGE);
  });

  test("or has reset it with BOOT held, where no line leads to its reset", async () => {
    const { chip, port, person } = board();
    port.setSignals = () => Promise.resolve();
    person.onAsked = () => {
      port.isBootPressed = true;
      port.pressReset();
      port.isBootPressed = false;
      return true;
    };
    await flashChip(port, ours(ESP32), person);
    expect(chip.isLoading).toBe(true); // nor can anything else reset it
    port.pressReset();
    await holds(chip, IMAGE);
  });

  test("is left alone if they do not", async () => {
    const { chip, port, person } = board();
    port.signalMs = 30;
    await expect(flashChip(port, ours(ESP32), person)).rejects.toThrow("did not enter its boot loader");
    expect(chip.writes).toBe(0);
    expect(port.readable).toBeNull();
  });
});

test("a cable pulled in the middle is one sentence, and the board can be flashed again", async () => {
  const { chip, port, person } = board();
  const content = mergedImage(ESP32, 3, 200_000);
  port.onWrite = (count) => {
    if (count > 120_000) port.unplug();
  };
  await expect(flashChip(port, ours(ESP32, content), person)).rejects.toThrow(
    /^the connection to the board was lost: plug it in again, then flash again$/,
  );
  expect(person.fraction).toBeGreaterThan(0);
  expect(person.fraction).toBeLessThan(1);
  expect(port.readable).toBeNull();
  port.onWrite = () => undefined;
  port.plug();
  await flashChip(port, ours(ESP32, content), new Reader());
  await holds(chip, content);
});

test("a board that is not there any more is one sentence, too", async () => {
  const { port, person } = board();
  port.unplug();
  await expect(flashChip(port, ours(ESP32), person)).rejects.toThrow(/^the connection to the board was lost: /);
});

test("a flash that does not hold what was written is a failure", async () => {
  const { chip, port, person } = board();
  const plain = chip.flash.fill.bind(chip.flash);
  // A worn sector: one bit of it stays cleared.
  chip.flash.fill = (...range) => {
    plain(...range);
    chip.flash[0x101000] = 0x7f;
    return chip.flash;
  };
  await expect(flashChip(port, ours(ESP32), person)).rejects.toThrow(/^esptool-js: MD5 of file does not match data in flash!; flash again/);
});

test("MD5 is that of node", () => {
  const random = new Random(9);
  for (const size of [0, 1, 55, 56, 63, 64, 65, 4096, 70_001]) {
    const data = Uint8Array.from({ length: size }, () => random.bits() & 0xff);
    expect(Buffer.from(md5(data)).toString("hex")).toBe(createHash("md5").update(data).digest("hex"));
  }
});

test("an image fills the flash that is asked for", () => {
  const { table } = readImage("wheelwire-esp32.bin", IMAGE);
  expect(Math.max(...table.map(({ offset, size }) => offset + size))).toBe(NEEDED_BYTES);
});
