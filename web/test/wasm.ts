// The page's robot as WebAssembly, and one whose core has a fault.
import { execFile } from "node:child_process";
import { readFileSync } from "node:fs";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { fileURLToPath } from "node:url";
import { promisify } from "node:util";

const BUILD = fileURLToPath(new URL("../../build/web-wasm/", import.meta.url));
const FIRMWARE = fileURLToPath(new URL("../../firmware/esp32/", import.meta.url));
const run = promisify(execFile);

/** A test may name another robot for the tests that it starts. */
export const OTHER_ROBOT = "WHEELWIRE_PAGE_ROBOT";
const PATH = process.env[OTHER_ROBOT] ?? fileURLToPath(new URL("../../build/web/robot.wasm", import.meta.url));
export const WASM = readFileSync(PATH);

/** A fault in one of the firmware's files. */
export interface CoreFault {
  readonly file: string;
  readonly from: string;
  readonly to: string;
}

/** A core that goes on driving after the deadline of its newest setpoint. */
export const IGNORES_TTL: CoreFault = {
  file: "core/robot.cpp",
  from: "if (supervisor_.may_drive() && has_passed(setpoint_.expiry_us, now_us)) {",
  to: "if (supervisor_.may_drive() && has_passed(setpoint_.expiry_us, 0)) {",
};

/** The robot with a fault, built as `make web` builds it: its other files are those of that build. */
export async function wasmWith({ file, from, to }: CoreFault): Promise<Buffer> {
  const source = join(FIRMWARE, file);
  const text = await readFile(source, "utf8");
  if (text.split(from).length !== 2) throw new Error(`${file} has not exactly one ${from}`);
  const cache = await readFile(join(BUILD, "CMakeCache.txt"), "utf8");
  const ninja = /^CMAKE_MAKE_PROGRAM:\w+=(.*)$/m.exec(cache)?.[1] ?? "ninja";
  const { stdout } = await run(ninja, ["-C", BUILD, "-t", "commands", "robot"], { maxBuffer: 1 << 24 });
  const commands = stdout.split("\n");
  const compile = commands.find((one) => one.endsWith(` -c ${source}`));
  const object = / -o (\S+) /.exec(compile ?? "")?.[1];
  const link = commands.findLast((one) => one.includes(" -o robot.wasm"));
  if (compile === undefined || object === undefined || link === undefined) throw new Error(`${BUILD} has other commands`);
  const folder = await mkdtemp(join(tmpdir(), "wheelwire-core-"));
  try {
    const [patched, made, robot] = [basename(file), "patched.o", "robot.wasm"].map((name) => join(folder, name)) as [string, string, string];
    await writeFile(patched, text.replace(from, to));
    await run("sh", ["-c", compile.replaceAll(object, made).replace(source, patched)], { cwd: BUILD });
    await run("sh", ["-c", link.replace(object, made).replace(" -o robot.wasm", ` -o ${robot}`)], { cwd: BUILD });
    return await readFile(robot);
  } finally {
    await rm(folder, { recursive: true });
  }
}
