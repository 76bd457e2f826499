// These tests notice a core that ignores the life of a setpoint: each of them fails with it.
import { spawnSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { expect, test } from "vitest";
import { IGNORES_TTL, OTHER_ROBOT, wasmWith } from "./wasm.js";

const FILES = ["breaks", "connection"];
const TESTS = [
  "'hang the program' does what it should",
  "'pull the cable' does what it should",
  "a page that is killed",
  "a line on which all is lost toRobot",
  "stop times are those of the reliability page",
];

interface Report {
  readonly testResults: readonly {
    readonly assertionResults: readonly { fullName: string; status: string; failureMessages: readonly string[] }[];
  }[];
}

test("a core that ignores the ttl fails each of these tests", async () => {
  const folder = mkdtempSync(join(tmpdir(), "wheelwire-core-"));
  const [robot, output] = [join(folder, "robot.wasm"), join(folder, "report.json")];
  writeFileSync(robot, await wasmWith(IGNORES_TTL));
  const options = ["vitest", "run", ...FILES, "-t", TESTS.join("|"), "--reporter=json", `--outputFile=${output}`];
  spawnSync("npx", options, { env: { ...process.env, [OTHER_ROBOT]: robot } });
  const { testResults } = JSON.parse(readFileSync(output, "utf8")) as Report;
  rmSync(folder, { recursive: true });
  const ran = testResults.flatMap((one) => one.assertionResults).filter(({ status }) => status !== "skipped");
  for (const name of TESTS) {
    const [found, ...more] = ran.filter(({ fullName }) => fullName.includes(name));
    expect(more, name).toEqual([]);
    expect(found?.failureMessages.join(), name).toContain("AssertionError");
  }
}, 600_000);
