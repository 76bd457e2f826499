// A board at a port of the browser: a chip, its reset circuit or its own USB, and a cable.
import type { Handle } from "../src/flash/loader.js";
import type { EspChip } from "./chip.js";

/** Its reset pin rises slowly: a capacitor holds it low for so long. */
const RESET_RISE_MS = 8;
/** One signal after the other, as Chrome sets them, even in one call. */
const SIGNAL_MS = 1;

/** Two transistors, as on a DevKit: RTS alone resets the chip, DTR alone pulls its BOOT pin low. */
export class BoardPort implements Handle {
  connected = true;
  readable: ReadableStream<Uint8Array> | null = null;
  writable: WritableStream<Uint8Array> | null = null;
  /** A person presses BOOT. */
  isBootPressed = false;
  /** How long the bridge takes for each signal. */
  signalMs = SIGNAL_MS;
  /** Called with how many bytes came in all, each time that some come. */
  onWrite: (count: number) => void = () => undefined;
  /** How often the chip was reset. */
  resets = 0;
  #baudRate = 0;
  #count = 0;
  #signals = { dataTerminalReady: false, requestToSend: false };
  #isHeld = false;
  #wasAsked = false;
  #controller: ReadableStreamDefaultController<Uint8Array> | undefined;

  /** @param usb The chip's own USB, in place of a bridge with the circuit. */
  constructor(
    readonly chip: EspChip,
    readonly usb = false,
  ) {}

  getInfo(): SerialPortInfo {
    if (this.usb) return { usbVendorId: 0x303a, usbProductId: 0x1001 };
    return { usbVendorId: 0x10c4, usbProductId: 0xea60 };
  }

  async open({ baudRate }: SerialOptions): Promise<void> {
    if (!this.connected) throw new DOMException("Failed to open serial port.", "NetworkError");
    if (this.readable !== null) throw new DOMException("The port is already open.", "InvalidStateError");
    this.#baudRate = baudRate;
    this.#listen();
    this.writable = new WritableStream<Uint8Array>({
      write: (bytes) => {
        this.#count += bytes.length;
        this.onWrite(this.#count);
        if (!this.connected) throw new DOMException("The device has been lost.", "NetworkError");
        this.chip.feed(bytes, this.#baudRate);
        this.pump();
      },
    });
    // As Linux does: both at once.
    this.#signals = { dataTerminalReady: true, requestToSend: true };
    await pause(0);
  }

  async close(): Promise<void> {
    if (this.readable?.locked === true || this.writable?.locked === true) {
      throw new TypeError("a stream is locked");
    }
    this.readable = this.writable = null;
    this.#controller = undefined;
    await pause(0);
  }

  async setSignals(signals: SerialOutputSignals): Promise<void> {
    if (this.readable === null) throw new DOMException("The port is closed.", "InvalidStateError");
    for (const name of ["dataTerminalReady", "requestToSend"] as const) {
      const value = signals[name];
      if (value === undefined) continue;
      await pause(this.signalMs);
      this.#signals[name] = value;
      this.#settle();
    }
  }

  /** Let the host have what the chip has sent. */
  pump(): void {
    const bytes = this.chip.take();
    if (bytes.length > 0) this.#controller?.enqueue(bytes);
  }

  /** Pull the cable: the board loses its power, too. */
  unplug(): void {
    this.connected = false;
    const error = new DOMException("The device has been lost.", "NetworkError");
    this.#controller?.error(error);
    this.#controller = undefined;
    this.readable = this.writable = null;
  }

  plug(): void {
    this.connected = true;
    this.#reset(false);
  }

  /** A person presses RST, or EN. */
  pressReset(): void {
    this.#reset(this.isBootPressed);
  }

  #listen(): void {
    this.readable = new ReadableStream<Uint8Array>({
      start: (controller) => {
        this.#controller = controller;
      },
      cancel: () => {
        this.#listen();
      },
    });
  }

  #settle(): void {
    const { dataTerminalReady: dtr, requestToSend: rts } = this.#signals;
    if (dtr && !rts) this.#wasAsked = true; // the chip's own USB remembers it until the reset
    if (rts && !dtr) {
      this.#isHeld = true;
    } else if (this.#isHeld) {
      this.#isHeld = false;
      setTimeout(() => {
        const { dataTerminalReady, requestToSend } = this.#signals;
        const isPulled = this.usb ? this.#wasAsked : dataTerminalReady && !requestToSend;
        this.#wasAsked = false;
        this.#reset(isPulled || this.isBootPressed);
      }, RESET_RISE_MS);
    }
  }

  #reset(isBootPinLow: boolean): void {
    this.resets++;
    this.chip.reset(isBootPinLow);
  }
}

function pause(ms: number): Promise<void> {
  return new Promise((resolve) => {
    setTimeout(resolve, ms);
  });
}
