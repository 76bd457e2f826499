// A world for tests in virtual time.
import { readFileSync } from "node:fs";
import { SupervisorState } from "../src/generated/protocol.js";
import { loadSimulator, type Simulator } from "../src/simulator.js";
import { World } from "../src/world.js";

/** Makes a robot with a fault of a sound one. */
type Planted = (simulator: Simulator) => Simulator;

const WASM = new URL("../../build/web/robot.wasm", import.meta.url);

/** What the page says, as it came. */
export const said: string[] = [];

/** A robot whose program has opened its session. */
export async function opened(seed = 1, planted?: Planted): Promise<World> {
  const sound = await loadSimulator(readFileSync(WASM), seed);
  const simulator = planted === undefined ? sound : planted(sound);
  const world = new World(simulator, seed, (text) => said.push(text));
  world.run(400_000);
  if (world.program.session.phase !== "OPEN") throw world.program.session.error;
  return world;
}

/** One that drives a figure eight. */
export async function driving(seed = 1, planted?: Planted): Promise<World> {
  const world = await opened(seed, planted);
  world.program.figureEight(world.nowUs);
  world.run(2_000_000);
  if (world.state !== SupervisorState.DRIVING) throw new Error(`it does not drive: ${world.state}`);
  return world;
}
