// The simulated robot, its cable, and the program at the other end: one virtual time for all.
import { Cable } from "./cable.js";
import { Decoder } from "./framing.js";
import { SupervisorState, type Messages } from "./generated/protocol.js";
import { textOf } from "./observation.js";
import { Program, type WheelSpeeds } from "./program.js";
import { Random } from "./random.js";
import type { Robot } from "./robot.js";
import type { Simulator } from "./simulator.js";

/** How often program and cable get their share of the time. */
export const SLICE_US = 1000;
/** So much of an absence the robot lives through: long before its end it stands. */
const LONGEST_ABSENCE_US = 30_000_000;

/** A drive that ended, by what is true of the simulated robot. */
export interface Stop {
  /** The state that followed DRIVING. */
  readonly state: number;
  /** When the state changed. [us] */
  readonly atUs: number;
  /**
   * Time from the setpoint's deadline to the end of the drive; undefined if something else ended it,
   * as a bumper does before the deadline. [us]
   */
  readonly lateUs: number | undefined;
  /** From the end of the drive to standstill; undefined while it rolls. */
  rolledUs: number | undefined;
  /** How far it rolled. [m] */
  rolledM: number;
  /** It was driven again before it stood. */
  isOver: boolean;
  /** Why no setpoint came any more; undefined if the host does not know. */
  readonly hostCause: Robot["hostCause"];
}

export class World implements Robot {
  readonly program: Program;
  readonly cable: Cable;
  /** The program does not run. */
  isHung = false;
  /** What the robot says at its own end of the cable. */
  said: { state: Messages["WheelState"] | undefined; hold: Messages["Hold"] | undefined } = {
    state: undefined,
    hold: undefined,
  };
  stop: Stop | undefined;
  /** Called after each slice. */
  readonly watchers = new Set<() => void>();
  readonly #decoder = new Decoder();
  #state: number = SupervisorState.BOOT;
  #stopAtM = 0;
  #spareUs = 0;

  /** @param say Takes what a person should know. */
  constructor(
    readonly simulator: Simulator,
    seed: number,
    readonly say: (text: string) => void,
  ) {
    const random = new Random(seed);
    this.cable = new Cable(simulator, new Random(seed ^ 0x5eed));
    this.program = new Program(() => random.bits(), say);
    this.program.session.connect(this.nowUs);
  }

  get nowUs(): number {
    return this.simulator.nowUs;
  }

  /** The supervisor's state, by what is true. */
  get state(): number {
    return this.#state;
  }

  get faults(): number {
    return this.simulator.get("faults");
  }

  get hold(): Messages["Hold"] | undefined {
    return this.said.hold;
  }

  get hostCause(): Robot["hostCause"] {
    return this.stop?.hostCause;
  }

  get speeds(): WheelSpeeds {
    const { left_mps = 0, right_mps = 0 } = this.said.state ?? {};
    return { leftMps: left_mps, rightMps: right_mps };
  }

  get stopped(): string {
    return this.stop === undefined ? "" : textOf(this.stop);
  }

  /** Let this much time pass. */
  run(us: number): void {
    this.#spareUs += us;
    while (this.#spareUs >= SLICE_US) {
      this.#spareUs -= SLICE_US;
      this.#slice(true);
    }
  }

  /**
   * The page did not run for this long: the robot lives through it, and hears nothing. Only then
   * does the program go on, and it begins with a stop if it was driving.
   */
  wake(us: number): void {
    this.#spareUs = 0;
    const slices = Math.ceil(Math.min(us, LONGEST_ABSENCE_US) / SLICE_US);
    for (let slice = 0; slice < slices; slice++) this.#slice(false);
    this.program.wake(this.nowUs);
  }

  /** Run what the program has to say at once, before the page stops running. */
  flush(): void {
    this.#slice(true);
  }

  /** A person repaired the program: what it wished before it hung is out of date. */
  resume(): void {
    this.isHung = false;
    this.program.wake(this.nowUs);
  }

  #slice(programRuns: boolean): void {
    this.simulator.advance(SLICE_US);
    this.#listen(this.cable.advance());
    const runs = programRuns && !this.isHung;
    if (runs) this.program.run(this.cable, this.nowUs);
    this.#watchStop(runs);
    for (const watch of this.watchers) watch();
  }

  #listen(bytes: Uint8Array): void {
    if (bytes.length === 0) return;
    for (const { name, fields } of this.#decoder.feed(bytes)) {
      if (name === "WheelState") this.said.state = fields;
      else if (name === "Hold") this.said.hold = fields;
    }
  }

  #watchStop(programRuns: boolean): void {
    const { simulator, nowUs } = this;
    const before = this.#state;
    const state = (this.#state = simulator.get("state"));
    if (state === SupervisorState.BOOT && before !== state) {
      // What it said before its start is out of date.
      this.said = { state: undefined, hold: undefined };
    }
    if (before === SupervisorState.DRIVING && state !== before) {
      const lateUs = simulator.get("drive_removed_us") - simulator.get("deadline_us");
      this.stop = {
        state,
        atUs: nowUs,
        lateUs: state === SupervisorState.TIMED_OUT && lateUs >= 0 ? lateUs : undefined,
        rolledUs: undefined,
        rolledM: 0,
        isOver: false,
        hostCause: !programRuns ? "host_frozen" : this.cable.pulled ? "cable_pulled" : undefined,
      };
      this.#stopAtM = simulator.get("true.distance_m");
    }
    const stop = this.stop;
    if (stop === undefined || stop.rolledUs !== undefined || stop.isOver) return;
    stop.isOver = state === SupervisorState.DRIVING; // driven again before it stood
    stop.rolledM = simulator.get("true.distance_m") - this.#stopAtM;
    if (simulator.get("stands_still") !== 0) stop.rolledUs = nowUs - stop.atUs;
  }
}
