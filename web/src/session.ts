// One host's session with one device: hello, preparation, and dispatch of messages.
//
//   CLOSED -> HELLO -> PREPARING -> OPEN      and from any of them back to HELLO or CLOSED
//
// As host/wheelwire/link/session.py, for a page: bytes and times in; bytes and samples out. All times are
// microseconds of one monotonic host clock.
import { Synchroniser } from "./clock.js";
import { idOf, joined, type Message, type Name } from "./codec.js";
import { LinkLost, ProtocolMismatch, WheelwireError, nameOf } from "./errors.js";
import { Decoder, Encoder, type Counters } from "./framing.js";
import {
  PROTOCOL_VERSION,
  RefusalCode,
  RefusalCodeDocs,
  SCHEMA_HASH,
  StopMode,
  SupervisorState,
  type Messages,
  type WheelState,
} from "./generated/protocol.js";
import { ANSWER_NAMES, RequestQueue, type Answer, type Asked, type Done, type RequestName } from "./requests.js";
import { SetpointSender, dutyAim } from "./setpoints.js";

const HELLO_PERIOD_US = 30_000;
const RETRY_US = 1_000_000;
/** No pong and no state frame for this long: the session is over, say hello again. */
const SILENCE_US = 2_000_000;
/** Nothing was received for this long: ping, because a device that was reset sends nothing. */
const QUIET_US = 100_000;
const QUIET_PERIOD_US = 25_000;

export type Phase = "CLOSED" | "HELLO" | "PREPARING" | "OPEN";

/** What was measured at one instant. */
export interface Sample extends WheelState {
  /** The device's clock at the latch, 64 bits. [us] */
  readonly tUs: number;
}

const SETPOINT_IDS = new Set([idOf("SetWheelVelocity"), idOf("SetDuty")]);
const STATES: ReadonlySet<number> = new Set(Object.values(SupervisorState));

/** The host's side of the link, for one session after another. */
export class Session {
  phase: Phase = "CLOSED";
  /** Its id on the wire; 0 outside one. */
  id = 0;
  /** The reason why no session is open; meaningless while one is. */
  error: WheelwireError = new LinkLost("the port was not opened yet");
  /** What the device said last of itself. */
  device: Messages["DeviceHello"] | undefined;
  /** The device's last report of what holds it and of its last stop. */
  hold: Messages["Hold"] | undefined;
  /** As in SupervisorState; undefined when it is about to change, or no session is open. */
  state: number | undefined;
  faults = 0;
  /** Number of sessions so far. */
  count = 0;
  /** Answers to hellos so far, even if they opened no session: a Wheelwire device is there. */
  answers = 0;
  /** Messages of other sessions, or that were not asked for. */
  foreign = 0;
  setpoints: SetpointSender | undefined;
  /** The host's clock goes in steps of at most this. */
  resolutionUs = 1;

  readonly #decoder = new Decoder();
  #encoder = new Encoder();
  #output: Uint8Array[] = [];
  #nonce = 0;
  #bootId: number | undefined;
  readonly #oldBoots = new Set<number>();
  #helloDueUs = 0;
  #heardUs = 0;
  #unprepared = 0;
  #preparationFailure: WheelwireError | undefined;
  #newestUs: number | undefined;
  #synchroniser = new Synchroniser(0, () => undefined, 0, 1);
  readonly #requests = new RequestQueue((name, fields) => { this.#send(name, fields); });

  /**
   * @param drawNonce Draws 32 random bits for each session.
   * @param streamRateHz Rate of the state frames.
   */
  constructor(
    readonly drawNonce: () => number,
    readonly streamRateHz: number,
  ) {}

  get counters(): Readonly<Counters> {
    return this.#decoder.counters;
  }

  // --- the port ----------------------------------------------------------------------------------

  /** The port is open: say hello. */
  connect(nowUs: number): void {
    this.#encoder = new Encoder();
    this.#decoder.restart();
    this.#output = [];
    this.#beginHello(new LinkLost("the device has not answered yet"), nowUs);
  }

  /** The port is closed, or gone. */
  disconnect(error: LinkLost, nowUs: number): void {
    this.#beginHello(error, nowUs);
    this.phase = "CLOSED";
    this.#output = [];
  }

  /** Process any bytes; returns the new measurement. */
  receive(data: Uint8Array, nowUs: number): Sample[] {
    const samples: Sample[] = [];
    for (const message of this.#decoder.feed(data)) {
      const sample = this.#take(message, nowUs);
      if (sample !== undefined) samples.push(sample);
    }
    // At once, not at the next `advance`: the last answer may just have come.
    this.#openWhenPrepared(nowUs);
    return samples;
  }

  /** Do what is due: hello, pings, repeats, the end of a session whose device is silent. */
  advance(nowUs: number): void {
    if (this.phase === "HELLO") {
      this.#sayHello(nowUs);
    } else if (this.#inSession && nowUs >= this.#heardUs + SILENCE_US) {
      const text = "the device fell silent; saying hello until it answers";
      this.#beginHello(new LinkLost(text), nowUs);
    }
    if (!this.#inSession) return;
    this.#requests.advance(nowUs);
    this.setpoints?.advance(nowUs);
    if (nowUs >= this.#pingDueUs) this.#synchroniser.ping(nowUs);
    this.#openWhenPrepared(nowUs);
  }

  /** Return the bytes to send, and forget them. */
  takeOutput(): Uint8Array {
    const frames = this.#output;
    this.#output = [];
    return joined(frames);
  }

  // --- what the program asks for -----------------------------------------------------------------

  /**
   * Send a velocity setpoint of both wheels that expires at `expiryUs`.
   *
   * @throws LinkLost, ProtocolMismatch No session is open.
   * @throws DeviceRefused, Expired As SetpointSender.drive.
   */
  drive(leftMps: number, rightMps: number, expiryUs: number, nowUs: number): void {
    this.#opened.drive({ left_mps: leftMps, right_mps: rightMps }, expiryUs, nowUs, this.state, this.faults);
  }

  /** The same for a duty of each bridge, -1 to 1, in place of a speed. */
  setDuty(left: number, right: number, expiryUs: number, nowUs: number): void {
    this.#opened.drive(dutyAim(left, right), expiryUs, nowUs, this.state, this.faults);
  }

  /** Void the setpoint and stop. Without a session it is sent, but not acknowledged. */
  stop(done: Done<"Stop">, nowUs: number): void {
    // Numbered from the setpoints' counter, so that those still on their way are void.
    const command_seq = this.setpoints?.nextSeq() ?? 0;
    this.#stop("Stop", { session_id: this.id, command_seq, mode: StopMode.CONFIGURED }, done, nowUs);
  }

  /** Stop, and latch until it is cleared. Without a session it is sent, but not acknowledged. */
  estop(done: Done<"Estop">, nowUs: number): void {
    this.#stop("Estop", { session_id: this.id }, done, nowUs);
  }

  /**
   * Send a request. `done` is called once, with the answer or the error.
   *
   * @throws LinkLost, ProtocolMismatch No session is open.
   */
  request<R extends Exclude<RequestName, "Stop" | "Estop">>(
    name: R,
    fields: Omit<Asked<R>, "session_id">,
    done: Done<R>,
    nowUs: number,
  ): void {
    if (this.phase !== "OPEN") throw this.error;
    const clears = name === "ClearEstop" || name === "ClearFault";
    if (clears) this.setpoints?.void(); // only what is commanded from now on may move the wheels
    const asked = { ...fields, session_id: this.id } as unknown as Asked<R>;
    const finish: Done<R> = (result) => {
      // Until the next state frame tells, assume that the device is no longer latched.
      if (clears && !(result instanceof WheelwireError)) this.state = undefined;
      done(result);
    };
    this.#requests.submit(name, asked, finish, nowUs);
  }

  #stop<R extends "Stop" | "Estop">(name: R, asked: Asked<R>, done: Done<R>, nowUs: number): void {
    this.setpoints?.void();
    if (this.phase === "OPEN") {
      this.#requests.submit(name, asked, done, nowUs);
      return;
    }
    // The device obeys a stop of anybody; whether it arrived is then not known.
    if (this.phase !== "CLOSED") {
      this.#send(name, { ...asked, request_id: 0 } as unknown as Messages[R]);
    }
    done(this.error);
  }

  get #opened(): SetpointSender {
    if (this.phase !== "OPEN" || this.setpoints === undefined) throw this.error;
    return this.setpoints;
  }

  // --- hello, and the end of a session -----------------------------------------------------------

  get #inSession(): boolean {
    return this.phase === "PREPARING" || this.phase === "OPEN";
  }

  #beginHello(error: WheelwireError, nowUs: number, pauseUs = 0): void {
    this.error = error;
    this.phase = "HELLO";
    this.setpoints = undefined;
    this.hold = undefined;
    this.state = undefined;
    this.id = 0;
    this.#bootId = undefined;
    this.#requests.abort(error);
    // A new one, so that a late answer to a previous hello cannot begin this session.
    this.#nonce = this.drawNonce() >>> 0;
    this.#helloDueUs = nowUs + pauseUs;
    this.#sayHello(nowUs);
  }

  #sayHello(nowUs: number): void {
    if (nowUs < this.#helloDueUs) return;
    this.#helloDueUs = nowUs + HELLO_PERIOD_US;
    this.#send("Hello", { nonce: this.#nonce, protocol_version: PROTOCOL_VERSION, schema_hash: SCHEMA_HASH });
  }

  #onHello(hello: Messages["DeviceHello"], nowUs: number): void {
    if (hello.nonce !== this.#nonce) {
      this.foreign++;
      return;
    }
    this.answers++;
    this.device = hello;
    if (this.#inSession) {
      this.#beginAnewIfReset(hello.boot_id, nowUs);
      return;
    }
    const refusal = refusalOf(hello);
    if (refusal !== undefined) {
      this.error = refusal; // hellos go on: the device may be flashed at any time
      return;
    }
    this.phase = "PREPARING";
    this.count++;
    this.id = (this.#nonce ^ hello.boot_id) >>> 0;
    this.#bootId = hello.boot_id;
    this.#oldBoots.add(hello.boot_id);
    this.#heardUs = nowUs;
    this.#newestUs = undefined;
    this.faults = 0;
    this.#decoder.restartSequence();
    this.#requests.beginSession();
    const ping = (fields: Messages["Ping"]): void => { this.#send("Ping", fields); };
    this.#synchroniser = new Synchroniser(this.id, ping, nowUs, this.resolutionUs);
    this.#synchroniser.ping(nowUs);
    this.#unprepared = 1;
    this.#preparationFailure = undefined;
    const rate = { session_id: this.id, rate_hz: this.streamRateHz };
    const prepared: Done<"SetStreamRate"> = (answer) => {
      this.#unprepared--;
      if (answer instanceof WheelwireError) this.#preparationFailure ??= answer;
    };
    this.#requests.submit("SetStreamRate", rate, prepared, nowUs);
  }

  #openWhenPrepared(nowUs: number): void {
    if (this.phase !== "PREPARING") return;
    const failure = this.#preparationFailure;
    if (failure !== undefined) {
      this.#beginHello(failure, nowUs, RETRY_US);
    } else if (this.#unprepared === 0 && this.#synchroniser.ready) {
      this.setpoints = new SetpointSender(this.id, this.#synchroniser.clock, (setpoint) => {
        if ("left_mps" in setpoint) this.#send("SetWheelVelocity", setpoint);
        else this.#send("SetDuty", setpoint);
      });
      this.phase = "OPEN";
    }
  }

  // --- what the device says ----------------------------------------------------------------------

  #take(message: Message, nowUs: number): Sample | undefined {
    const { name, fields } = message;
    if (name === "WheelState") return this.#onState(fields, nowUs);
    if (name === "DeviceHello") this.#onHello(fields, nowUs);
    else if (name === "Pong") this.#onPong(fields, nowUs);
    else if (name === "Refuse") this.#onRefuse(fields, nowUs);
    else if (name === "Event") this.#onEvent(fields, nowUs);
    else if (ANSWER_NAMES.has(name)) this.#onAnswer(name, fields as Answer, nowUs);
    else this.foreign++; // of a group that was not asked for, or an echo
    return undefined;
  }

  /** Whether a message belongs to this session. If so, the device counts as heard. */
  #isOurs(sessionId: number, nowUs: number): boolean {
    const ours = this.#inSession && sessionId === this.id;
    if (ours) this.#heardUs = nowUs;
    else this.foreign++;
    return ours;
  }

  #isThisBoot(bootId: number, nowUs: number): boolean {
    if (bootId === this.#bootId) {
      this.#heardUs = nowUs;
      return true;
    }
    if (this.#bootId !== undefined) this.#beginAnewIfReset(bootId, nowUs);
    return false;
  }

  #beginAnewIfReset(bootId: number, nowUs: number): void {
    if (this.#oldBoots.has(bootId)) return;
    this.#beginHello(new LinkLost("the device was reset; a new session is being opened"), nowUs);
  }

  #onState(state: WheelState, nowUs: number): Sample | undefined {
    if (!this.#isThisBoot(state.boot_id, nowUs) || this.phase !== "OPEN") return undefined;
    if (!STATES.has(state.supervisor)) return undefined;
    const tUs = this.#synchroniser.clock.unwrap(state.t_us, nowUs);
    if (this.#newestUs !== undefined && tUs <= this.#newestUs) return undefined;
    this.#newestUs = tUs;
    this.state = state.supervisor;
    this.faults = state.faults;
    this.setpoints?.onObeyed(state.command_seq);
    return { ...state, tUs };
  }

  #onPong(pong: Messages["Pong"], nowUs: number): void {
    if (this.#isOurs(pong.session_id, nowUs) && !this.#synchroniser.onPong(pong, nowUs)) this.foreign++;
  }

  #onEvent(event: Messages["Event"], nowUs: number): void {
    if (!this.#isThisBoot(event.boot_id, nowUs) || !STATES.has(event.after)) return;
    this.state = event.after;
    this.faults = event.faults;
  }

  #onRefuse(refuse: Messages["Refuse"], nowUs: number): void {
    if (!this.#isOurs(refuse.session_id, nowUs)) return;
    if (refuse.code === RefusalCode.NO_SESSION) {
      const text = "the device no longer knows this session; opening a new one";
      this.#beginHello(new LinkLost(text), nowUs);
    } else if (SETPOINT_IDS.has(refuse.message_id)) {
      this.setpoints?.onRefused(refuse);
    } else if (!this.#requests.onRefuse(refuse, nowUs, this.faults)) {
      this.foreign++;
    }
  }

  #onAnswer(name: Name, answer: Answer, nowUs: number): void {
    if (!this.#isOurs(answer.session_id, nowUs)) return;
    if (name === "Hold") {
      this.hold = answer as Messages["Hold"];
      if (answer.request_id === 0) return; // the device says it by itself
    }
    if (!this.#requests.onAnswer(name, answer, nowUs)) this.foreign++;
  }

  // --- sending -----------------------------------------------------------------------------------

  #send<N extends Name>(name: N, fields: Messages[N]): void {
    this.#output.push(this.#encoder.encode(name, fields));
  }

  get #pingDueUs(): number {
    const { dueUs, sentUs } = this.#synchroniser;
    return Math.min(dueUs, Math.max(this.#heardUs + QUIET_US, sentUs + QUIET_PERIOD_US));
  }
}

/** Why the device opens no session, naming both sides and what to do; undefined if it does. */
function refusalOf(hello: Messages["DeviceHello"]): ProtocolMismatch | WheelwireError | undefined {
  const hex = (value: number): string => `0x${value.toString(16).padStart(8, "0")}`;
  const version = `${hello.version_major}.${hello.version_minor}.${hello.version_patch}`;
  if (hello.protocol_version !== PROTOCOL_VERSION || hello.schema_hash !== SCHEMA_HASH) {
    return new ProtocolMismatch(
      `this page speaks protocol ${PROTOCOL_VERSION} with schema ${hex(SCHEMA_HASH)}, the ` +
        `firmware ${version} protocol ${hello.protocol_version} with schema ` +
        `${hex(hello.schema_hash)}: use page and firmware of one release`,
    );
  }
  if (hello.refusal === RefusalCode.NONE) return undefined;
  const name = nameOf(RefusalCode, hello.refusal);
  const reason = name === undefined ? `code ${hello.refusal}` : RefusalCodeDocs[name];
  return new WheelwireError(`the device opens no session: ${reason}`);
}
