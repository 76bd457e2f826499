// A world for tests in virtual time.
import { SupervisorState } from "../src/generated/protocol.js";
import { loadSimulator } from "../src/simulator.js";
import { World } from "../src/world.js";
import { WASM } from "./wasm.js";

/** What the page says, as it came. */
export const said: string[] = [];

/** A robot whose program has opened its session. */
export async function opened(seed = 1): Promise<World> {
  const simulator = await loadSimulator(WASM, seed);
  const world = new World(simulator, seed, (text) => said.push(text));
  world.run(400_000);
  if (world.program.session.phase !== "OPEN") throw world.program.session.error;
  return world;
}

/** One that drives a figure eight. */
export async function driving(seed = 1): Promise<World> {
  const world = await opened(seed);
  world.program.figureEight(world.nowUs);
  world.run(2_000_000);
  if (world.state !== SupervisorState.DRIVING) throw new Error(`it does not drive: ${world.state}`);
  return world;
}
