// The two canvases: the floor from above with the robot's trail, and the wheels' speeds.
import { SupervisorState } from "./generated/protocol.js";
import type { Robot } from "./robot.js";
import type { World } from "./world.js";

const TRAIL_POINTS = 3000;
const TRAIL_STEP_M = 0.01;
const HISTORY_US = 10_000_000;
const SAMPLE_US = 20_000;
const WINDOW_M = 2.4;
const WHEEL_SEPARATION_M = 0.2;
const TOP_MPS = 0.45;
/** For the labels of the plot. */
const GUTTER = 38;

interface Pose {
  readonly x: number;
  readonly y: number;
  readonly heading: number;
}

/** Speeds of a wheel at one moment. */
interface Speeds {
  readonly tUs: number;
  readonly commanded: readonly [number, number];
  readonly measured: readonly [number, number];
}

/** A canvas in the pixels of the screen, and the page's colours. */
class Surface {
  readonly context: CanvasRenderingContext2D;
  width = 0;
  height = 0;
  #colours = new Map<string, string>();

  constructor(readonly canvas: HTMLCanvasElement) {
    const context = canvas.getContext("2d");
    if (context === null) throw new Error("this browser draws no canvas");
    this.context = context;
    new ResizeObserver(() => {
      this.#resize();
    }).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.#colours.clear();
    });
    this.#resize();
  }

  colour(name: string): string {
    let found = this.#colours.get(name);
    if (found === undefined) {
      // By way of a property that takes a colour: a custom one is returned as it is written.
      this.canvas.style.color = `var(--${name})`;
      found = getComputedStyle(this.canvas).color;
      this.#colours.set(name, found);
    }
    return found;
  }

  clear(): CanvasRenderingContext2D {
    this.context.clearRect(0, 0, this.width, this.height);
    return this.context;
  }

  #resize(): void {
    const scale = devicePixelRatio;
    this.width = this.canvas.clientWidth;
    this.height = this.canvas.clientHeight;
    this.canvas.width = Math.round(this.width * scale);
    this.canvas.height = Math.round(this.height * scale);
    this.context.setTransform(scale, 0, 0, scale, 0, 0);
  }
}

/** The floor from above. The view follows the robot. */
export class Floor {
  readonly #surface: Surface;
  #trail: { x: number; y: number }[] = [];
  #middle = { x: 0, y: 0 };

  constructor(canvas: HTMLCanvasElement) {
    this.#surface = new Surface(canvas);
  }

  /** Forget the trail. */
  restart(): void {
    this.#trail = [];
    this.#middle = { x: 0, y: 0 };
  }

  draw(world: World): void {
    const { simulator } = world;
    const pose = {
      x: simulator.get("true.x_m"),
      y: simulator.get("true.y_m"),
      heading: simulator.get("true.heading_rad"),
    };
    this.#follow(pose);
    const surface = this.#surface;
    const context = surface.clear();
    const scale = Math.min(surface.width, surface.height * 1.6) / WINDOW_M;
    context.save();
    // x to the right, y upward, in metres.
    context.translate(surface.width / 2, surface.height / 2);
    context.scale(scale, -scale);
    context.translate(-this.#middle.x, -this.#middle.y);
    this.#drawGrid(context, scale);
    this.#drawTrail(context);
    this.#drawRobot(context, pose, world.state);
    context.restore();
    this.#drawScale(context, scale);
  }

  #follow(pose: Pose): void {
    const last = this.#trail.at(-1);
    const moved = last === undefined ? Infinity : Math.hypot(pose.x - last.x, pose.y - last.y);
    if (moved > TRAIL_STEP_M) {
      this.#trail.push({ x: pose.x, y: pose.y });
      if (this.#trail.length > TRAIL_POINTS) this.#trail.shift();
    }
    const surface = this.#surface;
    const scale = Math.min(surface.width, surface.height * 1.6) / WINDOW_M;
    // Only when the robot comes near an edge: a floor that moves all the time shows no motion.
    const [wide, high] = [surface.width / scale / 2 - 0.3, surface.height / scale / 2 - 0.3];
    this.#middle.x += beyond(pose.x - this.#middle.x, Math.max(0.1, wide));
    this.#middle.y += beyond(pose.y - this.#middle.y, Math.max(0.1, high));
  }

  #drawGrid(context: CanvasRenderingContext2D, scale: number): void {
    const surface = this.#surface;
    const [wide, high] = [surface.width / scale / 2, surface.height / scale / 2];
    const { x, y } = this.#middle;
    context.beginPath();
    for (let at = Math.ceil((x - wide) * 5) / 5; at < x + wide; at += 0.2) {
      context.moveTo(at, y - high);
      context.lineTo(at, y + high);
    }
    for (let at = Math.ceil((y - high) * 5) / 5; at < y + high; at += 0.2) {
      context.moveTo(x - wide, at);
      context.lineTo(x + wide, at);
    }
    context.lineWidth = 1 / scale;
    context.strokeStyle = surface.colour("grid");
    context.stroke();
  }

  #drawTrail(context: CanvasRenderingContext2D): void {
    context.beginPath();
    for (const point of this.#trail) context.lineTo(point.x, point.y);
    context.lineWidth = 0.012;
    context.lineJoin = "round";
    context.strokeStyle = this.#surface.colour("trail");
    context.stroke();
  }

  #drawRobot(context: CanvasRenderingContext2D, pose: Pose, state: number): void {
    const surface = this.#surface;
    const half = WHEEL_SEPARATION_M / 2;
    context.save();
    context.translate(pose.x, pose.y);
    context.rotate(pose.heading);
    context.fillStyle = surface.colour("card");
    context.strokeStyle = surface.colour("text");
    context.lineWidth = 0.008;
    context.beginPath();
    context.roundRect(-0.1, -half + 0.02, 0.2, 2 * half - 0.04, 0.03);
    context.fill();
    context.stroke();
    for (const [side, colour] of [
      [half, "left"],
      [-half, "right"],
    ] as const) {
      context.fillStyle = surface.colour(colour);
      context.fillRect(-0.04, side - 0.014, 0.08, 0.028);
    }
    // Its nose, in the colour of its state.
    context.fillStyle = surface.colour(colourOf(state));
    context.beginPath();
    context.moveTo(0.075, 0);
    context.lineTo(0.01, 0.04);
    context.lineTo(0.01, -0.04);
    context.closePath();
    context.fill();
    context.restore();
  }

  #drawScale(context: CanvasRenderingContext2D, scale: number): void {
    const surface = this.#surface;
    const [left, bottom] = [14, surface.height - 14];
    context.strokeStyle = surface.colour("soft");
    context.fillStyle = surface.colour("soft");
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(left, bottom - 5);
    context.lineTo(left, bottom);
    context.lineTo(left + 0.2 * scale, bottom);
    context.lineTo(left + 0.2 * scale, bottom - 5);
    context.stroke();
    context.font = "13px system-ui, sans-serif";
    context.fillText("200 mm", left + 6, bottom - 8);
  }
}

/** The commanded and the measured speeds of both wheels, of the last ten seconds. */
export class SpeedPlot {
  readonly #surface: Surface;
  #history: Speeds[] = [];

  constructor(canvas: HTMLCanvasElement) {
    this.#surface = new Surface(canvas);
  }

  restart(): void {
    this.#history = [];
  }

  /** To be called after each slice. */
  take({ nowUs, program, speeds }: Robot): void {
    const newest = this.#history.at(-1);
    if (newest !== undefined && nowUs < newest.tUs + SAMPLE_US) return;
    const commanded = program.commanded(nowUs);
    this.#history.push({
      tUs: nowUs,
      commanded: [commanded.leftMps, commanded.rightMps],
      measured: [speeds.leftMps, speeds.rightMps],
    });
    if ((this.#history[0]?.tUs ?? 0) < nowUs - HISTORY_US) this.#history.shift();
  }

  get newest(): Speeds | undefined {
    return this.#history.at(-1);
  }

  draw(nowUs: number): void {
    const surface = this.#surface;
    const context = surface.clear();
    const most = Math.max(
      TOP_MPS,
      ...this.#history.flatMap(({ measured }) => measured.map(Math.abs)),
    );
    const middle = surface.height / 2;
    const up = (mps: number): number => middle - (mps / most) * (middle - 6);
    const along = (tUs: number): number => surface.width - ((surface.width - GUTTER) * (nowUs - tUs)) / HISTORY_US;
    this.#drawAxis(context, up);
    for (const [wheel, colour] of [
      [0, "left"],
      [1, "right"],
    ] as const) {
      for (const kind of ["commanded", "measured"] as const) {
        context.beginPath();
        for (const one of this.#history) context.lineTo(along(one.tUs), up(one[kind][wheel]));
        context.setLineDash(kind === "commanded" ? [4, 4] : []);
        context.lineWidth = kind === "commanded" ? 1.5 : 2;
        context.strokeStyle = surface.colour(colour);
        context.stroke();
      }
    }
    context.setLineDash([]);
  }

  #drawAxis(context: CanvasRenderingContext2D, up: (mps: number) => number): void {
    const surface = this.#surface;
    context.strokeStyle = surface.colour("grid");
    context.fillStyle = surface.colour("soft");
    context.lineWidth = 1;
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "right";
    for (const mps of [-0.4, -0.2, 0, 0.2, 0.4]) {
      context.beginPath();
      context.moveTo(GUTTER, up(mps));
      context.lineTo(surface.width, up(mps));
      context.stroke();
      context.fillText(String(Math.round(mps * 1000)), GUTTER - 6, up(mps) + 4);
    }
  }
}

function beyond(value: number, limit: number): number {
  return value > limit ? value - limit : value < -limit ? value + limit : 0;
}

function colourOf(state: number): string {
  if (state === SupervisorState.DRIVING) return "good";
  if (state === SupervisorState.TIMED_OUT) return "warn";
  return state === SupervisorState.ESTOPPED || state === SupervisorState.FAULT ? "bad" : "soft";
}
