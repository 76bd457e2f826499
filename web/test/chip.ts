// A chip before 4 MB of flash: its ROM loader, esptool's stub, its boot loader. Sans-IO.
//
// As tests/support/esp_chip.py, which esptool itself takes for a chip; here its reset line and its
// BOOT pin are known, too. The protocol: esptool's documentation, "Serial Protocol".
import { Inflate } from "pako";
import { parseTable } from "../src/flash/image.js";
import { md5 } from "../src/flash/md5.js";

export const FLASH_BYTES = 4 << 20;
const SECTOR = 0x1000;
const TABLE_OFFSET = 0x8000;
const TABLE_BYTES = 0xc00;
const IMAGE_MAGIC = 0xe9;
const END = 0xc0;
const CHIP_DETECT = 0x40001000;
const ESP32_MAGIC = 0x00f01d83;
const SPI_DATA = [0x3ff42080, 0x60002058, 0x60003058];
const WINBOND = 0x40ef;
const ROM_BAUD_RATE = 115_200;
const SYNC_FLUSH = 2;

/** How a chip is identified: newer ones report an id, the ESP32 has a word in its ROM. */
export interface ChipKind {
  readonly bootloader: number;
  readonly chipId: number;
}
export const ESP32: ChipKind = { bootloader: 0x1000, chipId: 0 };
export const ESP32S3: ChipKind = { bootloader: 0, chipId: 9 };
export const ESP32C6: ChipKind = { bootloader: 0, chipId: 13 };
export const ESP32C3: ChipKind = { bootloader: 0, chipId: 5 };

/** What runs once the flash boots. */
export interface Firmware {
  /** It takes bytes of the line. */
  feed(bytes: Uint8Array): void;
  take(): Uint8Array;
  reset(): void;
}

/** `flash` may be changed between sessions; `writes` counts what was erased or written. */
export class EspChip {
  readonly flash = new Uint8Array(FLASH_BYTES).fill(0xff);
  /** What the flash says of itself: its size, as a power of two, and who made it. */
  flashId = (22 << 16) | WINBOND;
  writes = 0;
  isLoading = false;
  /** Of the UART, in the loader. */
  baudRate = ROM_BAUD_RATE;
  #isStub = false;
  #frame: number[] | undefined;
  #output: number[] = [];
  #read: { content: Uint8Array; sent: number } | undefined;
  #inflate = new Inflate();

  constructor(
    readonly kind: ChipKind,
    readonly firmware: Firmware,
  ) {}

  /** The reset line is released. */
  reset(isBootPinLow: boolean): void {
    this.isLoading = isBootPinLow;
    this.#isStub = false;
    this.#frame = this.#read = undefined;
    this.#output = [];
    this.baudRate = ROM_BAUD_RATE;
    if (!isBootPinLow) this.firmware.reset();
  }

  /** Whether boot loader, table and the application that otadata selects are in place. */
  get boots(): boolean {
    const application = this.application;
    return [this.kind.bootloader, application].every(
      (at) => at !== undefined && this.flash[at] === IMAGE_MAGIC,
    );
  }

  /** Where the application begins that the second-stage boot loader would start. */
  get application(): number | undefined {
    const table = parseTable(this.flash.subarray(TABLE_OFFSET, TABLE_OFFSET + TABLE_BYTES));
    const slots = table.filter(({ kind, subtype }) => kind === 0 && subtype >= 0x10);
    const otadata = table.find(({ kind, subtype }) => kind === 1 && subtype === 0)?.offset ?? 0;
    const view = new DataView(this.flash.buffer);
    const newest = Math.max(
      ...[0, SECTOR].map((step) => (view.getUint32(otadata + step, true) + 1) >>> 0),
    );
    const factory = table.find(({ kind, subtype }) => kind === 0 && subtype === 0)?.offset;
    if (newest === 0) return factory ?? slots[0]?.offset;
    return slots[(newest - 2 + slots.length) % slots.length]?.offset;
  }

  feed(bytes: Uint8Array, baudRate: number): void {
    if (!this.isLoading) {
      if (this.boots) this.firmware.feed(bytes);
      return;
    }
    if (baudRate !== this.baudRate) return; // nothing that it could make out
    for (const byte of bytes) this.#takeByte(byte);
  }

  /** The bytes for the line. */
  take(): Uint8Array {
    if (!this.isLoading) return this.boots ? this.firmware.take() : new Uint8Array();
    return Uint8Array.from(this.#output.splice(0));
  }

  #takeByte(byte: number): void {
    if (byte !== END) {
      this.#frame?.push(byte);
    } else if (this.#frame !== undefined && this.#frame.length > 0) {
      const packet = unescaped(this.#frame);
      this.#frame = undefined;
      this.#takePacket(packet);
    } else {
      this.#frame = [];
    }
  }

  #send(packet: Uint8Array): void {
    this.#output.push(END);
    for (const byte of packet) {
      if (byte === END) this.#output.push(0xdb, 0xdc);
      else if (byte === 0xdb) this.#output.push(0xdb, 0xdd);
      else this.#output.push(byte);
    }
    this.#output.push(END);
  }

  #reply(op: number, data: Uint8Array = new Uint8Array(), value = 0, status = [0, 0]): void {
    const packet = new Uint8Array(8 + data.length + (this.#isStub ? 2 : 4));
    const view = new DataView(packet.buffer);
    packet.set([1, op]);
    view.setUint16(2, packet.length - 8, true);
    view.setUint32(4, value, true);
    packet.set(data, 8);
    packet.set(status, 8 + data.length);
    this.#send(packet);
  }

  #takePacket(packet: Uint8Array): void {
    const view = new DataView(packet.buffer, packet.byteOffset, packet.length);
    if (this.#read !== undefined) {
      this.#continueRead(view.getUint32(0, true));
      return;
    }
    const op = packet[1] ?? 0;
    const body = packet.subarray(8);
    const word = (index: number): number => view.getUint32(8 + 4 * index, true);
    const isData = op === 0x03 || op === 0x07 || op === 0x11;
    if (isData && view.getUint32(4, true) !== body.subarray(16).reduce((sum, byte) => sum ^ byte, 0xef)) {
      this.#reply(op, undefined, 0, [1, 7]);
    } else if (op === 0x08) {
      for (let copy = 0; copy < 8; copy++) this.#reply(op, undefined, this.#isStub ? 0 : 0x20120707);
    } else if (op === 0x0a) {
      this.#reply(op, undefined, this.#register(word(0)));
    } else if (op === 0x14 && this.kind.chipId !== 0) {
      const info = new Uint8Array(20);
      info[12] = this.kind.chipId;
      this.#reply(op, info);
    } else if (op === 0x13) {
      this.#reply(op, md5(this.flash.subarray(word(0), word(0) + word(1))));
    } else if (op === 0x0f) {
      this.#reply(op);
      this.baudRate = word(0);
    } else if (op === 0x06) {
      this.#reply(op);
      this.#isStub = true;
      this.#send(new TextEncoder().encode("OHAI"));
    } else if (op === 0xd2) {
      this.#reply(op);
      this.#read = { content: this.flash.slice(word(0), word(0) + word(1)), sent: 0 };
      this.#continueRead(0);
    } else if ([0x04, 0x05, 0x07, 0x09, 0x0b, 0x0d, 0x12].includes(op)) {
      this.#reply(op);
    } else if (op === 0x10) {
      this.#begin(word(3), word(0));
      this.#reply(op);
    } else if (op === 0x11) {
      this.#inflate.push(body.slice(16), SYNC_FLUSH);
      this.#reply(op);
    } else {
      this.#reply(0, undefined, 0, [1, 5]);
    }
  }

  #register(address: number): number {
    if (address === CHIP_DETECT) return this.kind.chipId === 0 ? ESP32_MAGIC : 0;
    return SPI_DATA.includes(address) ? this.flashId : 0;
  }

  #begin(offset: number, size: number): void {
    this.writes++;
    const [start, end] = [Math.floor(offset / SECTOR), Math.ceil((offset + size) / SECTOR)];
    this.flash.fill(0xff, start * SECTOR, end * SECTOR);
    let at = offset;
    this.#inflate = new Inflate();
    this.#inflate.onData = (data) => {
      this.writes++;
      // Flash only clears bits: data on flash that was not erased is corrupted.
      for (const byte of data) if (at < offset + size) this.flash[at] = (this.flash[at++] ?? 0) & byte;
    };
  }

  /** A sector at a time, each acknowledged by how much has come; a digest ends it. */
  #continueRead(acknowledged: number): void {
    const read = this.#read;
    if (read === undefined || acknowledged !== read.sent) throw new Error("out of step");
    const block = read.content.subarray(read.sent, read.sent + SECTOR);
    read.sent += block.length;
    this.#send(block.length > 0 ? block : md5(read.content));
    if (block.length === 0) this.#read = undefined;
  }
}

function unescaped(bytes: readonly number[]): Uint8Array {
  const packet: number[] = [];
  for (let at = 0; at < bytes.length; at++) {
    const byte = bytes[at] ?? 0;
    packet.push(byte === 0xdb ? (bytes[++at] === 0xdc ? END : 0xdb) : byte);
  }
  return Uint8Array.from(packet);
}
