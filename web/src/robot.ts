// A robot as the page shows it: the simulated one, or the one at a port.
import type { Messages } from "./generated/protocol.js";
import type { Program, WheelSpeeds } from "./program.js";

export interface Robot {
  /** The program that drives it, at this page's end of the line. */
  readonly program: Program;
  readonly nowUs: number;
  /** As in SupervisorState; undefined if it is not known. */
  readonly state: number | undefined;
  readonly faults: number;
  readonly hold: Messages["Hold"] | undefined;
  /** What the host knows of setpoints that stopped coming; a name of WHY_HOST. */
  readonly hostCause: "host_frozen" | "cable_pulled" | undefined;
  /** Measured. */
  readonly speeds: WheelSpeeds;
  /** Its newest stop, in words; empty if there was none. */
  readonly stopped: string;
}
