// The simulated robot: the firmware's core on a model robot, in virtual time, as WebAssembly.

/** One device and its robot. The same seed and the same calls give the same bytes. */
export interface Simulator {
  /** How much time has passed since the device was powered on. [us] */
  readonly nowUs: number;
  /** Run device and world for this long, a whole number. [us] */
  advance(us: number): void;
  /** Send bytes from the host to the device. */
  write(bytes: Uint8Array): void;
  /** Take all bytes that have reached the host. */
  read(): Uint8Array;
  /**
   * Set a variable of docs/simulator.md, in its unit. `reset` resets the chip.
   * @throws RangeError if no variable has this name, or it does not accept the value.
   */
  set(name: string, value: number): void;
  /**
   * Read a variable of docs/simulator.md, in its unit.
   * @throws RangeError if no variable has this name.
   */
  get(name: string): number;
}

/** What web/wasm/CMakeLists.txt exports; pointers are numbers. */
interface Exports {
  readonly memory: WebAssembly.Memory;
  _initialize(): void;
  malloc(size: number): number;
  fwsim_create(seed: bigint): number;
  fwsim_advance_us(sim: number, us: bigint): number;
  fwsim_write(sim: number, bytes: number, size: number): number;
  fwsim_read(sim: number, out: number, capacity: number, size: number): number;
  fwsim_set(sim: number, name: number, value: number): number;
  fwsim_get(sim: number, name: number, value: number): number;
}

const STATUS: Readonly<Record<number, string>> = {
  [-1]: "there is no such variable",
  [-2]: "it is read-only",
  [-3]: "out of range",
  [-4]: "not allowed",
};
const BUFFER_SIZE = 1 << 16;
const WASI_ENOSYS = 52;

/** The system calls of the C++ library. There is no system here; only a failure ends the program. */
function systemOf(module: WebAssembly.Module): WebAssembly.Imports {
  const functions: Record<string, (...values: number[]) => number> = {};
  for (const { name } of WebAssembly.Module.imports(module)) functions[name] = () => WASI_ENOSYS;
  functions["proc_exit"] = (status: number) => {
    throw new Error(`the simulator ended with status ${status}`);
  };
  return { wasi_snapshot_preview1: functions };
}

class WasmSimulator implements Simulator {
  nowUs = 0;
  readonly #exports: Exports;
  readonly #sim: number;
  readonly #buffer: number;
  readonly #result: number;
  readonly #names = new Map<string, number>();

  constructor(instance: WebAssembly.Instance, seed: number) {
    this.#exports = instance.exports as unknown as Exports;
    this.#exports._initialize();
    this.#sim = this.#exports.fwsim_create(BigInt(seed));
    this.#buffer = this.#exports.malloc(BUFFER_SIZE);
    this.#result = this.#exports.malloc(8);
  }

  advance(us: number): void {
    check(this.#exports.fwsim_advance_us(this.#sim, BigInt(us)), `advance by ${us} us`);
    this.nowUs += us;
  }

  write(bytes: Uint8Array): void {
    for (let at = 0; at < bytes.length; at += BUFFER_SIZE) {
      const part = bytes.subarray(at, at + BUFFER_SIZE);
      this.#put(this.#buffer, part);
      check(this.#exports.fwsim_write(this.#sim, this.#buffer, part.length), "write");
    }
  }

  read(): Uint8Array {
    const first = this.#readPart();
    if (first.length < BUFFER_SIZE) return first;
    const rest = this.read();
    const all = new Uint8Array(first.length + rest.length);
    all.set(first);
    all.set(rest, first.length);
    return all;
  }

  set(name: string, value: number): void {
    check(this.#exports.fwsim_set(this.#sim, this.#nameAt(name), value), `${name} = ${value}`);
  }

  get(name: string): number {
    check(this.#exports.fwsim_get(this.#sim, this.#nameAt(name), this.#result), name);
    return this.#view().getFloat64(this.#result, true);
  }

  #readPart(): Uint8Array {
    check(this.#exports.fwsim_read(this.#sim, this.#buffer, BUFFER_SIZE, this.#result), "read");
    const size = this.#view().getUint32(this.#result, true);
    return new Uint8Array(this.#exports.memory.buffer, this.#buffer, size).slice();
  }

  /** Where the name is, ended by a zero. */
  #nameAt(name: string): number {
    let at = this.#names.get(name);
    if (at === undefined) {
      const text = new TextEncoder().encode(`${name}\0`);
      at = this.#exports.malloc(text.length);
      this.#put(at, text);
      this.#names.set(name, at);
    }
    return at;
  }

  /** New each time: when the memory grows, older views become invalid. */
  #view(): DataView {
    return new DataView(this.#exports.memory.buffer);
  }

  #put(at: number, bytes: Uint8Array): void {
    new Uint8Array(this.#exports.memory.buffer).set(bytes, at);
  }
}

function check(status: number, subject: string): void {
  if (status !== 0) throw new RangeError(`${subject}: ${STATUS[status] ?? status}`);
}

/**
 * Power a device on, at time 0.
 *
 * @param wasm What `make web` leaves in build/web/robot.wasm.
 * @param seed A whole number from 0 on, of boot ids and of what differs between robots.
 */
export async function loadSimulator(wasm: BufferSource | Response, seed: number): Promise<Simulator> {
  const bytes = wasm instanceof Response ? await wasm.arrayBuffer() : wasm;
  const module = await WebAssembly.compile(bytes);
  return new WasmSimulator(await WebAssembly.instantiate(module, systemOf(module)), seed);
}
