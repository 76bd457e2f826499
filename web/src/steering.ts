// The arrow keys and the stick: a wish to drive while they are held, and a stop when they are let go.
import type { Twist } from "./program.js";

const MOST_MPS = 0.3;
const MOST_RADPS = 1.6;
const KEYS: Readonly<Record<string, readonly [forward: number, left: number]>> = {
  ArrowUp: [1, 0],
  ArrowDown: [-1, 0],
  ArrowLeft: [0, 1],
  ArrowRight: [0, -1],
};
/** Less than this is the hand's tremble. */
const DEAD_ZONE = 0.12;

/** Calls `drive` while something is held, and `stop` once nothing is. */
export class Steering {
  readonly #held = new Set<string>();
  #pointer: number | undefined;

  constructor(
    readonly stick: HTMLElement,
    readonly knob: HTMLElement,
    readonly drive: (twist: Twist) => void,
    readonly stop: () => void,
  ) {
    addEventListener("keydown", (event) => {
      this.#onKey(event);
    });
    addEventListener("keyup", (event) => {
      if (this.#held.delete(event.key)) this.#steer();
    });
    addEventListener("blur", () => {
      this.letGo();
    });
    stick.addEventListener("pointerdown", (event) => {
      stick.setPointerCapture(event.pointerId);
      this.#pointer = event.pointerId;
      this.#onPointer(event);
    });
    stick.addEventListener("pointermove", (event) => {
      if (event.pointerId === this.#pointer) this.#onPointer(event);
    });
    stick.addEventListener("lostpointercapture", () => {
      this.letGo();
    });
  }

  /** Treat all keys as released, whatever the browser says. */
  letGo(): void {
    const wasHeld = this.#held.size > 0 || this.#pointer !== undefined;
    this.#held.clear();
    this.#pointer = undefined;
    this.knob.style.transform = "";
    if (wasHeld) this.stop();
  }

  #onKey(event: KeyboardEvent): void {
    const isTheirs = event.target instanceof Element && event.target.closest("#log, input, select") !== null;
    if (!(event.key in KEYS) || isTheirs || event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault(); // the page must not scroll
    // A repeat is not a fresh request: after a fault the key has to be pressed again.
    if (event.repeat || this.#held.has(event.key)) return;
    this.#held.add(event.key);
    this.#steer();
  }

  #steer(): void {
    if (this.#held.size === 0) {
      this.stop();
      return;
    }
    let [forward, left] = [0, 0];
    for (const key of this.#held) {
      const [ahead, aside] = KEYS[key] ?? [0, 0];
      forward += ahead;
      left += aside;
    }
    this.drive({ mps: forward * 0.25, radps: left * 1.2 });
  }

  #onPointer(event: PointerEvent): void {
    const box = this.stick.getBoundingClientRect();
    const reach = box.width / 2 - 22;
    let right = (event.clientX - box.left - box.width / 2) / reach;
    let down = (event.clientY - box.top - box.height / 2) / reach;
    const length = Math.hypot(right, down);
    if (length > 1) [right, down] = [right / length, down / length];
    this.knob.style.transform = `translate(${right * reach}px, ${down * reach}px)`;
    const is = (value: number): number => (Math.abs(value) < DEAD_ZONE ? 0 : value);
    this.drive({ mps: -is(down) * MOST_MPS, radps: -is(right) * MOST_RADPS });
  }
}
