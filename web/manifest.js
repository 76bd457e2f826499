// Copies a release's images beside the page, with a manifest of their checksums:
//
//     node web/manifest.js FOLDER-OF-IMAGES VERSION [build/web]
import { createHash } from "node:crypto";
import { copyFile, mkdir, readFile, readdir, writeFile } from "node:fs/promises";
import { join } from "node:path";

const [folder, version, page = "build/web"] = process.argv.slice(2);
if (version === undefined) throw new Error("say which images, and of which version");
const output = join(page, "firmware");
await mkdir(output, { recursive: true });
const images = [];
for (const file of (await readdir(folder)).filter((name) => /^wheelwire-\w+\.bin$/.test(name)).sort()) {
  const sha256 = createHash("sha256").update(await readFile(join(folder, file))).digest("hex");
  await copyFile(join(folder, file), join(output, file));
  images.push({ file, sha256 });
}
if (images.length === 0) throw new Error(`${folder} has no wheelwire-*.bin`);
await writeFile(join(output, "manifest.json"), JSON.stringify({ version, images }, null, 2));
