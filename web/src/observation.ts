// What happens to the robot from one moment on, until there is something to say about it.
import { nameOf } from "./errors.js";
import { SupervisorState } from "./generated/protocol.js";
import type { Stop, World } from "./world.js";

/** How long what happened may still go on, once the robot stands. */
const SETTLE_US = 400_000;

export class Observation {
  readonly beganUs: number;
  /** Each state that it went to, and after how long. [us] */
  readonly states: { readonly state: number; readonly afterUs: number }[] = [];
  /** All that held it at any moment, and all faults. */
  held = 0;
  faults = 0;
  /** Since when it has driven; undefined while it has not. */
  droveFromUs: number | undefined;
  /** How far it went forward; what it backed out does not count. [m] */
  forwardM = 0;
  #lookedUs: number;
  readonly #before: { damaged: number; frames: number; sessions: number; distanceM: number };
  #state: number;
  #settledUs: number | undefined;

  constructor(readonly world: World) {
    this.beganUs = this.#lookedUs = world.nowUs;
    this.#state = world.state;
    const { counters, count } = world.program.session;
    this.#before = {
      damaged: counters.bad_cobs + counters.bad_crc,
      frames: counters.frames,
      sessions: count,
      distanceM: world.simulator.get("true.distance_m"),
    };
  }

  /** Take the next look; call this after each slice. */
  look(): void {
    const { world } = this;
    this.held |= world.said.hold?.held ?? 0;
    this.faults |= world.simulator.get("faults");
    if (world.state !== this.#state) {
      this.#state = world.state;
      this.states.push({ state: world.state, afterUs: world.nowUs - this.beganUs });
    }
    if (world.state === SupervisorState.DRIVING) this.droveFromUs ??= world.nowUs;
    const { simulator } = world;
    const mps = (simulator.get("true.left_mps") + simulator.get("true.right_mps")) / 2;
    this.forwardM += (Math.max(0, mps) * (world.nowUs - this.#lookedUs)) / 1e6;
    this.#lookedUs = world.nowUs;
    const stands = this.stop === undefined || this.stop.rolledUs !== undefined || this.stop.isOver;
    if (this.states.length === 0 || !stands) this.#settledUs = undefined;
    else this.#settledUs ??= world.nowUs;
  }

  /** The drive that ended since; undefined if none has. */
  get stop(): Stop | undefined {
    const stop = this.world.stop;
    return stop !== undefined && stop.atUs > this.beganUs ? stop : undefined;
  }

  get elapsedUs(): number {
    return this.world.nowUs - this.beganUs;
  }

  /** A state came, the robot stands, and nothing more followed for a while. */
  get isSettled(): boolean {
    const newest = this.states.at(-1);
    if (this.#settledUs === undefined || newest === undefined) return false;
    if (newest.state === SupervisorState.DRIVING) return false;
    const sinceUs = Math.max(this.#settledUs, this.beganUs + newest.afterUs);
    return this.world.nowUs >= sinceUs + SETTLE_US;
  }

  /** How long after it was broken, or after it began to drive then, something came. [us] */
  sinceDriveUs(afterUs: number): number {
    return afterUs - Math.max(0, (this.droveFromUs ?? this.beganUs) - this.beganUs);
  }

  reached(state: number): boolean {
    return this.states.some((one) => one.state === state);
  }

  /** Frames that the program received damaged, of how many. */
  get damaged(): { damaged: number; all: number } {
    const { counters } = this.world.program.session;
    const damaged = counters.bad_cobs + counters.bad_crc - this.#before.damaged;
    return { damaged, all: damaged + counters.frames - this.#before.frames };
  }

  get sessions(): number {
    return this.world.program.session.count - this.#before.sessions;
  }

  /** The speed limit that the robot said in a session that was opened since. [m/s] */
  get limitMps(): number | undefined {
    return this.sessions > 0 ? this.world.program.limitMps : undefined;
  }

  get movedM(): number {
    return this.world.simulator.get("true.distance_m") - this.#before.distanceM;
  }

  /** What happened, in one sentence of states, times and distances. */
  get text(): string {
    const states = this.states.map(
      ({ state, afterUs }) => `${nameOf(SupervisorState, state) ?? "?"} after ${time(afterUs)}`,
    );
    const stayed = nameOf(SupervisorState, this.#state) ?? "?";
    const parts = [states.length > 0 ? states.join(", ") : `it stayed ${stayed}`];
    if (this.stop !== undefined) parts.push(textOf(this.stop));
    return `${parts.join("; ")}.`;
  }
}

/** A stop in ms and mm. */
export function textOf(stop: Stop): string {
  const late =
    stop.lateUs === undefined ? "" : `drive removed ${ms(stop.lateUs)} ms after the deadline, `;
  if (stop.isOver) return `${late}${mm(stop.rolledM)} mm until it was driven again`;
  if (stop.rolledUs === undefined) return `${late}rolling on, ${mm(stop.rolledM)} mm so far`;
  return `${late}standstill after ${(stop.rolledUs / 1e6).toFixed(2)} s, ${mm(stop.rolledM)} mm`;
}

export function time(us: number): string {
  return us < 1e6 ? `${(us / 1000).toFixed(0)} ms` : `${(us / 1e6).toFixed(1)} s`;
}

export function mm(metres: number): string {
  return (metres * 1000).toFixed(0);
}

function ms(us: number): string {
  return (us / 1000).toFixed(1);
}
