// The session against a scripted device: what it sends, refuses and repeats, in virtual time.
import { beforeEach, describe, expect, test } from "vitest";
import type { Message, Name } from "../src/codec.js";
import { idOf } from "../src/codec.js";
import { DeviceRefused, Expired, LinkLost, ProtocolMismatch, RequestTimeout } from "../src/errors.js";
import { Decoder, Encoder } from "../src/framing.js";
import {
  PROTOCOL_VERSION,
  RefusalCode,
  SCHEMA_HASH,
  SupervisorState,
  type Messages,
} from "../src/generated/protocol.js";
import { Session } from "../src/session.js";

const NONCE = 0x1a2b3c4d;
const BOOT_ID = 0x01020304;
const STEP_US = 1000;
/** The device's clock is ahead of the host's by this. */
const OFFSET_US = 7_000_000;

/** A device that answers by a table; what a test takes out of it stays unanswered. */
class Device {
  nowUs = 0;
  bootId = BOOT_ID;
  hello: Partial<Messages["DeviceHello"]> = {};
  readonly heard: Message[] = [];
  readonly mute = new Set<Name>();
  readonly session = new Session(() => NONCE, 100);
  readonly #decoder = new Decoder();
  #encoder = new Encoder();
  #toHost: Uint8Array[] = [];

  say<N extends Name>(name: N, fields: Messages[N]): void {
    this.#toHost.push(this.#encoder.encode(name, fields));
  }

  run(us: number): void {
    for (const end = this.nowUs + us; this.nowUs < end; ) {
      this.nowUs += STEP_US;
      for (const bytes of this.#toHost.splice(0)) this.session.receive(bytes, this.nowUs);
      this.session.advance(this.nowUs);
      for (const message of this.#decoder.feed(this.session.takeOutput())) {
        this.heard.push(message);
        if (!this.mute.has(message.name)) this.#answer(message);
      }
    }
  }

  /** The fields of all messages of a name that it has heard. */
  all<N extends Name>(name: N): Messages[N][] {
    return this.heard.filter((one) => one.name === name).map((one) => one.fields as Messages[N]);
  }

  /** A state frame of now, at rest. */
  wheels(fields: Partial<Messages["WheelState"]> = {}): Messages["WheelState"] {
    return {
      boot_id: this.bootId,
      t_us: (this.nowUs + OFFSET_US) % 2 ** 32,
      left_ticks: 0,
      right_ticks: 0,
      left_mps: 0,
      right_mps: 0,
      left_duty_q15: 0,
      right_duty_q15: 0,
      command_seq: 0,
      supervisor: SupervisorState.IDLE,
      faults: 0,
      overruns: 0,
      battery_mv: 0,
      ...fields,
    };
  }

  state(fields: Partial<Messages["WheelState"]> = {}): void {
    this.say("WheelState", this.wheels(fields));
  }

  refuse(name: Name, reference: number, code: number): void {
    this.say("Refuse", { session_id: this.session.id, message_id: idOf(name), code, reference });
  }

  #answer(message: Message): void {
    const deviceUs = BigInt(this.nowUs + OFFSET_US);
    if (message.name === "Hello") {
      this.say("DeviceHello", {
        nonce: message.fields.nonce,
        protocol_version: PROTOCOL_VERSION,
        schema_hash: SCHEMA_HASH,
        refusal: RefusalCode.NONE,
        boot_id: this.bootId,
        device_us: deviceUs,
        reset_reason: 1,
        board: 0,
        board_id: 1n,
        capabilities: 0,
        version_major: 0,
        version_minor: 1,
        version_patch: 0,
        git_hash: 0,
        ...this.hello,
      });
    } else if (message.name === "Ping") {
      this.say("Pong", { ...message.fields, received_us: deviceUs, sent_us: deviceUs });
    } else if ("request_id" in message.fields && "session_id" in message.fields) {
      const { session_id, request_id } = message.fields;
      this.say("Ack", { session_id, request_id, message_id: idOf(message.name) });
    }
  }
}

let device: Device;
let session: Session;

beforeEach(() => {
  device = new Device();
  session = device.session;
  session.connect(0);
});

function open(): void {
  device.run(400_000);
  expect(session.phase).toBe("OPEN");
}

/** A setpoint that lives for so long. */
function drive(lifeUs = 300_000): void {
  session.drive(0.1, 0.1, device.nowUs + lifeUs, device.nowUs);
}

/** Ask for something; what comes of it will be in the list. */
function request<N extends "ParameterSave" | "ClearFault" | "ClearEstop">(name: N, fields: Parameters<typeof session.request<N>>[1]): unknown[] {
  const results: unknown[] = [];
  session.request(name, fields, (result) => results.push(result), device.nowUs);
  return results;
}

/** The error of a call; a test fails if there is none. */
function errorOf(call: () => void): unknown {
  try {
    call();
  } catch (error) {
    return error;
  }
  throw new Error("it raised nothing");
}

describe("hello", () => {
  test("opens a session named by nonce and boot id, once the clock is known", () => {
    open();
    expect(session.id).toBe((NONCE ^ BOOT_ID) >>> 0);
    expect(device.all("Ping").length).toBeGreaterThanOrEqual(8);
    expect(device.all("SetStreamRate")[0]?.rate_hz).toBe(100);
  });

  test("is repeated until it is answered", () => {
    device.mute.add("Hello");
    device.run(300_000);
    expect(device.all("Hello").length).toBeGreaterThanOrEqual(9);
    expect(session.phase).toBe("HELLO");
    device.mute.clear();
    open();
  });

  test.each([
    ["schema", { schema_hash: 0x12345678 }, "0x12345678"],
    ["protocol", { protocol_version: 9 }, "protocol 9"],
  ])("refuses firmware of another %s by name, and drives nothing", (_, hello, named) => {
    device.hello = hello;
    device.run(500_000);
    expect(session.phase).toBe("HELLO");
    expect(session.error).toBeInstanceOf(ProtocolMismatch);
    expect(session.error.message).toContain(named);
    expect(session.error.message).toContain("use page and firmware of one release");
    expect(errorOf(drive)).toBe(session.error);
    expect(device.all("SetWheelVelocity")).toEqual([]);
  });

  test("a late answer to another hello opens nothing", () => {
    device.hello = { nonce: 1 };
    device.run(200_000);
    expect(session.phase).toBe("HELLO");
    expect(session.foreign).toBeGreaterThan(0);
  });

  test("a device that falls silent, or was reset, gets a new session", () => {
    open();
    device.mute.add("Ping");
    device.run(2_100_000);
    expect(session.count).toBe(2);
    device.mute.clear();
    device.run(400_000);
    device.bootId++;
    device.state();
    device.run(400_000);
    expect([session.phase, session.count]).toEqual(["OPEN", 3]);
  });
});

describe("setpoints", () => {
  test("expire in the device's clock, earlier than asked by the bound of its error", () => {
    open();
    const expiryUs = device.nowUs + 300_000;
    session.drive(0.1, 0.2, expiryUs, device.nowUs);
    device.run(STEP_US);
    const [sent] = device.all("SetWheelVelocity");
    const early = expiryUs + OFFSET_US - Number(sent?.expiry_us);
    // The round trip of this line is one or two steps, and the bound half of it.
    expect(early).toBeGreaterThanOrEqual(0);
    expect(early).toBeLessThan(3 * STEP_US);
  });

  test("are repeated once, unchanged, unless a state frame shows that they arrived", () => {
    open();
    drive();
    device.run(200_000);
    const [first, second, third] = device.all("SetWheelVelocity");
    expect(second).toEqual(first);
    expect(third).toBeUndefined();
    drive();
    device.run(STEP_US);
    device.state({ command_seq: 2, supervisor: SupervisorState.DRIVING });
    device.run(200_000);
    expect(device.all("SetWheelVelocity")).toHaveLength(3);
  });

  test("are not repeated behind a stop, whose number is above theirs", () => {
    open();
    drive();
    session.stop(() => undefined, device.nowUs);
    device.run(200_000);
    expect(device.all("SetWheelVelocity")).toHaveLength(1);
    expect(device.all("Stop")[0]?.command_seq).toBe(2);
  });

  test("are refused here if they are too short for the clock's error", () => {
    open();
    const error = errorOf(() => { drive(500); });
    expect(error).toBeInstanceOf(Expired);
  });

  test("a refusal is reported with the next one, and once", () => {
    open();
    drive();
    device.run(STEP_US);
    device.refuse("SetWheelVelocity", 1, RefusalCode.UNARMED);
    device.run(2 * STEP_US);
    const error = errorOf(drive);
    expect((error as DeviceRefused).code).toBe(RefusalCode.UNARMED);
    drive();
  });

  test("are not sent while the device is latched", () => {
    open();
    device.state({ supervisor: SupervisorState.ESTOPPED });
    device.run(2 * STEP_US);
    expect(drive).toThrow(/ESTOPPED/);
  });
});

describe("requests", () => {
  test("are repeated unchanged, and given up with a time-out", () => {
    open();
    device.mute.add("ParameterSave");
    const results = request("ParameterSave", { parameter: 0 });
    // A device that goes on sending: its silence would end the session before.
    for (let i = 0; i < 15; i++) {
      device.state();
      device.run(100_000);
    }
    expect(results).toHaveLength(1);
    expect(results[0]).toBeInstanceOf(RequestTimeout);
    const sent = device.all("ParameterSave");
    expect(sent).toHaveLength(12);
    expect(new Set(sent.map((one) => one.request_id)).size).toBe(1);
  });

  test("go one at a time, and an answer is taken once", () => {
    open();
    device.mute.add("ParameterSave").add("ClearFault");
    const results: unknown[] = [];
    session.request("ParameterSave", { parameter: 0 }, (one) => results.push(one), device.nowUs);
    session.request("ClearFault", {}, (one) => results.push(one), device.nowUs);
    device.run(10_000);
    expect(device.all("ClearFault")).toEqual([]);
    const { request_id } = device.all("ParameterSave")[0] as Messages["ParameterSave"];
    const answer = { session_id: session.id, request_id, message_id: idOf("ParameterSave") };
    device.say("Ack", answer);
    device.say("Ack", answer);
    device.run(10_000);
    expect(results).toEqual([answer]);
    expect(device.all("ClearFault")).toHaveLength(1);
  });

  test("a refusal names its reason, and an answer of another session counts as foreign", () => {
    open();
    device.mute.add("ClearEstop");
    const results = request("ClearEstop", {});
    device.run(STEP_US);
    const { request_id } = device.all("ClearEstop")[0] as Messages["ClearEstop"];
    device.say("Ack", { session_id: 99, request_id, message_id: idOf("ClearEstop") });
    device.run(2 * STEP_US);
    expect(results).toEqual([]);
    device.refuse("ClearEstop", request_id, RefusalCode.CAUSE_PRESENT);
    device.run(2 * STEP_US);
    expect(String(results[0])).toContain("CAUSE_PRESENT");
  });

  test("NO_SESSION ends the session and fails what is open", () => {
    open();
    device.mute.add("ClearEstop");
    const results = request("ClearEstop", {});
    device.run(STEP_US);
    device.refuse("ClearEstop", 2, RefusalCode.NO_SESSION);
    device.run(2 * STEP_US);
    expect(results[0]).toBeInstanceOf(LinkLost);
    expect(session.phase).not.toBe("OPEN");
  });
});

test("state frames have the time of the device in 64 bits, and none counts twice", () => {
  open();
  const encoder = new Encoder();
  const fields = device.wheels({ left_ticks: -5, left_mps: 0.5, right_duty_q15: -32_767, battery_mv: 7400 });
  const [sample] = session.receive(encoder.encode("WheelState", fields), device.nowUs);
  expect(sample?.tUs).toBe(device.nowUs + OFFSET_US);
  expect(sample).toMatchObject(fields);
  expect(session.receive(encoder.encode("WheelState", fields), device.nowUs)).toEqual([]);
});
