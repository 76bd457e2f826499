// The button `find the wiring`: the first half of setup, its questions and what it found.
import { WheelwireError } from "../errors.js";
import { element, put } from "../panel.js";
import type { Connection } from "../serial/connection.js";
import { SetupFailed, SetupRobot } from "./robot.js";
import { setUpWiring, type Person, type Question } from "./wiring.js";

const NEXT =
  "Next, on a computer: wheelwire setup, which counts, measures the motors, and proves the gains.";
const HIDDEN = "the page was hidden: the robot was told to stop; begin again";
const WATCH_MS = 200;
const CANCELLED = "cancelled: the robot has its previous parameters again";

export class SetupPanel implements Person {
  readonly #begin = element("wire") as HTMLButtonElement;
  readonly #cancel = element("wire-cancel");
  readonly #question = element("wire-question");
  readonly #choices = element("wire-choices");
  #robot: SetupRobot | undefined;

  constructor(readonly connection: Connection) {
    this.#begin.addEventListener("click", () => {
      void this.#run();
    });
    this.#cancel.addEventListener("click", () => this.#robot?.fail(new SetupFailed(CANCELLED)));
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.#robot?.fail(new SetupFailed(HIDDEN));
    });
  }

  say = (text: string): void => {
    const line = document.createElement("li");
    line.textContent = text;
    element("wire-said").append(line);
    this.connection.say(text);
  };

  answer = (question: Question): Promise<string> => {
    put(this.#question, question.text);
    return new Promise((resolve) => {
      const buttons = question.choices.map((choice) => {
        const button = document.createElement("button");
        button.type = "button";
        button.textContent = choice;
        button.setAttribute("aria-describedby", this.#question.id);
        button.addEventListener("click", () => {
          this.#clear();
          resolve(choice);
        });
        return button;
      });
      this.#choices.replaceChildren(...buttons);
      this.#question.focus(); // no key that happens to be pressed is an answer
    });
  };

  async #run(): Promise<void> {
    const { connection } = this;
    if (connection.program.session.phase !== "OPEN") return;
    // Otherwise the arrow keys would drive during setup.
    connection.isEnabled = false;
    connection.changed();
    element("wire-said").replaceChildren();
    this.#begin.disabled = true;
    this.#cancel.hidden = false;
    const robot = (this.#robot = new SetupRobot(connection.program, () => connection.nowUs));
    // Even while no port is open and nothing of the robot runs.
    const watch = setInterval(() => { robot.onAdvance(connection.nowUs); }, WATCH_MS);
    try {
      const wiring = await setUpWiring(robot, this);
      this.say(wiring === undefined ? "not saved; the robot has its previous values again" : NEXT);
    } catch (error) {
      if (!(error instanceof WheelwireError)) throw error;
      this.say(error.message);
    } finally {
      clearInterval(watch);
      robot.release();
      this.#robot = undefined;
      this.#clear();
      this.#begin.disabled = false;
      this.#cancel.hidden = true;
    }
  }

  #clear(): void {
    put(this.#question, "");
    this.#choices.replaceChildren();
  }
}
