// Writes the page to build/web: its code in one file, and what it shows. The robot is built beside it.
import { build } from "esbuild";
import { copyFile, mkdir } from "node:fs/promises";

const WEB = new URL("./", import.meta.url);
const OUTPUT = new URL("../build/web/", import.meta.url);

await mkdir(OUTPUT, { recursive: true });
await build({
  entryPoints: [new URL("src/page.ts", WEB).pathname],
  outfile: new URL("page.js", OUTPUT).pathname,
  bundle: true,
  format: "esm",
  target: "es2022",
  minify: true,
  logLevel: "warning",
});
for (const name of ["index.html", "src/page.css", "src/icon.svg"]) {
  await copyFile(new URL(name, WEB), new URL(name.replace("src/", ""), OUTPUT));
}
