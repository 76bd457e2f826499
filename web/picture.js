// Records the page as the picture of README and site, docs/page.png: an animated PNG. By a clock of
// its own, so that it is the same on a slow computer. `make web` first, then `node web/picture.js`.
import { chromium } from "@playwright/test";
import { readFile, writeFile } from "node:fs/promises";
import { createServer } from "node:http";
import { crc32, deflateSync, inflateSync } from "node:zlib";

const FILES = new URL("../build/web/", import.meta.url);
const PICTURE = new URL("../docs/page.png", import.meta.url);
const TYPES = { html: "text/html", js: "text/javascript", css: "text/css", wasm: "application/wasm", svg: "image/svg+xml" };
const FRAME_MS = 250;
const LAST_MS = 4000;
const MOST_BYTES = 600_000;

const server = createServer((request, response) => {
  const name = request.url === "/" ? "index.html" : request.url.slice(1);
  readFile(new URL(name, FILES)).then(
    (body) => response.writeHead(200, { "content-type": TYPES[name.split(".").at(-1)] }).end(body),
    () => response.writeHead(404).end(),
  );
});
await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));

const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ["--no-sandbox"] });
const page = await browser.newPage({ viewport: { width: 1100, height: 1800 }, deviceScaleFactor: 0.8 });
await page.clock.install();
await page.goto(`http://127.0.0.1:${server.address().port}/`);
await page.waitForFunction(() => globalThis.wheelwire !== undefined, undefined, { polling: 50 });
await page.clock.runFor(500);

// All of the same size, whatever the banner says.
const [top, bottom] = await Promise.all(["#banner", ".floor"].map((one) => page.locator(one).boundingBox()));
const height = bottom.y + bottom.height - top.y + 12;
const clip = { x: Math.floor(top.x - 6), y: Math.floor(top.y - 6), width: Math.ceil(top.width + 12), height };
const pictures = [];
async function record(ms) {
  for (let at = 0; at < ms; at += FRAME_MS) {
    await page.clock.runFor(FRAME_MS);
    pictures.push(await page.screenshot({ clip }));
  }
}
const press = (name) => page.getByRole("button", { name, exact: true }).click();
await press("figure eight");
await page.clock.runFor(5000);
await record(4000);
await press("hang the program");
await record(1500);
await browser.close();
server.close();

/** The chunks of a PNG: their types and contents. */
function chunksOf(png) {
  const chunks = [];
  for (let at = 8; at < png.length; at += 12 + png.readUInt32BE(at)) {
    chunks.push([png.toString("latin1", at + 4, at + 8), png.subarray(at + 8, at + 8 + png.readUInt32BE(at))]);
  }
  return chunks;
}

function chunk(type, content) {
  const bytes = Buffer.alloc(12 + content.length);
  bytes.writeUInt32BE(content.length, 0);
  bytes.write(type, 4, "latin1");
  content.copy(bytes, 8);
  bytes.writeUInt32BE(crc32(bytes.subarray(4, 8 + content.length)), 8 + content.length);
  return bytes;
}

const all = pictures.map(chunksOf);
const header = all[0].find(([type]) => type === "IHDR")[1];
const control = Buffer.alloc(8);
control.writeUInt32BE(all.length, 0);
const parts = [pictures[0].subarray(0, 8), chunk("IHDR", header), chunk("acTL", control)];
let sequence = 0;
all.forEach((chunks, number) => {
  if (!chunks.find(([type]) => type === "IHDR")[1].equals(header)) throw new Error("the size changed");
  const frame = Buffer.alloc(26);
  frame.writeUInt32BE(sequence++, 0);
  frame.writeUInt32BE(header.readUInt32BE(0), 4);
  frame.writeUInt32BE(header.readUInt32BE(4), 8);
  frame.writeUInt16BE(number === all.length - 1 ? LAST_MS : FRAME_MS, 20);
  frame.writeUInt16BE(1000, 22);
  parts.push(chunk("fcTL", frame));
  const data = Buffer.concat(chunks.filter(([type]) => type === "IDAT").map(([, content]) => content));
  const smaller = deflateSync(inflateSync(data), { level: 9, memLevel: 9 });
  if (number === 0) {
    parts.push(chunk("IDAT", smaller));
  } else {
    const order = Buffer.alloc(4);
    order.writeUInt32BE(sequence++, 0);
    parts.push(chunk("fdAT", Buffer.concat([order, smaller])));
  }
});
parts.push(chunk("IEND", Buffer.alloc(0)));
const picture = Buffer.concat(parts);
if (picture.length > MOST_BYTES) throw new Error(`${picture.length} bytes: record less`);
await writeFile(PICTURE, picture);
console.log(`docs/page.png: ${pictures.length} pictures, ${picture.length} bytes`);
