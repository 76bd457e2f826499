// The vectors of every language, in the browser's own engine.
import { build } from "esbuild";
import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { expect, test } from "./page.js";

interface Checks {
  vectors: typeof import("../vectors.js");
}

test("frames and streams are encoded and decoded as they should", async ({ page }) => {
  const { outputFiles } = await build({
    entryPoints: [fileURLToPath(new URL("../vectors.ts", import.meta.url))],
    bundle: true,
    format: "iife",
    globalName: "vectors",
    write: false,
  });
  await page.goto("about:blank");
  await page.addScriptTag({ content: outputFiles[0]?.text ?? "" });
  for (const name of ["generated", "handmade"]) {
    const path = new URL(`../../../protocol/vectors/${name}.json`, import.meta.url);
    const found = await page.evaluate((text) => {
      const { vectors } = globalThis as unknown as Checks;
      const parsed = vectors.parseVectors(text);
      const differences = [...vectors.checkFrames(parsed), ...vectors.checkStreams(parsed)];
      return { differences, count: parsed.frames.length };
    }, readFileSync(path, "utf8"));
    expect(found.differences).toEqual([]);
    expect(found.count).toBeGreaterThan(0);
  }
});
