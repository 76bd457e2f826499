// Why the robot stands, in the words of `wheelwire why`: by what it says of itself.
import { flagsOf, nameOf } from "./errors.js";
import {
  WHY_FAULT,
  WHY_HOST,
  WHY_RESET,
  WHY_SENSOR,
  WHY_STOPPED,
  type Why,
} from "./generated/causes.js";
import {
  EstopSource,
  Fault,
  Held,
  HeldDocs,
  ResetReason,
  StopCause,
  SupervisorState,
  SupervisorStateDocs,
  type Messages,
} from "./generated/protocol.js";
import type { Robot } from "./robot.js";

/** What is known of a robot. */
type Known = Pick<Robot, "faults" | "hold" | "hostCause"> & { readonly state: number };

const NOTHING_TO_LOOK_AT = "";
const ESTOPS: Readonly<Record<number, string>> = {
  [EstopSource.CONTACT]: "ESTOP_CONTACT",
  [EstopSource.SESSION]: "ESTOP_SESSION",
  [EstopSource.OTHER_PROGRAM]: "ESTOP_OTHER",
};
/** Holds that the state itself says. */
const LATCHES: readonly string[] = ["ESTOP", "CONTACT", "FAULT"];

/** The codes that hold it. */
export function heldNames(hold: Messages["Hold"] | undefined): string[] {
  return flagsOf(Held, hold?.held ?? 0);
}

/** Why it stands, or what holds it; while it drives freely, that. */
export function why(known: Known): Why {
  const { state, hold } = known;
  if (state === SupervisorState.ESTOPPED) {
    const byContact = heldNames(hold).includes("CONTACT");
    const source = byContact ? EstopSource.CONTACT : (hold?.estop_source ?? EstopSource.NONE);
    return WHY_STOPPED[ESTOPS[source] ?? ""] ?? described(state);
  }
  if (state === SupervisorState.FAULT) return joined(faultsOf(known.faults), state);
  const held = heldNames(hold).filter((name) => !LATCHES.includes(name));
  if (held.length > 0) return joined(held.map(sentenceOfHold), state);
  if (state === SupervisorState.DRIVING || hold === undefined) return described(state);
  return stopped(hold, known);
}

function stopped(hold: Messages["Hold"], known: Known): Why {
  const cause = nameOf(StopCause, hold.stop_cause) ?? "UNKNOWN";
  if (cause === "DEADLINE" && known.hostCause !== undefined) {
    return WHY_HOST[known.hostCause] ?? described(known.state);
  }
  if (cause === "RESET") {
    return WHY_RESET[nameOf(ResetReason, hold.stop_reset) ?? "UNKNOWN"] ?? described(known.state);
  }
  if (cause === "FAULT") return joined(faultsOf(hold.stop_faults), known.state);
  const sensors = flagsOf(Held, hold.stop_held).map((name) => WHY_SENSOR[name]);
  return WHY_STOPPED[cause] ?? joined(sensors, known.state);
}

function faultsOf(faults: number): (Why | undefined)[] {
  return flagsOf(Fault, faults).map((name) => WHY_FAULT[name]);
}

function sentenceOfHold(name: string): Why {
  const doc = HeldDocs[name as keyof typeof HeldDocs];
  return WHY_SENSOR[name] ?? { sentence: doc, lookAt: NOTHING_TO_LOOK_AT };
}

function joined(found: readonly (Why | undefined)[], state: number): Why {
  const all = found.filter((one) => one !== undefined);
  if (all.length === 0) return described(state);
  const unique = (texts: string[]): string[] => [...new Set(texts)].filter(Boolean);
  return {
    sentence: unique(all.map((one) => one.sentence)).join(" "),
    lookAt: unique(all.map((one) => one.lookAt)).join("; "),
  };
}

function described(state: number): Why {
  const name = nameOf(SupervisorState, state) ?? "BOOT";
  return { sentence: SupervisorStateDocs[name], lookAt: NOTHING_TO_LOOK_AT };
}
