// The images of this page's release: in a folder next to the page, each with its SHA-256.
import { Chip } from "../generated/protocol.js";
import { nameOf } from "../errors.js";
import { FlashFailed, readImage, type Image } from "./image.js";
import { hex } from "./md5.js";

/** What web/manifest.js writes. */
interface Manifest {
  readonly version: string;
  readonly images: readonly { readonly file: string; readonly sha256: string }[];
}

const FOLDER = "firmware/";

/** Loads a file from the page's folder. */
type Load = (path: string) => Promise<Response>;

async function loaded(name: string, load: Load): Promise<Response> {
  try {
    return await load(FOLDER + name);
  } catch {
    throw new FlashFailed(`${name} could not be loaded: check this device's network, then flash again`);
  }
}

/** The name of a chip's image in a release. */
export function imageNameOf(chip: number): string {
  return `wheelwire-${(nameOf(Chip, chip) ?? "").toLowerCase()}.bin`;
}

/**
 * The release's image for a chip.
 *
 * @throws FlashFailed The image is missing, or differs from the manifest.
 */
export async function releaseImage(chip: number, load: Load): Promise<Image> {
  const name = imageNameOf(chip);
  const list = await loaded("manifest.json", load);
  const manifest = list.ok ? ((await list.json()) as Manifest) : undefined;
  const wanted = manifest?.images.find((one) => one.file === name);
  if (wanted === undefined) {
    throw new FlashFailed(`${name} is not beside this page: download it from a release, and choose that file`);
  }
  const content = await (await loaded(name, load)).arrayBuffer();
  const sha256 = hex(new Uint8Array(await crypto.subtle.digest("SHA-256", content)));
  if (sha256 !== wanted.sha256) {
    throw new FlashFailed(
      `${name} is not the file that the release names: its SHA-256 is ${sha256}, not ${wanted.sha256}; load this page anew`,
    );
  }
  return readImage(name, new Uint8Array(content));
}
