// The robot, for a measurement: samples one by one, setpoints, and parameters on trial.
//
// It waits for each sample and answer. There is no timer: samples renew the trial, so if the page stops, the robot
// reverts its parameters.
import { LinkLost, WheelwireError, flagsOf } from "../errors.js";
import {
  Contradiction,
  ContradictionDocs,
  Fault,
  FaultDocs,
  Parameter,
  TrialAction,
} from "../generated/protocol.js";
import { SETUP } from "../generated/words.js";
import type { Observer, Program } from "../program.js";
import type { Answer, Asked, RequestName } from "../requests.js";
import type { Sample } from "../session.js";

/** Time to live of each setpoint: a page that hangs drives no longer. */
export const TTL_S = 0.3;
const TRIAL_S = 2;
const RENEWALS = 4;
/** More unread samples than this are too old to use: a person has been thinking. */
const MOST_UNREAD = 20;
const SECOND_US = 1_000_000;
/** For a board to start, and a new session with it to open. */
const REOPENED_US = 3_000_000;

/** The set-up cannot go on. */
export class SetupFailed extends WheelwireError {
  override name = "SetupFailed";
}

export type ParameterName = keyof typeof Parameter;

/** Follows the program; see `Program.observer`. */
export class SetupRobot implements Observer {
  #unread: Sample[] = [];
  #waiting: ((sample: Sample) => void) | undefined;
  #isOnTrial = false;
  #renewedUs = 0;
  #ttlMaxS = TTL_S;
  #lostUs: number | undefined;
  /** What ended it; waited for where a link is lost, as only the next session tells why. */
  readonly #ended: Promise<never>;
  #end: (error: WheelwireError) => void = () => undefined;
  #failure: WheelwireError | undefined;
  readonly #session: number;
  readonly #bootId: number | undefined;

  /** @param program Its session is open, and stays the same. */
  constructor(
    readonly program: Program,
    readonly nowUs: () => number,
  ) {
    this.#ended = new Promise((_, reject) => {
      this.#end = reject;
    });
    this.#ended.catch(() => undefined); // whether somebody waits for it or not
    this.#session = program.session.count;
    this.#bootId = program.session.device?.boot_id;
    program.observer = this;
  }

  /** End what is going on. */
  fail(error: WheelwireError): void {
    this.#failure ??= error;
    this.#end(this.#failure);
  }

  /** What is waited for, unless all ends before. */
  unlessEnded<Result>(result: Promise<Result>): Promise<Result> {
    return Promise.race([result, this.#ended]);
  }

  /** It is not needed any more. */
  release(): void {
    this.program.observer = undefined;
  }

  onAdvance(nowUs: number): void {
    const { phase, error } = this.program.session;
    if (phase === "OPEN") return;
    this.#lostUs ??= nowUs;
    if (nowUs > this.#lostUs + REOPENED_US) this.fail(error);
  }

  onSample(sample: Sample): void {
    const { count, device } = this.program.session;
    if (count !== this.#session) {
      this.fail(new SetupFailed(device?.boot_id === this.#bootId ? SETUP.linkLost : SETUP.reset));
      return;
    }
    this.#renew();
    const waiting = this.#waiting;
    this.#waiting = undefined;
    if (waiting !== undefined) {
      waiting(sample);
      return;
    }
    this.#unread.push(sample);
    if (this.#unread.length > MOST_UNREAD) this.#unread.shift();
  }

  /** The next sample. */
  read(): Promise<Sample> {
    const next = this.#unread.shift();
    if (next !== undefined && this.#failure === undefined) return Promise.resolve(next);
    const coming = new Promise<Sample>((resolve) => {
      this.#waiting = resolve;
    });
    return this.unlessEnded(coming);
  }

  /** A sample from after this call: the next one may be older than the last request. */
  async fresh(): Promise<Sample> {
    this.#unread = [];
    await this.read();
    return this.read();
  }

  /** For how long a setpoint lives. [s] */
  get lifeS(): number {
    return Math.min(TTL_S, this.#ttlMaxS);
  }

  setDuty(left: number, right: number, ttlS: number): void {
    this.#command(() => {
      this.program.setDuty(left, right, ttlS * SECOND_US, this.nowUs());
    });
  }

  standStill(): void {
    this.#command(() => {
      this.program.session.drive(0, 0, this.nowUs() + this.lifeS * SECOND_US, this.nowUs());
    });
  }

  stop(): Promise<void> {
    const stopped = new Promise<void>((resolve) => {
      this.program.stop(this.nowUs(), resolve);
    });
    return this.unlessEnded(stopped);
  }

  async get(name: ParameterName): Promise<number> {
    return (await this.#ask("ParameterGet", { parameter: Parameter[name] })).value;
  }

  async set(name: ParameterName, value: number): Promise<void> {
    await this.#ask("ParameterSet", { parameter: Parameter[name], value });
  }

  async clear(name: "ClearEstop" | "ClearFault"): Promise<void> {
    await this.#ask(name, {});
  }

  /** @throws SetupFailed Parameters contradict each other, or the board. */
  async refuseContradictions(say: (text: string) => void): Promise<void> {
    const { active } = await this.#ask("ContradictionsGet", {});
    const names = flagsOf(Contradiction, active);
    for (const name of names) say(`contradiction: ${ContradictionDocs[name]}`);
    if (names.length > 0) throw new SetupFailed(SETUP.contradiction);
  }

  /** Try values: unless `act` says to keep them, the robot has its previous ones again. */
  async trial(act: (keep: () => Promise<void>) => Promise<void>): Promise<void> {
    this.#ttlMaxS = await this.get("ttl_max_s");
    await this.#trial(TrialAction.BEGIN);
    this.#isOnTrial = true;
    this.#renewedUs = this.nowUs();
    try {
      await act(async () => {
        await this.#trial(TrialAction.KEEP);
        this.#isOnTrial = false;
      });
    } finally {
      // Also after a failure; if it cannot be sent, the robot reverts by itself.
      const revert = { action: TrialAction.REVERT, timeout_s: TRIAL_S };
      if (this.#isTrying()) await this.program.ask("ParameterTrial", revert).catch(() => undefined);
      this.#isOnTrial = false;
    }
  }

  /** Each by its name: saving all would also save what somebody only tried before. */
  async save(names: readonly ParameterName[]): Promise<void> {
    for (const name of names) await this.#ask("ParameterSave", { parameter: Parameter[name] });
  }

  async #trial(action: number): Promise<void> {
    await this.#ask("ParameterTrial", { action, timeout_s: TRIAL_S });
  }

  #command(send: () => void): void {
    if (this.#failure !== undefined) throw this.#failure;
    try {
      send();
    } catch (error) {
      if (!(error instanceof LinkLost)) throw error; // the next sample does not come, and tells why
    }
  }

  async #ask<R extends Exclude<RequestName, "Stop" | "Estop">>(
    name: R,
    fields: Omit<Asked<R>, "session_id">,
  ): Promise<Answer<R>> {
    if (this.#failure !== undefined) throw this.#failure;
    try {
      return await this.program.ask(name, fields);
    } catch (error) {
      if (!(error instanceof LinkLost)) throw error;
      return await this.#ended;
    }
  }

  #isTrying(): boolean {
    return this.#isOnTrial;
  }

  #renew(): void {
    const nowUs = this.nowUs();
    if (!this.#isOnTrial || nowUs < this.#renewedUs + (TRIAL_S * SECOND_US) / RENEWALS) return;
    this.#renewedUs = nowUs;
    this.#trial(TrialAction.RENEW).catch((error: unknown) => {
      if (this.#isOnTrial && error instanceof WheelwireError) this.fail(error);
    });
  }
}

/** What each of these faults means, in sentences. */
export function meaningOf(faults: number): string {
  return flagsOf(Fault, faults)
    .map((name) => FaultDocs[name])
    .join(" ");
}
