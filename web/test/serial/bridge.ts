// The other end of stand_in.ts: chips, their cables and reset circuits, behind a WebSocket.
//
// A robot is the program of `wheelwire sim`, on a socket in the place of its port.
import { spawn, type ChildProcess } from "node:child_process";
import { createHash } from "node:crypto";
import type { IncomingMessage } from "node:http";
import type { Duplex } from "node:stream";
import { fileURLToPath } from "node:url";
import { Decoder, Encoder } from "../../src/framing.js";
import type { Messages } from "../../src/generated/protocol.js";
import type { Device, Order, Report } from "./stand_in.js";

const SIMULATOR = fileURLToPath(new URL("../../../build/host/wheelwire-fwsim", import.meta.url));
const KEY = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";
/** Kinds of WebSocket frames. */
const TEXT = 1;
const BINARY = 2;
const CLOSE = 8;

export const CP210X: Device = { usbVendorId: 0x10c4, usbProductId: 0xea60 };
export const NATIVE_USB: Device = { usbVendorId: 0x303a, usbProductId: 0x1001 };

/** What is plugged in: it takes bytes, gives some, and notices the chip's reset. */
export interface Chip {
  readonly device: Device;
  /** Whether it answers at this rate; what it sends at another one is noise. */
  hears(baudRate: number): boolean;
  write(bytes: Uint8Array): void;
  onBytes: (bytes: Uint8Array) => void;
  /** Both transistors of the DevKit's circuit act on its reset pin. */
  reset(): void;
  /** What the page has set, for a chip whose loader is entered by it. */
  signals?(dtr: boolean, rts: boolean): void;
  stop(): void;
}

/** A robot. */
export class SimulatedChip implements Chip {
  onBytes: (bytes: Uint8Array) => void = () => undefined;
  /** What it says of itself in place of the truth. */
  hello: Partial<Messages["DeviceHello"]> | undefined;
  readonly #process: ChildProcess;
  readonly #line: Duplex;
  readonly #answers = new Map<number, (answer: Record<string, unknown>) => void>();
  #number = 0;
  #unread = "";
  #decoder = new Decoder();
  #encoder = new Encoder();

  /**
   * @param settings Variables of docs/simulator.md.
   * @param baudRate Of its UART; 0: any, as on USB.
   */
  constructor(
    settings: Readonly<Record<string, number>> = {},
    readonly device: Device = CP210X,
    readonly baudRate = 0,
  ) {
    const set = Object.entries(settings).flatMap(([name, value]) => ["--set", `${name}=${value}`]);
    this.#process = spawn(SIMULATOR, ["--socket", "3", "--seed", "1", ...set], {
      stdio: ["pipe", "pipe", "inherit", "pipe"],
    });
    this.#line = this.#process.stdio[3] as Duplex;
    this.#line.on("data", (bytes: Buffer) => {
      if (this.hello === undefined) this.onBytes(bytes);
      else this.#disguise(bytes, this.hello);
    });
    this.#line.on("error", () => undefined);
    this.#process.stdout?.on("data", (data: Buffer) => {
      const lines = (this.#unread + data.toString()).split("\n");
      this.#unread = lines.pop() ?? "";
      for (const line of lines) {
        const answer = JSON.parse(line) as Record<string, unknown>;
        this.#answers.get(answer["number"] as number)?.(answer);
      }
    });
  }

  #disguise(bytes: Uint8Array, hello: Partial<Messages["DeviceHello"]>): void {
    for (const { name, fields } of this.#decoder.feed(bytes)) {
      if (name === "DeviceHello") Object.assign(fields, hello);
      this.onBytes(this.#encoder.encode(name, fields));
    }
  }

  hears(baudRate: number): boolean {
    return this.baudRate === 0 || this.baudRate === baudRate;
  }

  write(bytes: Uint8Array): void {
    this.#line.write(bytes);
  }

  /** One of the simulator's commands, such as `set left.blocked 1`. */
  command(text: string): Promise<Record<string, unknown>> {
    const number = ++this.#number;
    this.#process.stdin?.write(`#${number} ${text}\n`);
    return new Promise((resolve) => this.#answers.set(number, resolve));
  }

  async get(name: string): Promise<number> {
    return Number((await this.command(`get ${name}`))["value"]);
  }

  async set(name: string, value: number): Promise<void> {
    await this.command(`set ${name} ${value}`);
  }

  reset(): void {
    [this.#decoder, this.#encoder] = [new Decoder(), new Encoder()];
    void this.command("reset external");
  }

  stop(): void {
    this.#process.kill();
  }
}

/** What is no robot: it sends the same bytes again and again, and hears nothing. */
export class Talker implements Chip {
  onBytes: (bytes: Uint8Array) => void = () => undefined;
  resets = 0;
  readonly #timer: NodeJS.Timeout;

  constructor(
    bytes: Uint8Array,
    readonly baudRate: number,
    readonly device: Device = CP210X,
  ) {
    this.#timer = setInterval(() => { this.onBytes(bytes); }, 20);
  }

  hears(baudRate: number): boolean {
    return this.baudRate === baudRate;
  }

  write(): void {
    // It has no use for it.
  }

  reset(): void {
    this.resets++;
  }

  stop(): void {
    clearInterval(this.#timer);
  }
}

/** What the line does to a part of the bytes. */
export type LineFault = (bytes: Uint8Array) => Uint8Array;

/** One socket of the computer with a cable and a chip; several pages may try to open it. */
export class Socket {
  isThere = true;
  /** How often the reset circuit has reset the chip. */
  resets = 0;
  /** Bytes that came from pages. */
  received = 0;
  toChip: LineFault = (bytes) => bytes;
  toPage: LineFault = (bytes) => bytes;
  readonly #pages = new Set<Page>();
  #owner: Page | undefined;
  #hears = false;
  #isHeld = false;

  constructor(public chip: Chip) {
    this.insert(chip);
  }

  /** From now on this one is at the cable. */
  insert(chip: Chip): void {
    this.chip = chip;
    chip.onBytes = (bytes) => {
      if (chip !== this.chip || !this.isThere || this.#owner === undefined || this.#isHeld) return;
      const sent = this.toPage(bytes);
      // Another rate samples the bits elsewhere.
      this.#owner.sendBytes(this.#hears ? sent : sent.map((byte) => (byte * 167 + 13) & 0xff));
    };
  }

  connect(page: Page): void {
    this.#pages.add(page);
  }

  disconnect(page: Page): void {
    this.#pages.delete(page);
    if (this.#owner === page) this.#owner = undefined;
  }

  bytes(page: Page, bytes: Uint8Array): void {
    if (page !== this.#owner || !this.isThere) return;
    this.received += bytes.length;
    if (this.#hears && !this.#isHeld) this.chip.write(this.toChip(bytes));
  }

  order(page: Page, { open, signals, close }: Order): void {
    if (open !== undefined) {
      const opened = this.isThere && this.#owner === undefined;
      if (opened) {
        this.#owner = page;
        this.#hears = this.chip.hears(open);
      }
      page.report({ opened });
    }
    if (page !== this.#owner) return;
    if (signals !== undefined) {
      // Of a DevKit's two transistors one pulls EN low: RTS without DTR.
      const [dtr, rts] = signals;
      const isHeld = rts && !dtr;
      if (isHeld && !this.#isHeld) {
        this.resets++;
        this.chip.reset();
      }
      this.#isHeld = isHeld;
      this.chip.signals?.(dtr, rts);
    }
    if (close === true) this.#owner = undefined;
  }

  /** Pull the plug out, or put it in. */
  plug(isThere: boolean): void {
    this.isThere = isThere;
    if (!isThere) this.#owner = undefined;
    for (const page of this.#pages) page.report({ isThere });
  }
}

/** A page's WebSocket at one socket. */
export class Page {
  #unread = Buffer.alloc(0);

  constructor(
    readonly socket: Socket,
    readonly stream: Duplex,
  ) {
    socket.connect(this);
    stream.on("data", (data: Buffer) => { this.#take(data); });
    stream.on("close", () => { socket.disconnect(this); });
    stream.on("error", () => undefined);
  }

  report(report: Report): void {
    this.#send(TEXT, Buffer.from(JSON.stringify(report)));
  }

  sendBytes(bytes: Uint8Array): void {
    if (bytes.length > 0) this.#send(BINARY, bytes);
  }

  #send(kind: number, data: Uint8Array): void {
    const size = data.length < 126 ? [data.length] : [126, data.length >> 8, data.length & 255];
    if (!this.stream.destroyed) this.stream.write(Buffer.concat([Buffer.from([0x80 | kind, ...size]), data]));
  }

  /** Frames of a browser: masked, short, never in parts. */
  #take(data: Buffer): void {
    this.#unread = Buffer.concat([this.#unread, data]);
    for (;;) {
      const unread = this.#unread;
      const isLong = ((unread[1] ?? 0) & 127) === 126;
      const header = isLong ? 8 : 6;
      if (unread.length < header) return;
      const size = isLong ? unread.readUInt16BE(2) : (unread[1] ?? 0) & 127;
      if (unread.length < header + size) return;
      const mask = unread.subarray(header - 4, header);
      const body = Uint8Array.from(unread.subarray(header, header + size), (byte, at) => byte ^ (mask[at % 4] ?? 0));
      this.#unread = unread.subarray(header + size);
      const kind = (unread[0] ?? 0) & 15;
      if (kind === CLOSE) this.stream.end();
      else if (kind === BINARY) this.socket.bytes(this, body);
      else this.socket.order(this, JSON.parse(Buffer.from(body).toString()) as Order);
    }
  }
}

/** Accept a page's WebSocket at the socket whose number ends its address. */
export function accept(sockets: readonly Socket[], request: IncomingMessage, stream: Duplex): void {
  const socket = sockets[Number(/\d+$/.exec(request.url ?? "")?.[0])];
  if (socket === undefined) {
    stream.destroy();
    return;
  }
  const key = createHash("sha1").update(`${request.headers["sec-websocket-key"] ?? ""}${KEY}`).digest("base64");
  stream.write(
    `HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: ${key}\r\n\r\n`,
  );
  new Page(socket, stream);
}
