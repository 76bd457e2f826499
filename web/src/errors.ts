// What a caller of the session has to know: the same kinds as host/wheelwire/errors.py.
import { Fault, FaultDocs, RefusalCode, RefusalCodeDocs } from "./generated/protocol.js";

/** The names of the flags or the code in a number, in the order of their definition. */
export function flagsOf<Codes extends Readonly<Record<string, number>>>(
  codes: Codes,
  value: number,
): (keyof Codes & string)[] {
  return Object.keys(codes).filter((name) => ((value & (codes[name] ?? 0)) >>> 0) !== 0);
}

/** The name of a code; undefined if this release does not know it. */
export function nameOf<Codes extends Readonly<Record<string, number>>>(
  codes: Codes,
  value: number,
): (keyof Codes & string) | undefined {
  return Object.keys(codes).find((name) => codes[name] === value);
}

/** The base of all errors of the link. */
export class WheelwireError extends Error {
  override name = "WheelwireError";
}

/** No session is open; a new one is opened by itself. */
export class LinkLost extends WheelwireError {
  override name = "LinkLost";
}

/** Host and firmware are of different releases. */
export class ProtocolMismatch extends WheelwireError {
  override name = "ProtocolMismatch";
}

/** No answer came to a request, however often it was repeated. It may have been carried out. */
export class RequestTimeout extends WheelwireError {
  override name = "RequestTimeout";
}

/** A setpoint's life would end within the error bound of the device's clock. */
export class Expired extends WheelwireError {
  override name = "Expired";
}

/** The device refused: nothing moved or changed because of it. */
export class DeviceRefused extends WheelwireError {
  override name = "DeviceRefused";

  constructor(
    readonly code: number,
    subject: string,
    readonly faults = 0,
  ) {
    const name = nameOf(RefusalCode, code);
    const reason = name === undefined ? `code ${code}` : `${name}: ${RefusalCodeDocs[name]}`;
    const latched = flagsOf(Fault, faults).map((fault) => ` ${fault}: ${FaultDocs[fault]}`);
    super(`the device refused ${subject}. ${reason}${latched.join("")}`);
  }
}
