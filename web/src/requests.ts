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

/** What answers the requests that an Ack does not answer. */
const ANSWERS = {
  ParameterGet: "ParameterValue",
  ParameterSet: "ParameterValue",
  ParameterList: "ParameterEntry",
  HoldGet: "Hold",
  LinkCountersGet: "LinkCounters",
  GroupGet: "GroupInfo",
  ContradictionsGet: "Contradictions",
  ConfigurationGet: "ConfigurationValue",
  PeripheralGet: "PeripheralValue",
  BoxGet: "BoxValue",
  BoxRead: "BoxPart",
  UnsavedGet: "UnsavedValue",
} as const satisfies Partial<Record<Name, Name>>;
type Answers = typeof ANSWERS;
export type RequestName =
  | keyof Answers
  | "Stop"
  | "Estop"
  | "ClearEstop"
  | "ClearFault"
  | "SetStreamRate"
  | "ParameterSave"
  | "ParameterReset"
  | "ParameterTrial"
  | "BoardSet"
  | "PeripheralSet"
  | "ConfigurationWrite"
  | "ConfigurationConfirm"
  | "Restart";
type AnswerOf<R> = R extends keyof Answers ? Answers[R] : "Ack";
export type AnswerName = AnswerOf<RequestName>;
export type Answer<R extends RequestName = RequestName> = Messages[AnswerOf<R>];
export type Done<R extends RequestName = RequestName> = (result: Answer<R> | WheelwireError) => void;

/** The messages that answer a request, and no other. */
export const ANSWER_NAMES: ReadonlySet<Name> = new Set<Name>(["Ack", ...Object.values(ANSWERS)]);

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

const URGENT_IDS = new Set([idOf("Stop"), idOf("Estop")]);

/** The requests of one session after the other. */
export class RequestQueue {
  #waiting: Request[] = [];
  readonly #open = new Map<string, Request>();
  #lastIds = { urgent: 0, other: 0 };

  constructor(readonly send: <R extends RequestName>(name: R, fields: Messages[R]) => void) {}

  /** Count ids from the start: the device has forgotten the previous session's. */
  beginSession(): void {
    this.#lastIds = { urgent: 0, other: 0 };
  }

  /** Send a request, now or after those before it. `done` is called exactly once. */
  submit<R extends RequestName>(name: R, asked: Asked<R>, done: Done<R>, nowUs: number): void {
    const fields = { ...asked, request_id: 0 } as Messages[RequestName];
    const urgent = URGENT_IDS.has(idOf(name));
    const request = { name, fields, done: done as Done, urgent, attempts: 0, deadlineUs: 0 };
    if (urgent) {
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
        this.#send(request, nowUs);
      } else {
        const text = `no answer to ${request.name} after ${request.attempts} attempts`;
        this.#finish(key, new RequestTimeout(`${text}: check the cable`), nowUs);
      }
    }
  }

  /** Take an answer of this session; whether it answers a request. */
  onAnswer(name: Name, answer: Answer, nowUs: number): boolean {
    const ackOf = "message_id" in answer ? answer.message_id : undefined;
    const key = keyOf(ackOf !== undefined && URGENT_IDS.has(ackOf), answer.request_id);
    const request = this.#open.get(key);
    // An id alone is not enough: a previous host's answer may carry the same one.
    if (request === undefined || answerOf(request.name) !== name) return false;
    if (ackOf !== undefined && ackOf !== idOf(request.name)) return false;
    this.#finish(key, answer, nowUs);
    return true;
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
    // Only stops may be open at the same time: the order of all others matters to the device.
    if ([...this.#open.values()].some((request) => !request.urgent)) return;
    const next = this.#waiting.shift();
    if (next !== undefined) this.#begin(next, nowUs);
  }

  #begin(request: Request, nowUs: number): void {
    const kind = request.urgent ? "urgent" : "other";
    let id = (this.#lastIds[kind] + 1) % ID_MODULUS;
    if (request.urgent && id === 0) id = 1;
    this.#lastIds[kind] = request.fields.request_id = id;
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

function answerOf(name: RequestName): Name {
  return (ANSWERS as Partial<Record<Name, Name>>)[name] ?? "Ack";
}

function keyOf(urgent: boolean, id: number): string {
  return `${urgent ? "u" : "r"}${id}`;
}
