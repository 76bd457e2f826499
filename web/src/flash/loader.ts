// The boot loader in a chip's ROM, by esptool-js: enter it, ask it, write by it, leave it.
//
// esptool-js opens and closes the port by itself: until it closes it, nothing else may have it open. It is larger
// than the rest of the page, so it is loaded only when needed.
import type { ESPLoader, Transport } from "esptool-js";
import { Chip } from "../generated/protocol.js";
import { FLASH } from "../generated/words.js";
import { fill } from "../text.js";
import { FlashFailed, NEEDED_BYTES, TABLE_BYTES, TABLE_OFFSET, parseTable, type Partition, type Plan } from "./image.js";
import { hex, md5 } from "./md5.js";

const ROM_BAUD_RATE = 115_200;
const FLASH_BAUD_RATE = 460_800;
/** Each resets the chip again, alternately with a short and a long wait. */
const ATTEMPTS = 4;
const RESET_MS = 100;
const LOOK_MS = 50;
const DIGEST_TIMEOUT_MS = 3000;

/** The needed part of a SerialPort. */
export type Handle = Pick<SerialPort, "readable" | "writable" | "open" | "close" | "setSignals" | "getInfo">;

/** By esptool's names. */
const CHIPS: Readonly<Record<string, number>> = {
  ESP32: Chip.ESP32,
  "ESP32-S3": Chip.ESP32S3,
  "ESP32-C6": Chip.ESP32C6,
};

const BYTES: Readonly<Record<string, number>> = { KB: 1 << 10, MB: 1 << 20 };

/** Replaces the port's name in the command's sentences. */
export const THIS_PORT = "this port";

/** The chip does not enter its loader by itself. */
export class NotInLoader extends FlashFailed {
  override name = "NotInLoader";
}

/** The cable was pulled, or the board lost its power. */
class PortLost extends FlashFailed {
  override name = "PortLost";

  constructor() {
    super("the connection to the board was lost: plug it in again, then flash again");
  }
}

/** esptool-js waits this long for a chip that it only looks for. */
const SYNC_MS = 100;
/** The least time for any other answer: a busy computer passes it on later than within the 0.2 s that esptool-js allows some. */
const ANSWER_MS = 6_000;

type Esptool = typeof import("esptool-js");

/** The port, as esptool-js needs it. */
function lineOf({ Transport }: Esptool, port: Handle): Transport {
  class Line extends Transport {
    /** Not to the browser's console. */
    override trace(): void {
      return;
    }

    override async write(data: Uint8Array): Promise<void> {
      const writer = this.device.writable?.getWriter();
      if (writer === undefined) throw new PortLost();
      try {
        await writer.write(this.slipWriter(data));
      } catch {
        throw new PortLost();
      } finally {
        writer.releaseLock();
      }
    }

    /** Ends at once if the port is gone, not only at the end of a long time. */
    override async read(timeoutMs: number): Promise<Uint8Array> {
      let watch: ReturnType<typeof setInterval> | undefined;
      const lost = new Promise<never>((_, reject) => {
        watch = setInterval(() => {
          if (this.device.readable === null) reject(new PortLost());
        }, LOOK_MS);
      });
      try {
        const longest = timeoutMs > SYNC_MS ? Math.max(timeoutMs, ANSWER_MS) : timeoutMs;
        return await Promise.race([super.read(longest), lost]);
      } finally {
        clearInterval(watch);
      }
    }
  }
  return new Line(port as SerialPort);
}

/** A chip whose loader answers. */
export class Loader {
  private constructor(
    readonly port: Handle,
    readonly line: Transport,
    readonly esptool: ESPLoader,
    readonly library: Esptool,
  ) {}

  /**
   * Reset the chip into its loader.
   *
   * @param port Closed.
   * @param byHand A person holds BOOT, or has already reset the chip with it.
   * @throws NotInLoader It does not answer.
   */
  static async enter(port: Handle, byHand: boolean): Promise<Loader> {
    const library = await import("esptool-js");
    const modes = byHand ? (["no_reset", "default_reset"] as const) : (["default_reset"] as const);
    for (const mode of modes) {
      const line = lineOf(library, port);
      const terminal = { clean: nothing, writeLine: nothing, write: nothing };
      const options = { transport: line, baudrate: FLASH_BAUD_RATE, romBaudrate: ROM_BAUD_RATE, terminal };
      const loader = new Loader(port, line, new library.ESPLoader(options), library);
      try {
        await loader.esptool.connect(mode, mode === "no_reset" ? 1 : ATTEMPTS);
        return loader;
      } catch (error) {
        await loader.close();
        if (!(error instanceof library.ESPError)) throw loader.inWords(error);
      }
    }
    throw new NotInLoader("the board did not enter its boot loader by itself");
  }

  /**
   * Which chip this is, as in Chip; makes it ready to write.
   *
   * @throws FlashFailed Wheelwire does not support it, or its flash is too small.
   */
  async identify(): Promise<number> {
    const { esptool } = this;
    const name = esptool.chip.CHIP_NAME;
    const chip = CHIPS[name];
    if (chip === undefined) throw new FlashFailed(fill(FLASH.notSupported, THIS_PORT, name));
    const [exact = name] = (await esptool.chip.getChipDescription(esptool)).split(" (");
    await esptool.chip.postConnect?.(esptool);
    await esptool.runStub();
    await esptool.changeBaud();
    // A part that esptool-js does not know is not refused: it reads back what it has written.
    const [, number = "", unit = ""] = /^(\d+)([KM]B)$/.exec((await esptool.detectFlashSize()) ?? "") ?? [];
    if (number !== "" && Number(number) * (BYTES[unit] ?? 1) < NEEDED_BYTES) {
      throw new FlashFailed(fill(FLASH.tooSmall, exact, THIS_PORT, number, unit, NEEDED_BYTES >> 20));
    }
    return chip;
  }

  /** The chip's partition table; empty if it has none. */
  async readTable(): Promise<Partition[]> {
    const raw = await this.esptool.readFlash(TABLE_OFFSET, TABLE_BYTES);
    // esptool-js leaves what follows to the next command, which would take it for its answer.
    const digest = await this.line.read(DIGEST_TIMEOUT_MS);
    if (hex(digest) !== hex(md5(raw))) {
      throw new FlashFailed("the partition table was read with errors: flash again, with another cable");
    }
    return parseTable(raw);
  }

  /** Carry out a plan. `report` receives the fraction written, 0 to 1. */
  async write(plan: Plan, report: (fraction: number) => void): Promise<void> {
    const sizes = plan.writes.map((part) => part.content.length);
    const all = sizes.reduce((sum, size) => sum + size, 0);
    await this.esptool.writeFlash({
      fileArray: plan.writes.map(({ content, offset }) => ({ data: content, address: offset })),
      flashMode: "keep",
      flashFreq: "keep",
      flashSize: "keep",
      eraseAll: false,
      compress: true,
      calculateMD5Hash: (content) => hex(md5(content)),
      reportProgress: (index, written, total) => {
        const before = sizes.slice(0, index).reduce((sum, size) => sum + size, 0);
        report((before + ((sizes[index] ?? 0) * written) / total) / all);
      },
    });
  }

  /** A failure of esptool-js or of the port, in one sentence; anything else as it is. */
  inWords(error: unknown): unknown {
    if (error instanceof DOMException) return new PortLost();
    if (!(error instanceof this.library.ESPError)) return error;
    const hint = "flash again, and hold the board's BOOT button if it does not connect";
    return new FlashFailed(`esptool-js: ${error.message.trim()}; ${hint}`);
  }

  /** Reset the chip, which starts its firmware, and close the port. */
  async leave(): Promise<void> {
    try {
      // In this order: RTS alone resets; DTR alone would hold the loader's pin low.
      await this.port.setSignals({ dataTerminalReady: false });
      await this.port.setSignals({ requestToSend: true });
      await new Promise((resolve) => setTimeout(resolve, RESET_MS));
      await this.port.setSignals({ requestToSend: false });
    } catch {
      // The port of a chip with USB of its own is gone as soon as that resets.
    }
    await this.close();
  }

  /** Close the port, whatever its state. */
  async close(): Promise<void> {
    try {
      await this.line.disconnect();
    } catch {
      // It is gone, or was never opened.
    }
  }
}

function nothing(): void {
  return;
}
