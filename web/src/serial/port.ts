// A line to a robot, and its implementation by Web Serial: the port that a person chose.
//
// Opening sets no signal: a browser asserts DTR and RTS, and with both of them a DevKit's chip runs
// on. Closing clears RTS first, then DTR, in two calls: DTR cleared while RTS is set is a reset.
//
// To flash, use `Connection.lend(use)` of connection.ts, which takes the port from the session and gives it back. It
// stops the robot, closes the port, and calls `use` with the closed SerialPort. `use` may open it at any rate and set
// its signals (esptool-js: `new Transport(port)`), and closes it before it returns or throws. Then the port is opened
// again, if necessary by the new handle that a chip with native USB has got, and a session begins.
import { joined } from "../codec.js";
import { WheelwireError } from "../errors.js";

/** A line to a robot: the simulated one's cable, or a port. Neither direction ever waits. */
export interface Transport {
  /** The bytes that came since. */
  take(): Uint8Array;
  /** Send bytes. What the line does not hold is lost. */
  write(bytes: Uint8Array): void;
}

/** The port cannot be opened. */
export class PortUnavailable extends WheelwireError {
  override name = "PortUnavailable";
}

/** `gone`: it was open and is unplugged, or its chip resets: it is opened again once it is back. */
export type PortState = "closed" | "open" | "gone" | "lent";

/** Frames are short: this is more than a tenth of a second of the fastest line. */
const BUFFER_SIZE = 16_384;
/** More than this waits only on a line that takes nothing; what is older than that has expired. */
const MOST_UNSENT = 2048;
const RETRY_MS = 250;
const FLUSH_MS = 500;

/** What this browser offers; undefined if it has no Web Serial, or if the page is not secure. */
export function webSerial(): Serial | undefined {
  return (navigator as { readonly serial?: Serial }).serial;
}

export class Port implements Transport {
  state: PortState = "closed";
  baudRate = 0;
  #handle: SerialPort;
  /** Other ports that the page may open, and never does. */
  #others: ReadonlySet<SerialPort> = new Set();
  #reader: ReadableStreamDefaultReader<Uint8Array> | undefined;
  #writer: WritableStreamDefaultWriter<Uint8Array> | undefined;
  #reading: Promise<void> = Promise.resolve();
  #chunks: Uint8Array[] = [];
  #unsent = 0;
  /** The newest of what was asked for: each begins when the one before it has ended. */
  #turn: Promise<unknown> = Promise.resolve();

  /**
   * @param onData Called when bytes came.
   * @param onChange Called when `state` has changed.
   */
  constructor(
    readonly serial: Serial,
    chosen: SerialPort,
    readonly onData: () => void,
    readonly onChange: () => void,
  ) {
    this.#handle = chosen;
  }

  /** @throws PortUnavailable Another program or tab has it, or it is not there. */
  open(baudRate: number): Promise<void> {
    return this.#inTurn(async () => {
      const ports = await this.serial.getPorts();
      this.#others = new Set(ports.filter((one) => one !== this.#handle));
      await this.#open(this.#handle, baudRate);
    });
  }

  /** Close it and open it at another rate. */
  setBaudRate(baudRate: number): Promise<void> {
    return this.#inTurn(async () => {
      if (this.state !== "open") return;
      await this.#close();
      await this.#open(this.#handle, baudRate).catch((error: unknown) => {
        this.#become("closed");
        throw error;
      });
    });
  }

  /** Close it for good; what was written before is sent first. Never throws. */
  close(): Promise<void> {
    if (this.state === "gone") this.#become("closed"); // otherwise it could come back while closing
    return this.#inTurn(async () => {
      await this.#close();
      if (this.state !== "closed") this.#become("closed");
    });
  }

  /** Let another program of this page have it, closed; then open it again. */
  lend<Result>(use: (handle: SerialPort) => Promise<Result>): Promise<Result> {
    return this.#inTurn(async () => {
      await this.#close();
      this.#become("lent");
      try {
        return await use(this.#handle);
      } finally {
        this.#become("gone");
        void this.#comeBack();
      }
    });
  }

  take(): Uint8Array {
    const chunks = this.#chunks;
    this.#chunks = [];
    return joined(chunks);
  }

  write(bytes: Uint8Array): void {
    if (bytes.length === 0 || this.#unsent + bytes.length > MOST_UNSENT) return;
    this.#unsent += bytes.length;
    // A failure is noticed where it is read.
    this.#writer?.write(bytes).then(() => (this.#unsent -= bytes.length), () => undefined);
  }

  #inTurn<Result>(act: () => Promise<Result>): Promise<Result> {
    const result = this.#turn.then(act);
    this.#turn = result.catch(() => undefined);
    return result;
  }

  #become(state: PortState): void {
    this.state = state;
    this.onChange();
  }

  async #open(handle: SerialPort, baudRate: number): Promise<void> {
    try {
      await handle.open({ baudRate, bufferSize: BUFFER_SIZE });
    } catch (error) {
      throw new PortUnavailable(
        `The port could not be opened: another tab or program has it, or it is unplugged. End that one, then connect again. (${String(error)})`,
      );
    }
    this.#handle = handle;
    this.baudRate = baudRate;
    this.#chunks = [];
    this.#unsent = 0;
    this.#writer = handle.writable?.getWriter();
    this.#reading = this.#read(handle);
    this.#become("open");
  }

  async #read(handle: SerialPort): Promise<void> {
    // A break or an overrun ends the stream, and another one takes its place.
    while (handle.readable !== null) {
      const reader = (this.#reader = handle.readable.getReader());
      try {
        for (;;) {
          const { value, done } = await reader.read();
          if (done) return;
          this.#chunks.push(value);
          this.onData();
        }
      } catch {
        // Whether the port is gone shows in the stream that follows.
      } finally {
        reader.releaseLock();
      }
    }
    this.#writer?.releaseLock();
    this.#writer = undefined;
    await handle.close().catch(() => undefined);
    this.#become("gone");
    void this.#comeBack();
  }

  async #close(): Promise<void> {
    if (this.state !== "open") return;
    const handle = this.#handle;
    await this.#reader?.cancel().catch(() => undefined);
    await this.#reading;
    // A line that takes nothing never flushes.
    const flushed = this.#writer?.close().catch(() => undefined);
    await Promise.race([flushed, pause(FLUSH_MS)]);
    this.#writer?.releaseLock();
    this.#writer = undefined;
    for (const signal of ["requestToSend", "dataTerminalReady"] as const) {
      await handle.setSignals({ [signal]: false }).catch(() => undefined);
    }
    await handle.close().catch(() => undefined);
  }

  /** Open it once it is back; a port that enumerates cannot be opened for a while. */
  async #comeBack(): Promise<void> {
    const isGone = (): boolean => this.state === "gone";
    while (isGone()) {
      const opened = await this.#inTurn(async () => {
        for (const handle of isGone() ? await this.#found() : []) {
          if (await this.#open(handle, this.baudRate).then(() => true, () => false)) return true;
        }
        return false;
      });
      if (!opened) await pause(RETRY_MS);
    }
  }

  /** The chosen port, by the handle that it had (Firefox) or a new one (Chrome). */
  async #found(): Promise<SerialPort[]> {
    const was = this.#handle.getInfo();
    const isAlike = (one: SerialPort): boolean => {
      const { usbVendorId, usbProductId } = one.getInfo();
      return usbVendorId === was.usbVendorId && usbProductId === was.usbProductId;
    };
    const ports = (await this.serial.getPorts()).filter((one) => !this.#others.has(one));
    // Browsers older than this property list connected ports alone.
    const isThere = (one: { readonly connected?: boolean }): boolean => one.connected !== false;
    return ports.filter((one) => isThere(one) && (one === this.#handle || isAlike(one)));
  }
}

function pause(ms: number): Promise<void> {
  return new Promise((resolve) => {
    setTimeout(resolve, ms);
  });
}
