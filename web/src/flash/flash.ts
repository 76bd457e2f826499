// Writing the firmware to a chip: the steps of `wheelwire flash` between a stop and a new session.
import { nameOf } from "../errors.js";
import { Chip } from "../generated/protocol.js";
import { FLASH } from "../generated/words.js";
import { fill } from "../text.js";
import { FlashFailed, describe, planFlash, type Image } from "./image.js";
import { Loader, NotInLoader, THIS_PORT, type Handle } from "./loader.js";
import { imageNameOf } from "./release.js";

/** What a person sees and does during this. */
export interface Person {
  say: (text: string) => void;
  /** How much is written, 0 to 1. */
  progress: (fraction: number) => void;
  /** Asks for a hand on BOOT; false: not now. */
  holdBoot: () => Promise<boolean>;
}

/**
 * Write the image for its chip to a board, and start it.
 *
 * @param port Closed, the wheels at rest. It is closed afterwards, too.
 * @param imageFor The image for a chip, as in Chip.
 * @return The chip, as in Chip.
 * @throws FlashFailed In one sentence. The board can be flashed again.
 */
export async function flashChip(
  port: Handle,
  imageFor: (chip: number) => Promise<Image>,
  person: Person,
): Promise<number> {
  const loader = await entered(port, person);
  try {
    const chip = await loader.identify();
    const image = await imageFor(chip);
    if (image.chip !== chip) throw new FlashFailed(otherChip(image, chip));
    const plan = planFlash(image, await loader.readTable());
    for (const line of describe(plan)) person.say(line);
    await loader.write(plan, person.progress);
    return chip;
  } catch (error) {
    throw loader.inWords(error);
  } finally {
    await loader.leave();
  }
}

/** Enter the chip's loader: by its signals, or by a person's hand, as often as they try. */
async function entered(port: Handle, person: Person): Promise<Loader> {
  for (let byHand = false; ; byHand = true) {
    try {
      return await Loader.enter(port, byHand);
    } catch (error) {
      if (!(error instanceof NotInLoader) || !(await person.holdBoot())) throw error;
    }
  }
}

function otherChip(image: Image, chip: number): string {
  const [names, name] = [nameOf(Chip, image.chip) ?? "", nameOf(Chip, chip) ?? ""];
  const text = fill(FLASH.otherChip, image.name, names, THIS_PORT, name, "");
  return `${text.split(": ")[0] ?? text}: choose the release's ${imageNameOf(chip)}`;
}
