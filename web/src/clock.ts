// The device's clock relative to the host's: offset, and a guaranteed bound. Sans-IO.
//
// As host/wheelwire/link/clock.py, but for the fit of the drift, which a page's short setpoints do not
// need. All times are microseconds.
import type { Messages } from "./generated/protocol.js";

const WINDOW = 16;
const MAX_DRIFT = 500e-6;
const CLOCK_MODULUS = 2 ** 32;
const AHEAD_US = 1_000_000;

interface Reading {
  /** The host's clock in the middle of the exchange. */
  readonly hostUs: number;
  /** The device's clock in the middle of the exchange, less the host's. */
  readonly offsetUs: number;
  readonly roundTripUs: number;
}

/** A time, and the bound of its error. */
export interface Estimate {
  readonly us: number;
  readonly errorUs: number;
}

/** Keeps the exchanges of one session and converts times between the two clocks. */
export class ClockEstimator {
  #readings: Reading[] = [];

  /** @param resolutionUs The host's clock goes in steps of at most this. */
  constructor(readonly resolutionUs = 1) {}

  /** True once there was an exchange; the conversions need one. */
  get synchronised(): boolean {
    return this.#readings.length > 0;
  }

  /** By the exchange that is surest then. */
  hostToDevice(hostUs: number): Estimate {
    const [first, ...more] = this.#readings;
    if (first === undefined) throw new Error("the clock is not synchronised");
    const bound = (one: Reading): number => this.#boundUs(one, hostUs);
    const best = more.reduce((best, one) => (bound(one) < bound(best) ? one : best), first);
    return { us: hostUs + best.offsetUs, errorUs: bound(best) };
  }

  /** The 64-bit device time of a 32-bit one that came at `hostUs`: the latest that is possible. */
  unwrap(tUs: number, hostUs: number): number {
    const { us, errorUs } = this.hostToDevice(hostUs);
    const latestUs = us + Math.ceil(errorUs) + AHEAD_US;
    const behindUs = latestUs - tUs;
    return latestUs - (behindUs - CLOCK_MODULUS * Math.floor(behindUs / CLOCK_MODULUS));
  }

  add(reading: Reading): void {
    // Both bounds hold for certain, so the two can differ by no more than their sum.
    const isStep = this.#readings.some((one) => {
      const bound = this.#boundUs(one, reading.hostUs) + this.#boundUs(reading, reading.hostUs);
      return Math.abs(one.offsetUs - reading.offsetUs) > bound;
    });
    if (isStep) this.#readings = []; // a clock was stepped: earlier readings are void
    this.#readings.push(reading);
    if (this.#readings.length > WINDOW) this.#readings.shift();
  }

  /** A reading is within half its round trip; from then on the clocks drift apart. */
  #boundUs({ hostUs, roundTripUs }: Reading, atUs: number): number {
    return roundTripUs / 2 + MAX_DRIFT * Math.abs(atUs - hostUs) + this.resolutionUs;
  }
}

const BURST = 8;
const BURST_TIMEOUT_US = 25_000;
const PERIOD_US = 500_000;
const OPEN_PINGS = 80;
const MAX_DEVICE_US = 2 ** 52;
const SLACK_US = 1000;
const ID_MODULUS = 1 << 16;

/** Keeps the clock of one session: a burst of pings at its start, then two a second. */
export class Synchroniser {
  readonly clock: ClockEstimator;
  sentUs = 0;
  #burstLeft = BURST;
  /** Pings have their own numbers: an id far ahead of the last request's would count as an old one. */
  #lastId = 0;
  readonly #open = new Map<number, number>();

  constructor(
    readonly sessionId: number,
    readonly send: (ping: Messages["Ping"]) => void,
    public dueUs: number,
    resolutionUs: number,
  ) {
    this.clock = new ClockEstimator(resolutionUs);
  }

  /** The first burst is sent and the clock is known. */
  get ready(): boolean {
    return this.#burstLeft <= 0 && this.clock.synchronised;
  }

  /** Send a ping. A lost one is never repeated: its time would be wrong. */
  ping(nowUs: number): void {
    this.#lastId = (this.#lastId + 1) % ID_MODULUS;
    this.#open.set(this.#lastId, nowUs);
    for (const id of this.#open.keys()) {
      if (this.#open.size <= OPEN_PINGS) break;
      this.#open.delete(id);
    }
    this.#burstLeft--;
    this.sentUs = nowUs;
    this.dueUs = nowUs + (this.ready ? PERIOD_US : BURST_TIMEOUT_US);
    this.send({ session_id: this.sessionId, request_id: this.#lastId, host_us: BigInt(nowUs) });
  }

  /** Take an answer that came at `nowUs`; false if no ping is open or it is impossible. */
  onPong(pong: Messages["Pong"], nowUs: number): boolean {
    const [sentUs, receivedUs, answeredUs] = [pong.host_us, pong.received_us, pong.sent_us].map(
      Number,
    ) as [number, number, number];
    if (this.#open.get(pong.request_id) !== sentUs) return false;
    // The CRC lets one bad frame in four billion pass: a wrong exchange would look like a step.
    const heldUs = answeredUs - receivedUs;
    if (heldUs < 0 || heldUs > nowUs - sentUs + SLACK_US || answeredUs > MAX_DEVICE_US) return false;
    this.#open.delete(pong.request_id);
    const hostUs = Math.floor((sentUs + nowUs) / 2);
    const offsetUs = Math.floor((receivedUs + answeredUs) / 2) - hostUs;
    this.clock.add({ hostUs, offsetUs, roundTripUs: Math.max(0, nowUs - sentUs - heldUs) });
    this.dueUs = this.#burstLeft <= 0 ? nowUs + PERIOD_US : nowUs;
    return true;
  }
}
