// Setpoints: whether one may be sent, its frame, and its one repeat; never renewed. Sans-IO.
//
// As host/wheelwire/link/setpoints.py.
import type { ClockEstimator } from "./clock.js";
import { DeviceRefused, Expired } from "./errors.js";
import { RefusalCode, SupervisorState, type Messages } from "./generated/protocol.js";

/** Time for a state frame to show that the setpoint arrived, at 100 frames a second. */
const REPEAT_AFTER_US = 20_000;

const DUTY_SCALE = 32_767;

type Aim =
  | Pick<Messages["SetWheelVelocity"], "left_mps" | "right_mps">
  | Pick<Messages["SetDuty"], "left_duty_q15" | "right_duty_q15">;
/** Of either message: its fields tell which. */
export type Setpoint = Messages["SetWheelVelocity"] | Messages["SetDuty"];

interface Unseen {
  readonly setpoint: Setpoint;
  /** When it expires, by the host's clock. */
  readonly expiryUs: number;
  readonly repeatUs: number;
}

/** The aim of a duty of each bridge, -1 to 1. */
export function dutyAim(left: number, right: number): Aim {
  const q15 = (duty: number): number => Math.round(duty * DUTY_SCALE);
  return { left_duty_q15: q15(left), right_duty_q15: q15(right) };
}

/** The setpoints of one open session. */
export class SetpointSender {
  /** Why the device refused the newest one that was not merely late; undefined once reported. */
  refusal: number | undefined;
  #seq = 0;
  #unseen: Unseen | undefined;

  constructor(
    readonly sessionId: number,
    readonly clock: ClockEstimator,
    readonly send: (setpoint: Setpoint) => void,
  ) {}

  /** The number of a stop: higher than all earlier setpoints', so that they become void. */
  nextSeq(): number {
    return ++this.#seq;
  }

  /**
   * Send a setpoint that expires at the host's `expiryUs`.
   *
   * @throws DeviceRefused The last one was refused (reported once), or the device is latched.
   * @throws Expired It expires within the error bound of the device's clock.
   */
  drive(aim: Aim, expiryUs: number, nowUs: number, state: number | undefined, faults: number): void {
    this.#check(state, faults);
    // Subtract the bound from the expiry, or the setpoint could live longer than its ttl.
    const device = this.clock.hostToDevice(expiryUs);
    const boundUs = Math.ceil(device.errorUs);
    if (expiryUs - boundUs <= nowUs) {
      throw new Expired(
        `${(expiryUs - nowUs) / 1000} ms are left of the setpoint's ttl, and the device's ` +
          `clock is known to ${boundUs / 1000} ms: give it a longer ttl`,
      );
    }
    const setpoint: Setpoint = {
      session_id: this.sessionId,
      command_seq: this.nextSeq(),
      expiry_us: BigInt(Math.floor(device.us) - boundUs),
      ...aim,
    };
    const repeatUs = nowUs + REPEAT_AFTER_US;
    this.#unseen = { setpoint, expiryUs: expiryUs - boundUs, repeatUs };
    this.send(setpoint);
  }

  /** Repeat an unseen setpoint, with the same number and expiry, while it is valid. */
  advance(nowUs: number): void {
    const unseen = this.#unseen;
    if (unseen === undefined || nowUs < unseen.repeatUs) return;
    this.#unseen = undefined;
    if (nowUs < unseen.expiryUs) this.send(unseen.setpoint);
  }

  /** What was sent before is not to be sent again, and what was refused is past. */
  void(): void {
    this.#unseen = undefined;
    this.refusal = undefined;
  }

  /** The device says which setpoint it obeys. */
  onObeyed(commandSeq: number): void {
    if (this.#unseen?.setpoint.command_seq === commandSeq) this.#unseen = undefined;
  }

  /** The device refused one. */
  onRefused(refuse: Messages["Refuse"]): void {
    if (refuse.code !== RefusalCode.EXPIRED) this.refusal = refuse.code;
    this.onObeyed(refuse.reference);
  }

  #check(state: number | undefined, faults: number): void {
    let code = this.refusal;
    // Reported once, or one setpoint that was refused would hold back all that follow.
    this.refusal = undefined;
    if (state === SupervisorState.ESTOPPED) code ??= RefusalCode.ESTOPPED;
    if (state === SupervisorState.FAULT) code ??= RefusalCode.FAULT;
    if (code === undefined) return;
    throw new DeviceRefused(code, "the setpoint", code === RefusalCode.FAULT ? faults : 0);
  }
}
