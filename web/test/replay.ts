// What a page recorded, repeated by this computer's simulator.
import { spawnSync } from "node:child_process";
import { fileURLToPath } from "node:url";

const PYTHON = fileURLToPath(new URL("../../.venv/bin/python", import.meta.url));
const REPLAY = fileURLToPath(new URL("replay.py", import.meta.url));

/** The log that this computer's simulator makes of these calls: a line for each, with its own answers. */
export function replay(lines: readonly string[]): string[] {
  const input = `${lines.join("\n")}\n`;
  const { status, stdout, stderr, error } = spawnSync(PYTHON, [REPLAY], { input, maxBuffer: 1 << 30 });
  if (error !== undefined) throw error;
  if (status !== 0) throw new Error(stderr.toString());
  return stdout.toString().trimEnd().split("\n");
}

/** The first line in which two logs differ; undefined if they are equal. */
export function difference(
  page: readonly string[],
  native: readonly string[],
): { line: number; page: string | undefined; native: string | undefined } | undefined {
  for (let line = 0; line < Math.max(page.length, native.length); line++) {
    if (page[line] !== native[line]) return { line, page: page[line], native: native[line] };
  }
  return undefined;
}
