// Whether the page ran all the time, and how fine its clock is.

/** A page that did not run for this long was frozen, hidden, or asleep with its computer. */
export const ABSENCE_US = 250_000;

/** How much time has passed, also while the page or its computer was asleep. */
export class PageClock {
  #pageMs = performance.now();
  #wallMs = Date.now();

  elapsedUs(): number {
    const [pageMs, wallMs] = [performance.now(), Date.now()];
    // The page's clock may stand still while the computer sleeps; the other one may be set.
    const byPage = pageMs - this.#pageMs;
    const byWall = wallMs - this.#wallMs;
    [this.#pageMs, this.#wallMs] = [pageMs, wallMs];
    return Math.round(1000 * (byWall * 1000 > byPage * 1000 + ABSENCE_US ? byWall : byPage));
  }
}

/** The page's clock, which never goes back. [us] */
export function pageUs(): number {
  return Math.round(performance.now() * 1000);
}

/** The step of the page's clock, which browsers make coarse on purpose. [us] */
export function clockStepUs(): number {
  let least = Infinity;
  for (let [step, fromUs] = [0, pageUs()]; step < 5; step++) {
    let us = pageUs();
    while (us === fromUs) us = pageUs();
    // The least: in a longer one the page was held up.
    if (step > 0) least = Math.min(least, us - fromUs);
    fromUs = us;
  }
  return least;
}
