// The page: the simulated robot in real time or a connected one, what a person sees of it, and what
// they ask for.
import { ABSENCE_US, PageClock, pageUs } from "./absence.js";
import { Floor, SpeedPlot } from "./drawing.js";
import { FlashPanel } from "./flash/panel.js";
import { Banner, Breaks, Log, element } from "./panel.js";
import { Recorder } from "./recorder.js";
import type { Robot } from "./robot.js";
import { Connection } from "./serial/connection.js";
import { Own } from "./serial/own.js";
import { SetupPanel } from "./setup/panel.js";
import { loadSimulator, type Simulator } from "./simulator.js";
import { Steering } from "./steering.js";
import { World } from "./world.js";

const AWAKE_US = 20_000;
const DEFAULT_SEED = 1;

/** For a person at the browser's console, and for tests. */
interface Tools {
  world: World;
  connection: Connection;
  /** The calls on the simulator so far, if the address has `?record`. */
  calls: () => readonly string[];
  /** How many pictures were begun. */
  frames: number;
  /** When the newest of them began, by the page's clock. */
  drawnMs: number;
}
declare global {
  var wheelwire: Tools | undefined;
}

const query = new URLSearchParams(location.search);
const seed = Number(query.get("seed") ?? DEFAULT_SEED) >>> 0;

async function start(): Promise<void> {
  const wasm = await (await fetch("robot.wasm")).arrayBuffer();
  const log = new Log();
  const banner = new Banner();
  const floor = new Floor(element("floor") as HTMLCanvasElement);
  const plot = new SpeedPlot(element("speeds") as HTMLCanvasElement);
  const connection = new Connection(
    (text) => {
      log.say(text, pageUs());
      own.note(text);
    },
    () => {
      own.show();
    },
  );
  let world = await newWorld();
  const breaks = new Breaks(
    () => world,
    (text) => {
      log.say(text, world.nowUs);
    },
  );

  async function newWorld(): Promise<World> {
    let simulator: Simulator = await loadSimulator(wasm, seed);
    let calls: readonly string[] = [];
    if (query.has("record")) {
      const recorder = new Recorder(simulator, seed);
      [simulator, calls] = [recorder, recorder.lines];
    }
    const made = new World(simulator, seed, (text) => {
      log.say(text, made.nowUs);
    });
    made.watchers.add(() => {
      plot.take(made);
      breaks.look();
    });
    globalThis.wheelwire = { world: made, connection, calls: () => calls, frames: 0, drawnMs: performance.now() };
    return made;
  }

  /** The one that is shown, and driven. */
  const robot = (): Robot => (connection.isConnected ? connection : world);
  const say = (text: string): void => {
    log.say(text, robot().nowUs);
  };
  const steering = new Steering(
    element("stick"),
    element("knob"),
    (twist) => {
      if (connection.isConnected && !connection.isEnabled) say("nothing moves before you press enable driving");
      else robot().program.drive(twist);
    },
    () => {
      robot().program.stop(robot().nowUs);
    },
  );
  const onClick = (id: string, act: () => void): void => {
    element(id).addEventListener("click", () => {
      if (world.isHung && id !== "again") log.say("the program hangs: it hears nothing", world.nowUs);
      act();
    });
  };
  onClick("eight", () => {
    world.program.figureEight(world.nowUs);
  });
  const estop = (): void => {
    steering.letGo();
    robot().program.estop(robot().nowUs);
  };
  onClick("estop", estop);
  addEventListener("keydown", ({ key }) => {
    if (key === "Escape") estop();
  });
  onClick("clear", () => {
    robot().program.clear(robot().nowUs);
  });
  onClick("again", () => {
    steering.letGo();
    void newWorld().then((made) => {
      world = made;
      for (const one of [floor, plot, breaks]) one.restart();
      log.clear();
    });
  });

  const own = new Own(connection, () => {
    steering.letGo();
    world.program.stop(world.nowUs);
    plot.restart();
  });
  new FlashPanel(connection, () => own.choose());
  new SetupPanel(connection);

  // A page that is about to be hidden or frozen stops the robot while it still can.
  const leave = (): void => {
    steering.letGo();
    connection.leave();
    if (!world.program.isDriving) return;
    world.program.stop(world.nowUs);
    world.flush();
    log.say("this page was hidden: it stopped the robot", world.nowUs);
  };
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) leave();
  });
  document.addEventListener("freeze", leave);
  addEventListener("pagehide", leave);

  const clock = new PageClock();
  const draw = (): void => {
    const tools = globalThis.wheelwire;
    if (tools !== undefined) {
      tools.frames++;
      tools.drawnMs = performance.now();
    }
    const elapsedUs = clock.elapsedUs();
    if (elapsedUs > ABSENCE_US) steering.letGo();
    if (connection.isConnected) {
      plot.take(connection); // the simulated one waits
    } else if (elapsedUs > ABSENCE_US) {
      world.wake(elapsedUs - AWAKE_US);
      // Otherwise a program on a computer this slow would never say hello.
      world.run(AWAKE_US);
    } else {
      world.run(elapsedUs);
    }
    banner.show(robot());
    if (!connection.isConnected) showFloor(world, floor);
    plot.draw(robot().nowUs);
    showNumbers(robot(), plot);
    if (tools?.frames === 1) performance.mark("first picture");
    requestAnimationFrame(draw);
  };
  requestAnimationFrame(draw);
}

function showFloor(world: World, floor: Floor): void {
  floor.draw(world);
  const { simulator } = world;
  const [x, y] = [simulator.get("true.x_m"), simulator.get("true.y_m")];
  const side = y < 0 ? "right" : "left";
  const ahead = x < 0 ? "behind" : "ahead of";
  element("floor-text").textContent = `It is ${mmps(Math.abs(x))} mm ${ahead} and ${mmps(Math.abs(y))} mm to the ${side} of its start.`;
}

function showNumbers({ program }: Robot, plot: SpeedPlot): void {
  const speeds = plot.newest;
  if (speeds === undefined) return;
  const text = (wheel: 0 | 1): string =>
    `${mmps(speeds.measured[wheel])} of ${mmps(speeds.commanded[wheel])}`;
  element("left").textContent = text(0);
  element("right").textContent = text(1);
  const { phase, counters, error } = program.session;
  const damaged = counters.bad_cobs + counters.bad_crc;
  const link = phase === "OPEN" ? "open" : `not open: ${error.message}`;
  element("link").textContent = `The program's link is ${link}. Frames received: ${counters.frames}, damaged: ${damaged}, lost: ${counters.seq_lost}.`;
}

function mmps(metres: number): string {
  return String(Math.round(metres * 1000));
}

void start();
