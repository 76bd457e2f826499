// Requests: one at a time, repeated until answered, each answer taken once. Sans-IO.
//
// As host/wheelwire/link/requests.py. Stop and Estop do not queue, and count their ids apart.
import { idOf, type Name } from "./codec.js";
import { DeviceRefused, RequestTimeout, type WheelwireError } from "./errors.js";
import { RefusalCode, type Messages } from "./generated/protocol.js";

const REPEAT_US = 25_000;
/** Each repeat waits twice as long as the one before it, up to this: the device may be busy. */
const LONGEST_WAIT_US = 100_000;
const ATTEMPTS = 12;
/** Copies of a stop within a second. Its waits do not grow: each copy does no harm. */
const URGENT_ATTEMPTS = 40;
const ID_MODULUS = 1 << 16;

/** The requests that this client sends, and what answers each of them. */
export interface Answers {
  Stop: "Ack";
  Estop: "Ack";
  ClearEstop: "Ack";
  ClearFault: "Ack";
  SetStreamRate: "Ack";
  ParameterGet: "ParameterValue";
  ParameterSet: "ParameterValue";
  ParameterSave: "Ack";
  HoldGet: "Hold";
  LinkCountersGet: "LinkCounters";
}
export type RequestName = keyof Answers & Name;
export type AnswerName = Answers[RequestName];
export type Answer<R extends RequestName = RequestName> = Messages[Answers[R]];
export type Done<R extends RequestName = RequestName> = (result: Answer<R> | WheelwireError) => void;

const ANSWERS: Answers = {
  Stop: "Ack",
  Estop: "Ack",
  ClearEstop: "Ack",
  ClearFault: "Ack",
  SetStreamRate: "Ack",
  ParameterGet: "ParameterValue",
  ParameterSet: "ParameterValue",
  ParameterSave: "Ack",
  HoldGet: "Hold",
  LinkCountersGet: "LinkCounters",
};

/** The fields of a request but its id, which the queue draws. */
export type Asked<R extends RequestName> = Omit<Messages[R], "request_id">;

interface Request {
  readonly name: RequestName;
  readonly fields: Messages[RequestName];
  readonly done: Done;
  readonly urgent: boolean;
  attempts: number;
  deadlineUs: number;
}

function isUrgent(name: RequestName): boolean {
  return name === "Stop" || name === "Estop";
}

const URGENT_IDS = new Set([idOf("Stop"), idOf("Estop")]);

/** The requests of one session after the other. */
export class RequestQueue {
  repeated = 0;
  #waiting: Request[] = [];
  readonly #open = new Map<string, Request>();
  readonly #lastIds = { urgent: 0, other: 0 };

  constructor(readonly send: <R extends RequestName>(name: R, fields: Messages[R]) => void) {}

  /** When `advance` has something to do; infinite if never. */
  get nextDeadlineUs(): number {
    return Math.min(...[...this.#open.values()].map((request) => request.deadlineUs));
  }

  /** Count ids from the start: the device has forgotten the previous session's. */
  beginSession(): void {
    this.#lastIds.urgent = this.#lastIds.other = 0;
  }

  /** Send a request, now or after those before it. `done` is called exactly once. */
  submit<R extends RequestName>(name: R, asked: Asked<R>, done: Done<R>, nowUs: number): void {
    const request: Request = {
      name,
      fields: { ...asked, request_id: 0 },
      done: done as Done,
      urgent: isUrgent(name),
      attempts: 0,
      deadlineUs: 0,
    };
    if (request.urgent) {
      this.#begin(request, nowUs);
    } else {
      this.#waiting.push(request);
      this.#beginNext(nowUs);
    }
  }

  /** Repeat what has waited long enough; give up what was repeated often enough. */
  advance(nowUs: number): void {
    for (const [key, request] of [...this.#open]) {
      if (request.deadlineUs > nowUs || this.#open.get(key) !== request) continue;
      if (request.attempts < (request.urgent ? URGENT_ATTEMPTS : ATTEMPTS)) {
        this.repeated++;
        this.#send(request, nowUs);
      } else {
        const text = `no answer to ${request.name} after ${request.attempts} attempts`;
        this.#finish(key, new RequestTimeout(`${text}: check the cable`), nowUs);
      }
    }
  }

  /** Take an answer of this session; the request it answers, or undefined if it answers none. */
  onAnswer(name: AnswerName, answer: Answer, nowUs: number): RequestName | undefined {
    const ackOf = "message_id" in answer ? answer.message_id : undefined;
    const key = keyOf(ackOf !== undefined && URGENT_IDS.has(ackOf), answer.request_id);
    const request = this.#open.get(key);
    // An id alone is not enough: a previous host's answer may carry the same one.
    if (request === undefined || ANSWERS[request.name] !== name) return undefined;
    if (ackOf !== undefined && ackOf !== idOf(request.name)) return undefined;
    this.#finish(key, answer, nowUs);
    return request.name;
  }

  /** Take a refusal of this session; false when it refuses no open request. */
  onRefuse(refuse: Messages["Refuse"], nowUs: number, faults: number): boolean {
    const key = keyOf(URGENT_IDS.has(refuse.message_id), refuse.reference);
    const request = this.#open.get(key);
    if (request === undefined || refuse.message_id !== idOf(request.name)) return false;
    const held = request.name === "ClearFault" || refuse.code === RefusalCode.FAULT;
    this.#finish(key, new DeviceRefused(refuse.code, request.name, held ? faults : 0), nowUs);
    return true;
  }

  /** End all requests with `error`. */
  abort(error: WheelwireError): void {
    const requests = [...this.#open.values(), ...this.#waiting];
    this.#open.clear();
    this.#waiting = [];
    for (const request of requests) request.done(error);
  }

  #beginNext(nowUs: number): void {
    // Only stops may be open beside it: the order of all others matters to the device.
    if ([...this.#open.values()].some((request) => !request.urgent)) return;
    const next = this.#waiting.shift();
    if (next !== undefined) this.#begin(next, nowUs);
  }

  #begin(request: Request, nowUs: number): void {
    const kind = request.urgent ? "urgent" : "other";
    let id = (this.#lastIds[kind] + 1) % ID_MODULUS;
    if (request.urgent && id === 0) id = 1;
    this.#lastIds[kind] = id;
    request.fields.request_id = id;
    this.#send(request, nowUs);
    this.#open.set(keyOf(request.urgent, id), request);
  }

  #send(request: Request, nowUs: number): void {
    request.attempts++;
    const doublings = request.urgent ? 0 : request.attempts - 1;
    request.deadlineUs = nowUs + Math.min(REPEAT_US * 2 ** doublings, LONGEST_WAIT_US);
    this.send(request.name, request.fields);
  }

  #finish(key: string, result: Answer | WheelwireError, nowUs: number): void {
    const request = this.#open.get(key);
    this.#open.delete(key);
    this.#beginNext(nowUs);
    request?.done(result);
  }
}

function keyOf(urgent: boolean, id: number): string {
  return `${urgent ? "u" : "r"}${id}`;
}
