// A stand-in of `navigator.serial`, which runs in a page: its ports are at the other end of a
// WebSocket, where bridge.ts has their chips and cables. As the browsers do, it asserts DTR, then RTS,
// as it opens a port, and clears both as it closes it; ports that the page may open are remembered.

/** What is sent beside the ports' bytes, as JSON. */
export interface Order {
  readonly open?: number;
  readonly signals?: readonly [dtr: boolean, rts: boolean];
  readonly close?: true;
}
export interface Report {
  /** Answers `open`. */
  readonly opened?: boolean;
  readonly isThere?: boolean;
}
export interface Device {
  readonly usbVendorId: number;
  readonly usbProductId: number;
}
declare global {
  /** Which port a person takes in the browser's chooser; undefined: none. Set it before a click. */
  var chosenPort: number | undefined;
  /** How often the chooser was shown. */
  var choosers: number | undefined;
}

class Handle extends EventTarget {
  readable: ReadableStream<Uint8Array> | null = null;
  writable: WritableStream<Uint8Array> | null = null;
  connected = true;
  #input: ReadableStreamDefaultController<Uint8Array> | undefined;
  #signals: [dtr: boolean, rts: boolean] = [false, false];

  constructor(readonly slot: Slot) {
    super();
  }

  getInfo(): Device {
    return this.slot.device;
  }

  async open({ baudRate }: SerialOptions): Promise<void> {
    if (this.readable !== null) throw new DOMException("The port is already open.", "InvalidStateError");
    if (!this.connected || !(await this.slot.ask({ open: baudRate }))) {
      throw new DOMException("Failed to open serial port.", "NetworkError");
    }
    await this.setSignals({ dataTerminalReady: true });
    await this.setSignals({ requestToSend: true });
    this.readable = new ReadableStream({
      start: (input) => { this.#input = input; },
      cancel: () => { this.#input = undefined; },
    });
    this.writable = new WritableStream({ write: (bytes) => { this.slot.send(bytes); } });
  }

  setSignals({ dataTerminalReady, requestToSend }: SerialOutputSignals): Promise<void> {
    // One after the other, though they come in one call.
    for (const [at, value] of [dataTerminalReady, requestToSend].entries()) {
      if (value === undefined) continue;
      this.#signals[at] = value;
      this.slot.send({ signals: this.#signals });
    }
    return Promise.resolve();
  }

  close(): Promise<void> {
    if (this.readable?.locked === true || this.writable?.locked === true) {
      return Promise.reject(new TypeError("Cannot cancel a locked stream"));
    }
    this.readable = this.writable = null;
    this.#signals = [false, false];
    this.slot.send({ signals: [false, false] });
    this.slot.send({ close: true });
    return Promise.resolve();
  }

  forget(): Promise<void> {
    this.slot.isGranted = false;
    return Promise.resolve();
  }

  take(bytes: Uint8Array): void {
    this.#input?.enqueue(bytes);
  }

  lose(): void {
    this.connected = false;
    const input = this.#input;
    this.#input = undefined;
    this.readable = this.writable = null;
    input?.error(new DOMException("The device has been lost.", "NetworkError"));
    this.dispatchEvent(new Event("disconnect", { bubbles: true }));
  }
}

/** A socket of the computer, and the handle of what is plugged into it. */
class Slot {
  handle = new Handle(this);
  isGranted = false;
  readonly #socket: WebSocket;
  readonly #opened: ((isOpen: boolean) => void)[] = [];

  constructor(
    readonly device: Device,
    url: string,
    readonly keepsHandle: boolean,
  ) {
    this.#socket = new WebSocket(url);
    this.#socket.binaryType = "arraybuffer";
    this.#socket.addEventListener("message", ({ data }: MessageEvent<ArrayBuffer | string>) => {
      if (typeof data === "string") this.#take(JSON.parse(data) as Report);
      else this.handle.take(new Uint8Array(data));
    });
  }

  ask(order: Order): Promise<boolean> {
    return new Promise((resolve) => {
      this.#opened.push(resolve);
      this.send(order);
    });
  }

  send(what: Order | Uint8Array): void {
    const data = what instanceof Uint8Array ? what.slice() : JSON.stringify(what);
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(data);
    else this.#socket.addEventListener("open", () => { this.#socket.send(data); });
  }

  #take({ opened, isThere }: Report): void {
    if (opened !== undefined) this.#opened.shift()?.(opened);
    if (isThere === false) this.handle.lose();
    if (isThere === true) {
      if (this.keepsHandle) this.handle.connected = true;
      else this.handle = new Handle(this);
    }
  }
}

/**
 * Put it in the place of the browser's own.
 *
 * @param url Of the bridge; the number of a port is appended.
 * @param keepsHandle Whether a port that is plugged in anew is the same object, as in Firefox.
 */
export function install(
  url: string,
  devices: readonly Device[],
  keepsHandle: boolean,
): void {
  const slots = devices.map((one, number) => new Slot(one, `${url}${number}`, keepsHandle));
  const serial = Object.assign(new EventTarget(), {
    getPorts: () => {
      const granted = slots.filter((one) => one.isGranted && (keepsHandle || one.handle.connected));
      return Promise.resolve(granted.map((one) => one.handle));
    },
    requestPort: () => {
      globalThis.choosers = (globalThis.choosers ?? 0) + 1;
      const slot = slots[globalThis.chosenPort ?? -1];
      if (slot === undefined) return Promise.reject(new DOMException("No port selected by the user.", "NotFoundError"));
      slot.isGranted = true;
      return Promise.resolve(slot.handle);
    },
  });
  Object.defineProperty(navigator, "serial", { value: serial });
}
