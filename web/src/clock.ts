// The device's clock relative to the host's: offset, drift, and a guaranteed bound. Sans-IO.
//
// As host/wheelwire/link/clock.py, which says why the bound holds. All times are microseconds.
import type { Messages } from "./generated/protocol.js";

const WINDOW = 64;
/** Consecutive exchanges, of which a fit takes the one with the shortest round trip. */
const GROUP = 4;
const FIT_FROM = 4 * GROUP;
const SPACING_US = 400_000;
const MAX_DRIFT = 500e-6;
const MAX_SLOPE = 0.1;
const DRIFT_CHANGE = 2e-6;
const RESOLUTION_US = 1;
const CLOCK_MODULUS = 2 ** 32;
const AHEAD_US = 1_000_000;

interface Reading {
  /** The host's clock in the middle of the exchange. */
  readonly hostUs: number;
  /** The device's clock in the middle of the exchange, less the host's. */
  readonly offsetUs: number;
  readonly roundTripUs: number;
}

/** offset(h) = base + a + b (h - origin), the device's clock less the host's. */
class Line {
  constructor(
    readonly originUs: number,
    readonly baseUs: number,
    readonly aUs: number,
    readonly b: number,
    readonly meanUs: number,
    readonly errorUs: number,
    readonly errorSlope: number,
    readonly lastUs: number,
    readonly growth: number,
  ) {}

  offsetUs(hostUs: number): number {
    return this.aUs + this.b * (hostUs - this.originUs);
  }

  hostUs(deviceUs: number): number {
    const elapsed = deviceUs - this.baseUs - this.originUs - this.aUs;
    return this.originUs + Math.round(elapsed / (1 + this.b));
  }

  boundUs(hostUs: number): number {
    const slope = this.errorSlope * (hostUs - this.originUs - this.meanUs);
    return (
      Math.hypot(this.errorUs, slope) + this.growth * Math.abs(hostUs - this.lastUs) + RESOLUTION_US
    );
  }

  /** Both bounds hold for certain, so the two can differ by no more than their sum. */
  contradicts(reading: Reading): boolean {
    const error = Math.abs(reading.offsetUs - this.baseUs - this.offsetUs(reading.hostUs));
    return error > this.boundUs(reading.hostUs) + reading.roundTripUs / 2;
  }
}

/** A time, and the bound of its error. */
export interface Estimate {
  readonly us: number;
  readonly errorUs: number;
}

/** Keeps the exchanges of one session and converts times between the two clocks. */
export class ClockEstimator {
  #readings: Reading[] = [];
  #lines: Line[] = [];

  /** True once there was an exchange; the conversions need one. */
  get synchronised(): boolean {
    return this.#lines.length > 0;
  }

  hostToDevice(hostUs: number): Estimate {
    const line = this.#surest((one) => one.boundUs(hostUs));
    const us = hostUs + line.baseUs + Math.round(line.offsetUs(hostUs));
    return { us, errorUs: line.boundUs(hostUs) };
  }

  deviceToHost(deviceUs: number): Estimate {
    const line = this.#surest((one) => one.boundUs(one.hostUs(deviceUs)));
    const us = line.hostUs(deviceUs);
    return { us, errorUs: line.boundUs(us) };
  }

  /** The 64-bit device time of a 32-bit one that came at `hostUs`: the latest that is possible. */
  unwrap(tUs: number, hostUs: number): number {
    const { us, errorUs } = this.hostToDevice(hostUs);
    const latestUs = us + Math.ceil(errorUs) + AHEAD_US;
    return latestUs - modulo(latestUs - tUs, CLOCK_MODULUS);
  }

  add(reading: Reading): void {
    const newest = this.#readings.at(-1);
    if (this.#lines.some((line) => line.contradicts(reading))) {
      this.#readings = []; // a clock was stepped: earlier readings are void
    } else if (
      newest !== undefined &&
      this.#readings.length >= FIT_FROM &&
      reading.hostUs < newest.hostUs + SPACING_US
    ) {
      return;
    }
    this.#readings.push(reading);
    if (this.#readings.length > WINDOW) this.#readings.shift();
    this.#lines = [constantOffset(this.#readings)];
    if (this.#readings.length >= FIT_FROM) {
      const fitted = fit(this.#readings);
      if (Math.abs(fitted.b) < MAX_SLOPE) this.#lines.push(fitted);
    }
  }

  #surest(bound: (line: Line) => number): Line {
    const [first, second] = this.#lines;
    if (first === undefined) throw new Error("the clock is not synchronised");
    return second !== undefined && bound(second) < bound(first) ? second : first;
  }
}

/** The remainder that has the sign of the divisor. */
function modulo(value: number, divisor: number): number {
  return value - divisor * Math.floor(value / divisor);
}

/** Through the reading that gives the tightest bound now: the bound grows by MAX_DRIFT with age. */
function constantOffset(readings: readonly Reading[]): Line {
  const best = shortest(readings, (one) => one.roundTripUs - 2 * MAX_DRIFT * one.hostUs);
  const { hostUs, offsetUs, roundTripUs } = best;
  return new Line(hostUs, offsetUs, 0, 0, 0, roundTripUs / 2, 0, hostUs, MAX_DRIFT);
}

/** Least squares through the shortest round trip of each group of consecutive readings. */
function fit(readings: readonly Reading[]): Line {
  const chosen: Reading[] = [];
  for (let start = 0; start < readings.length; start += GROUP) {
    chosen.push(shortest(readings.slice(start, start + GROUP), (one) => one.roundTripUs));
  }
  const { hostUs: origin, offsetUs: base } = chosen[0] as Reading;
  const n = chosen.length;
  const times = chosen.map((one) => one.hostUs - origin);
  const offsets = chosen.map((one) => one.offsetUs - base);
  const meanTime = sum(times) / n;
  const meanOffset = sum(offsets) / n;
  const spread = sum(times.map((t) => (t - meanTime) ** 2)) || 1;
  const b =
    sum(times.map((t, i) => (t - meanTime) * ((offsets[i] as number) - meanOffset))) / spread;
  const length = Math.sqrt(sum(chosen.map((one) => one.roundTripUs ** 2)));
  const lastUs = (readings.at(-1) as Reading).hostUs;
  const a = meanOffset - b * meanTime;
  const [error, slope] = [length / 2 / Math.sqrt(n), length / 2 / Math.sqrt(spread)];
  return new Line(origin, base, a, b, meanTime, error, slope, lastUs, DRIFT_CHANGE);
}

function sum(values: readonly number[]): number {
  return values.reduce((total, value) => total + value, 0);
}

function shortest(readings: readonly Reading[], length: (one: Reading) => number): Reading {
  return readings.reduce((best, one) => (length(one) < length(best) ? one : best));
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
  readonly clock = new ClockEstimator();
  sentUs = 0;
  #burstLeft = BURST;
  /** Numbered apart from requests: an id far ahead of the last request's counts as an old one. */
  #lastId = 0;
  readonly #open = new Map<number, number>();

  constructor(
    readonly sessionId: number,
    readonly send: (ping: Messages["Ping"]) => void,
    public dueUs: number,
  ) {}

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
