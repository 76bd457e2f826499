// Writes the page to build/web: its code in one file, what flashes in another that is loaded when it is
// needed, and what it shows. The robot is built beside it.
import { build } from "esbuild";
import { copyFile, cp, mkdir, readFile, writeFile } from "node:fs/promises";

const WEB = new URL("./", import.meta.url);
const OUTPUT = new URL("../build/web/", import.meta.url);
const OPTIONS = { bundle: true, format: "esm", target: "es2022", minify: true, logLevel: "warning" };

const STUBS = /\/esp32(?:s3|c6)?\.json$/;
/** Of esptool-js the page uses what belongs to its chips. */
const separate = {
  name: "separate",
  setup(builder) {
    builder.onResolve({ filter: /^esptool-js$/ }, () => ({ path: "./esptool.js", external: true }));
  },
};
const withoutOtherStubs = {
  name: "without-other-stubs",
  setup(builder) {
    builder.onLoad({ filter: /stub_flasher/ }, ({ path }) =>
      STUBS.test(path) ? undefined : { contents: "{}", loader: "json" },
    );
  },
};

await mkdir(OUTPUT, { recursive: true });
await build({
  ...OPTIONS,
  entryPoints: [new URL("src/page.ts", WEB).pathname],
  outfile: new URL("page.js", OUTPUT).pathname,
  plugins: [separate],
});
await build({
  ...OPTIONS,
  stdin: { contents: 'export { ESPError, ESPLoader, Transport } from "esptool-js";', resolveDir: WEB.pathname },
  outfile: new URL("esptool.js", OUTPUT).pathname,
  banner: { js: "/*! The licences of what is in here: esptool.txt */" },
  plugins: [withoutOtherStubs],
});
for (const name of ["index.html", "src/page.css", "src/icon.svg", "src/boot.svg"]) {
  await copyFile(new URL(name, WEB), new URL(name.replace("src/", ""), OUTPUT));
}
const licences = ["esptool-js/LICENSE", "pako/LICENSE", "atob-lite/LICENSE.md"].map(
  async (path) => `${path}\n\n${await readFile(new URL(`node_modules/${path}`, WEB), "utf8")}`,
);
await writeFile(new URL("esptool.txt", OUTPUT), (await Promise.all(licences)).join("\n"));
await cp(new URL("../docs/boards", WEB), new URL("boards", OUTPUT), { recursive: true });
