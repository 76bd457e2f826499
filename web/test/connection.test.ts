// A connected robot in virtual time: whatever happens to the page or the line, nothing moves late.
import { describe, expect, test } from "vitest";
import { ResetReason, SupervisorState } from "../src/generated/protocol.js";
import { TTL_US } from "../src/program.js";
import { Random } from "../src/random.js";
import { Connection } from "../src/serial/connection.js";
import type { Transport } from "../src/serial/port.js";
import { loadSimulator, type Simulator } from "../src/simulator.js";
import { FAULTS, sound } from "./faults.js";
import { WASM } from "./wasm.js";

const { DRIVING, ESTOPPED, IDLE } = SupervisorState;
const SLICE_US = 1000;
const MINUTE_US = 60_000_000;
/** The page's clock runs on another zero than the robot's. */
const OFFSET_US = 5_000_000;
/** One control period, and one slice in which it is looked at. */
const GRACE_US = 2000;

/** A page at a robot's port, and the computer's buffers between them. */
class Desk {
  readonly said: string[] = [];
  toRobot = sound;
  toPage = sound;
  /** Called after each slice. */
  look: () => void = () => undefined;
  /** What the page sends is held in a buffer for so long. [us] */
  heldUs = 0;
  connection = this.#page();
  readonly #random = new Random(11);
  #came: Uint8Array[] = [];
  #sent: { readonly atUs: number; readonly bytes: Uint8Array }[] = [];
  readonly #line: Transport = {
    take: () => Uint8Array.from(this.#came.splice(0).flatMap((part) => [...part])),
    write: (bytes) => {
      if (bytes.length > 0) this.#sent.push({ atUs: this.simulator.nowUs + this.heldUs, bytes });
    },
  };

  constructor(readonly simulator: Simulator) {
    this.plug();
  }

  static async start(seed = 1): Promise<Desk> {
    const desk = new Desk(await loadSimulator(WASM, seed));
    desk.run(400_000);
    expect(desk.connection.program.session.phase).toBe("OPEN");
    return desk;
  }

  #page(): Connection {
    return new Connection((text) => this.said.push(text), () => undefined);
  }

  get nowUs(): number {
    return this.simulator.nowUs + OFFSET_US;
  }

  get isDriven(): boolean {
    return this.simulator.get("drive_on") !== 0;
  }

  plug(): void {
    this.connection.attach(this.#line, this.nowUs);
  }

  /** Another page takes the port, as after the tab was killed. */
  kill(): void {
    this.connection = this.#page();
    this.#came = [];
    this.plug();
  }

  run(us: number, pageRuns = true): void {
    for (const endUs = this.simulator.nowUs + us; this.simulator.nowUs < endUs; ) {
      this.simulator.advance(SLICE_US);
      const came = this.toPage(this.simulator.read(), this.#random);
      if (came.length > 0 && this.#came.length < 4000) this.#came.push(came);
      if (pageRuns) this.connection.run(this.nowUs, false);
      while ((this.#sent[0]?.atUs ?? Infinity) <= this.simulator.nowUs) {
        const bytes = this.toRobot(this.#sent.shift()?.bytes ?? new Uint8Array(), this.#random);
        if (bytes.length > 0) this.simulator.write(bytes);
      }
      this.look();
    }
  }

  /** As a person does: nothing is held before, then a fresh wish. */
  drive(mps = 0.25): void {
    for (let attempt = 0; attempt < 20 && this.simulator.get("state") !== DRIVING; attempt++) {
      this.connection.program.drive({ mps, radps: 0 });
      this.run(200_000);
    }
    expect(this.simulator.get("state")).toBe(DRIVING);
  }
}

/** What the page lives through, and for how long. */
const ABSENCES: readonly [string, number, (desk: Desk, us: number) => void][] = [
  ["frozen", 150, (desk, us) => { desk.run(us, false); }],
  ["killed", 49, (desk, us) => { desk.run(us, false); desk.kill(); }],
  ["under SIGSTOP for 40 minutes", 1, (desk) => {
    desk.run(2_000_000, false);
    desk.simulator.advance(40 * MINUTE_US);
  }],
];

/** How many of `events` absences had a late motion. */
function lateMotions(desk: Desk, events: number, pass: (desk: Desk, us: number) => void): number {
  const random = new Random(7);
  let late = 0;
  for (let event = 0; event < events; event++) {
    desk.drive(0.1 + 0.3 * random.unit());
    desk.run(Math.floor(random.unit() * 100) * SLICE_US);
    // Some of the setpoints are still in a buffer, and come when the page is long gone.
    desk.heldUs = event % 3 === 0 ? Math.floor(random.unit() * 400) * SLICE_US : 0;
    desk.run(40_000);
    const limitUs = desk.simulator.nowUs + TTL_US + GRACE_US;
    let isLate = false;
    desk.look = () => { isLate ||= desk.simulator.nowUs > limitUs && desk.isDriven; };
    desk.heldUs = 0;
    pass(desk, (300 + Math.floor(random.unit() * 900)) * SLICE_US);
    desk.run(600_000);
    desk.look = () => undefined;
    late += Number(isLate);
  }
  return late;
}

describe.each(ABSENCES)("a page that is %s", (_, events, pass) => {
  test(`${events} times: no late motion`, async () => {
    expect(lateMotions(await Desk.start(), events, pass)).toBe(0);
  });
});

test("a program that sends its old setpoint again on waking is noticed each time", async () => {
  const desk = await Desk.start();
  const { program } = desk.connection;
  program.wake = (nowUs) => {
    const { leftMps, rightMps } = program.commanded(0); // the newest, however old
    program.session.drive(leftMps, rightMps, nowUs + TTL_US, nowUs);
  };
  const events = 30;
  expect(lateMotions(desk, events, (desk, us) => { desk.run(us, false); })).toBe(events);
});

describe.each(FAULTS)("a line on which %s", (_, fault) => {
  test.each(["toRobot", "toPage"] as const)("%s: it drives on or stops in time, and comes back", async (way) => {
    const desk = await Desk.start(3);
    desk.drive();
    desk[way] = fault;
    let drivenUs = desk.simulator.nowUs;
    let most = 0;
    desk.look = () => {
      if (desk.isDriven) drivenUs = desk.simulator.nowUs;
      most = Math.max(most, Math.abs(desk.simulator.get("true.left_mps")));
    };
    desk.run(1_500_000);
    // A stop of the page may be lost as well; what ends the drive then is the setpoint's life.
    desk.connection.program.stop(desk.nowUs);
    const stoppedUs = desk.simulator.nowUs;
    desk.run(1_500_000);
    expect(drivenUs - stoppedUs).toBeLessThanOrEqual(TTL_US + GRACE_US);
    expect(most).toBeLessThan(0.35);
    desk[way] = sound;
    desk.run(3_000_000);
    expect(desk.isDriven).toBe(false);
    desk.drive();
    expect(desk.connection.program.session.phase).toBe("OPEN");
  });
});

test("stop times are those of the reliability page", async () => {
  const desk = await Desk.start();
  const random = new Random(5);
  const late: number[] = [];
  const all: number[] = [];
  for (let run = 0; run < 20; run++) {
    desk.drive();
    desk.run(1_000_000 + Math.floor(random.unit() * 50) * SLICE_US);
    desk.toRobot = () => new Uint8Array();
    const failedUs = desk.simulator.get("device_us");
    desk.run(1_000_000);
    late.push(desk.simulator.get("drive_removed_us") - desk.simulator.get("deadline_us"));
    all.push(desk.simulator.get("drive_removed_us") - failedUs);
    desk.toRobot = sound;
    desk.run(1_000_000);
  }
  const ms = (values: number[]): string => values.sort((a, b) => a - b).map((us) => (us / 1000).toFixed(1)).join(" ");
  console.log(`deadline to drive removed: ${ms(late)} ms; failure to drive removed: ${ms(all)} ms`);
  expect(Math.max(...late)).toBeLessThanOrEqual(1000);
  expect(Math.min(...late)).toBeGreaterThanOrEqual(0);
  expect(Math.max(...all)).toBeLessThanOrEqual(TTL_US + 1000);
});

test("a chip that resets drives only after another wish", async () => {
  const desk = await Desk.start();
  desk.drive();
  desk.connection.isEnabled = true;
  desk.simulator.set("reset", ResetReason.PANIC);
  let driven = 0;
  desk.look = () => { driven += Number(desk.isDriven); };
  desk.run(2_000_000);
  expect(driven).toBe(0);
  expect(desk.connection.isEnabled).toBe(false);
  expect(desk.connection.state).toBe(IDLE);
  desk.drive();
});

test("the hidden page sends a stop at once, and an e-stop latches", async () => {
  const desk = await Desk.start();
  desk.drive();
  desk.connection.leave();
  desk.run(3 * SLICE_US, false);
  expect(desk.simulator.get("state")).toBe(IDLE);
  desk.run(300_000);
  desk.drive();
  desk.connection.program.estop(desk.nowUs);
  desk.run(10_000);
  expect(desk.simulator.get("state")).toBe(ESTOPPED);
});
