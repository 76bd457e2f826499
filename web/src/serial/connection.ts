// The robot at a port that a person chose: found, kept, and driven only once a person enabled it.
import { ABSENCE_US, PageClock, clockStepUs, pageUs } from "../absence.js";
import { LinkLost, ProtocolMismatch, WheelwireError } from "../errors.js";
import { StopFlag, type Messages } from "../generated/protocol.js";
import { Program, type WheelSpeeds } from "../program.js";
import type { Robot } from "../robot.js";
import { Heard } from "./heard.js";
import { Port, type Transport } from "./port.js";

/** In the order of the protocol's specification: the firmware's own comes first. */
const RATES = [921_600, 115_200, 460_800, 230_400, 1_000_000, 2_000_000];
const [FIRST_RATE = 0] = RATES;
/** A chip that starts needs this long to answer, even at the right rate. */
const FIRST_US = 1_000_000;
const NEXT_US = 500_000;
const PERIOD_MS = 10;
const STOP_TIMEOUT_MS = 500;

export class Connection implements Robot {
  readonly program: Program;
  /** A person has read what will move. */
  isEnabled = false;
  /** What answers needs other firmware before it can be driven. */
  needsFlash = false;
  #port: Port | undefined;
  #line: Transport | undefined;
  #heard = new Heard();
  readonly #clock = new PageClock();
  #timer: ReturnType<typeof setInterval> | undefined;
  /** For the rate; undefined once a device answered. */
  #search: { readonly waiting: number[]; readonly answers: number; frames: number; dueUs: number } | undefined;
  #isChanging = false;
  #boardId: bigint | undefined;
  #ranUs = 0;

  /**
   * @param say Takes what a person should know.
   * @param changed Called when there is another thing to show.
   */
  constructor(
    readonly say: (text: string) => void,
    readonly changed: () => void,
  ) {
    const draw = (): number => crypto.getRandomValues(new Uint32Array(1))[0] ?? 0;
    this.program = new Program(draw, say);
  }

  get isConnected(): boolean {
    return this.#port !== undefined;
  }

  get nowUs(): number {
    return pageUs();
  }

  get state(): number | undefined {
    const { session } = this.program;
    return session.phase === "OPEN" ? session.state : undefined;
  }

  get faults(): number {
    return this.program.session.faults;
  }

  get hold(): Messages["Hold"] | undefined {
    return this.program.session.hold;
  }

  get hostCause(): undefined {
    return undefined; // what this page knows is of its own setpoints alone
  }

  get speeds(): WheelSpeeds {
    const { left_mps = 0, right_mps = 0 } = (this.state === undefined ? undefined : this.program.sample) ?? {};
    return { leftMps: left_mps, rightMps: right_mps };
  }

  get stopped(): string {
    const hold = this.hold;
    if (hold === undefined || hold.stop_cause === 0) return "";
    const soFar = (hold.stop_flags & StopFlag.AT_REST) === 0 ? " so far" : "";
    return `from ${hold.stop_mmps} mm/s, rolled ${hold.rolled_mm} mm${soFar}`;
  }

  /** Open a port, and look for a robot there. It reports what is wrong. */
  async connect(serial: Serial, chosen: SerialPort): Promise<void> {
    const onData = (): void => { this.run(pageUs()); };
    const port = new Port(serial, chosen, onData, () => { this.#onPort(); });
    this.#port = port;
    this.#boardId = undefined;
    this.#heard = new Heard();
    this.changed();
    try {
      await port.open(FIRST_RATE);
    } catch (error) {
      this.#end(messageOf(error));
    }
  }

  /** Stop the robot and let go of the port. */
  async disconnect(text = "disconnected: a stop was sent to the robot"): Promise<void> {
    await this.#stop();
    await this.#port?.close();
    this.#end(text);
  }

  /** As port.ts says: stop the robot, and let another program of this page have the closed port. */
  async lend<Result>(use: (handle: SerialPort) => Promise<Result>): Promise<Result> {
    const port = this.#port;
    if (port === undefined) throw new LinkLost("no port is open: press connect first");
    await this.#stop();
    return port.lend(use);
  }

  /** The page is hidden, or closes: stop, as long as it still can. */
  leave(): void {
    if (this.#line === undefined) return;
    this.isEnabled = false;
    this.program.stop(pageUs());
    this.#line.write(this.program.session.takeOutput());
    this.changed();
  }

  /** Let the program run; called when bytes came, and by a timer. */
  run(nowUs: number, isAway = this.#clock.elapsedUs() > ABSENCE_US): void {
    const line = this.#line;
    if (line === undefined) return;
    const { session } = this.program;
    if (isAway || nowUs > this.#ranUs + ABSENCE_US) this.program.wake(nowUs);
    this.#ranUs = nowUs;
    const wasOpen = session.phase === "OPEN";
    this.program.run(
      { take: () => this.#heard.note(line.take()), write: (bytes) => { line.write(bytes); } },
      nowUs,
    );
    const isOpen = session.phase === "OPEN";
    if (wasOpen && !isOpen) this.isEnabled = false;
    if (wasOpen !== isOpen) this.changed();
    this.#judge(nowUs);
  }

  /** What is on a line from now on: a port, or what a test has in its place. */
  attach(line: Transport | undefined, nowUs: number): void {
    this.#line = line;
    this.#ranUs = nowUs;
    this.isEnabled = false;
    if (line === undefined) return;
    this.#heard.next();
    this.program.session.resolutionUs = clockStepUs();
    this.program.session.connect(nowUs);
  }

  #onPort(): void {
    const nowUs = pageUs();
    const port = this.#port;
    if (port?.state === "open") {
      this.attach(port, nowUs);
      if (this.#isChanging && this.#search !== undefined) {
        this.#search.dueUs = nowUs + NEXT_US;
      } else {
        const { answers, counters } = this.program.session;
        const waiting = RATES.filter((rate) => rate !== port.baudRate);
        this.#search = { waiting, answers, frames: counters.frames, dueUs: nowUs + FIRST_US };
      }
      this.#isChanging = false;
      this.#timer ??= setInterval(() => { this.run(pageUs()); }, PERIOD_MS);
    } else {
      const text =
        port?.state === "gone"
          ? "the port is gone (unplugged, or its chip resets): it is opened again once it is back"
          : "the port is closed";
      this.attach(undefined, nowUs);
      this.program.session.disconnect(new LinkLost(text), nowUs);
    }
    this.changed();
  }

  /** Whether what answers is the robot, and what to do if nothing does. */
  #judge(nowUs: number): void {
    const { session } = this.program;
    const search = this.#search;
    if (search === undefined || this.#port === undefined || this.#isChanging) return;
    if (session.answers > search.answers) {
      this.#search = undefined;
      const id = session.device?.board_id;
      if (this.#boardId !== undefined && id !== this.#boardId) {
        const boards = `board ${nameOfBoard(id)} answers at this port, not ${nameOfBoard(this.#boardId)}`;
        void this.disconnect(`${boards}: press connect if you mean it`);
        return;
      }
      this.#boardId = id;
      this.needsFlash = session.error instanceof ProtocolMismatch && session.phase === "HELLO";
      this.changed();
    } else if (session.counters.frames > search.frames) {
      // A frame with a right checksum: this is the rate, and the answer is late or lost.
      search.frames = session.counters.frames;
      search.dueUs = nowUs + FIRST_US;
    } else if (nowUs >= search.dueUs) {
      this.#isChanging = true;
      const rate = search.waiting.shift();
      if (rate !== undefined) this.#port.setBaudRate(rate).catch((error: unknown) => { this.#end(messageOf(error)); });
      else void this.disconnect(`${this.#heard.text(RATES.length)} Choose another port.`);
    }
  }

  /** Stop, and wait until the robot says so, or could have. */
  async #stop(): Promise<void> {
    if (this.#line === undefined) return;
    await new Promise<void>((resolve) => {
      setTimeout(resolve, STOP_TIMEOUT_MS);
      this.isEnabled = false;
      this.program.stop(pageUs(), resolve);
      this.run(pageUs());
    });
  }

  #end(text: string): void {
    clearInterval(this.#timer);
    this.#timer = this.#port = this.#search = undefined;
    this.#isChanging = this.needsFlash = false;
    this.attach(undefined, pageUs());
    this.program.session.disconnect(new LinkLost(text), pageUs());
    this.say(text);
    this.changed();
  }
}

/** As `wheelwire` prints it. */
export function nameOfBoard(id = 0n): string {
  return id.toString(16).padStart(12, "0");
}

function messageOf(error: unknown): string {
  if (error instanceof WheelwireError) return error.message;
  throw error;
}
