// The program that drives: what a person asks for, as setpoints that expire. Sans-IO.
//
// It drives only on a fresh request. Everything that ends a drive (a stop, a latch, a silent robot, a pause of this
// program) ends the request as well, and only the person can make a new one.
import { DeviceRefused, WheelwireError } from "./errors.js";
import { DEFAULTS, Parameter } from "./generated/protocol.js";
import type { Answer, Asked, Done, RequestName } from "./requests.js";
import type { Transport } from "./serial/port.js";
import { Session, type Sample } from "./session.js";

export const STREAM_RATE_HZ = 100;
/** Life of each setpoint. */
export const TTL_US = 300_000;
const PERIOD_US = 50_000;
const FIGURE_EIGHT_MPS = 0.2;
const FIGURE_EIGHT_RADPS = 0.8;
/** The speed limits that it saves alternately. */
export const LIMITS_MPS = [DEFAULTS.max_velocity_mps, 0.35] as const;
const CIRCLE_US = Math.round((2 * Math.PI * 1e6) / FIGURE_EIGHT_RADPS);

/** Forward, and counter-clockwise. */
export interface Twist {
  readonly mps: number;
  readonly radps: number;
}

/** What the wheels were asked for, at the rim. */
export interface WheelSpeeds {
  readonly leftMps: number;
  readonly rightMps: number;
}

/** A measurement, called for each sample, and each time that the program runs. */
export interface Observer {
  onSample: (sample: Sample) => void;
  onAdvance: (nowUs: number) => void;
}

const STANDSTILL: WheelSpeeds = { leftMps: 0, rightMps: 0 };

export class Program {
  readonly session: Session;
  /** The newest sample that it received. */
  sample: Sample | undefined;
  observer: Observer | undefined;
  #wish: ((nowUs: number) => Twist | undefined) | undefined;
  #isArmed = false;
  #dueUs = 0;
  #commanded = STANDSTILL;
  #expiryUs = 0;
  #wasOpen = false;
  #nowUs = 0;
  /** When the robot's newest sample came, or the drive began. */
  #heardUs = 0;
  /** The robot's speed limit, once it said so in this session. [m/s] */
  limitMps: number | undefined;
  #separationM: number | undefined;

  /**
   * @param drawNonce Draws 32 random bits.
   * @param say Takes what a person should know.
   */
  constructor(
    drawNonce: () => number,
    readonly say: (text: string) => void,
  ) {
    this.session = new Session(drawNonce, STREAM_RATE_HZ);
  }

  /** Whether it sends setpoints. */
  get isDriving(): boolean {
    return this.#wish !== undefined;
  }

  /** The newest setpoint that may still be obeyed. */
  commanded(nowUs: number): WheelSpeeds {
    return nowUs < this.#expiryUs ? this.#commanded : STANDSTILL;
  }

  /** Drive like this until it is asked for something else. */
  drive(twist: Twist): void {
    this.#begin(() => twist);
  }

  /** Two circles, one to each side, by the clock. */
  figureEight(nowUs: number): void {
    this.#isArmed = false;
    this.#begin((atUs) => {
      const elapsedUs = atUs - nowUs;
      if (elapsedUs >= 2 * CIRCLE_US) return undefined;
      const radps = elapsedUs < CIRCLE_US ? FIGURE_EIGHT_RADPS : -FIGURE_EIGHT_RADPS;
      return { mps: FIGURE_EIGHT_MPS, radps };
    });
  }

  /** @param done Called once the robot says that it stops, or does not answer. */
  stop(nowUs: number, done: () => void = () => undefined): void {
    this.#end();
    this.session.stop(done, nowUs);
  }

  estop(nowUs: number): void {
    this.#end();
    const isSent = this.session.phase === "HELLO" || this.session.phase === "PREPARING";
    this.session.estop((result) => {
      if (isSent) this.say("e-stop: sent, but no session confirms it; press it again if the robot still moves");
      else this.#sayFailure("e-stop", result);
    }, nowUs);
  }

  /** Drive the bridges with duties, -1 to 1, once, for this long; any other drive ends. */
  setDuty(left: number, right: number, ttlUs: number, nowUs: number): void {
    this.#end();
    this.session.setDuty(left, right, nowUs + ttlUs, nowUs);
    this.#expiryUs = nowUs + ttlUs; // and so an absence ends it
  }

  /** Clear what is latched; it moves nothing. */
  clear(nowUs: number): void {
    this.#end();
    try {
      for (const name of ["ClearEstop", "ClearFault"] as const) {
        this.session.request(name, {}, (result) => { this.#sayFailure("clear", result); }, nowUs);
      }
    } catch (error) {
      this.#sayFailure("clear", error);
    }
  }

  /** Stop, change the speed limit, and save that. */
  save(nowUs: number): void {
    this.stop(nowUs);
    const now = (): number => this.#nowUs;
    const parameter = Parameter.max_velocity_mps;
    const [usual, other] = LIMITS_MPS;
    const value = isClose(this.limitMps, usual) ? other : usual;
    const saved: Done<"ParameterSave"> = (result) => {
      this.#sayFailure("save", result);
    };
    const set: Done<"ParameterSet"> = (result) => {
      this.#sayFailure("save", result);
      if (result instanceof WheelwireError) return;
      this.session.request("ParameterSave", { parameter }, saved, now());
    };
    try {
      this.session.request("ParameterSet", { parameter, value }, set, nowUs);
    } catch (error) {
      this.#sayFailure("save", error);
    }
  }

  /** It did not run for a while: what was wished before is out of date. */
  wake(nowUs: number): void {
    if (this.#wish !== undefined || nowUs < this.#expiryUs) this.stop(nowUs);
    this.#end();
  }

  /** Take what came over a line, do what is due, and send. */
  run(line: Transport, nowUs: number): void {
    this.#receive(line.take(), nowUs);
    this.#advance(nowUs);
    line.write(this.session.takeOutput());
  }

  /**
   * Send a request, and wait for its answer.
   *
   * @throws WheelwireError No session is open, the device refuses, or no answer comes.
   */
  ask<R extends Exclude<RequestName, "Stop" | "Estop">>(
    name: R,
    fields: Omit<Asked<R>, "session_id">,
  ): Promise<Answer<R>> {
    return new Promise((resolve, reject) => {
      const done: Done<R> = (result) => {
        if (result instanceof WheelwireError) reject(result);
        else resolve(result);
      };
      this.session.request(name, fields, done, this.#nowUs);
    });
  }

  #receive(bytes: Uint8Array, nowUs: number): void {
    this.#nowUs = nowUs;
    const samples = this.session.receive(bytes, nowUs);
    if (samples.length === 0) return;
    this.sample = samples.at(-1);
    this.#heardUs = nowUs;
    for (const sample of samples) this.observer?.onSample(sample);
  }

  #advance(nowUs: number): void {
    this.session.advance(nowUs);
    const isOpen = this.session.phase === "OPEN";
    if (this.#wasOpen && !isOpen) {
      this.#end(); // the next session begins at rest
      this.limitMps = this.#separationM = undefined;
    }
    if (!this.#wasOpen && isOpen) this.#readParameters(nowUs);
    this.#wasOpen = isOpen;
    this.observer?.onAdvance(nowUs);
    if (this.#wish === undefined || nowUs < this.#dueUs) return;
    if (nowUs > this.#heardUs + TTL_US) {
      this.stop(nowUs);
      this.say(`nothing came from the robot for ${TTL_US / 1000} ms: the program drives no more`);
      return;
    }
    this.#dueUs = nowUs + PERIOD_US;
    const twist = this.#wish(nowUs);
    if (twist === undefined) {
      this.stop(nowUs);
      return;
    }
    try {
      this.#send(twist, nowUs);
    } catch (error) {
      this.#end();
      this.#sayFailure("drive", error);
    }
  }

  #readParameters(nowUs: number): void {
    const read = (name: "max_velocity_mps" | "wheel_separation", take: (value: number) => void): void => {
      const done: Done<"ParameterGet"> = (result) => {
        if (!(result instanceof WheelwireError)) take(result.value);
      };
      this.session.request("ParameterGet", { parameter: Parameter[name] }, done, nowUs);
    };
    read("max_velocity_mps", (value) => { this.limitMps = value; });
    read("wheel_separation", (value) => { this.#separationM = value; });
  }

  #begin(wish: (nowUs: number) => Twist | undefined): void {
    if (this.#wish === undefined) this.#isArmed = false;
    this.#wish = wish;
    this.#heardUs = Math.max(this.#heardUs, this.#nowUs);
    this.#dueUs = 0;
  }

  #end(): void {
    this.#wish = undefined;
    this.#isArmed = false;
    this.#expiryUs = 0;
    this.#commanded = STANDSTILL;
  }

  #send(twist: Twist, nowUs: number): void {
    const half = (twist.radps * (this.#separationM ?? DEFAULTS.wheel_separation)) / 2;
    const speeds = { leftMps: twist.mps - half, rightMps: twist.mps + half };
    const expiryUs = nowUs + TTL_US;
    // A person pressed again: the zero before it shows that no program just kept sending.
    if (!this.#isArmed) this.session.drive(0, 0, expiryUs, nowUs);
    this.#isArmed = true;
    this.session.drive(speeds.leftMps, speeds.rightMps, expiryUs, nowUs);
    this.#commanded = speeds;
    this.#expiryUs = expiryUs;
  }

  #sayFailure(what: string, result: unknown): void {
    if (!(result instanceof WheelwireError)) {
      if (result instanceof Error) throw result;
      return;
    }
    const isKnown = result instanceof DeviceRefused;
    this.say(isKnown ? `${what}: ${result.message}` : `${what} was not possible: ${result.message}`);
  }
}

/** Whether a value that travelled in 32 bits is this one. */
export function isClose(value: number | undefined, expected: number): boolean {
  return value !== undefined && Math.abs(value - expected) < 1e-6;
}
