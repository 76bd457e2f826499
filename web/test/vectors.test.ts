// The vectors that every language has to pass: built by plain construct, or by hand from SPEC.md.
import { readFileSync } from "node:fs";
import { describe, expect, test } from "vitest";
import { checkFrames, checkStreams, parseVectors, type Vectors } from "./vectors.js";

function load(name: string): Vectors {
  const path = new URL(`../../protocol/vectors/${name}.json`, import.meta.url);
  return parseVectors(readFileSync(path, "utf8"));
}

describe.each(["generated", "handmade"])("%s vectors", (name) => {
  const vectors = load(name);

  test("frames are encoded and decoded", () => {
    expect(vectors.frames.length).toBeGreaterThan(0);
    expect(checkFrames(vectors)).toEqual([]);
  });

  test("streams are cut into frames, and counted", () => {
    expect(checkStreams(vectors)).toEqual([]);
  });
});

test("the check notices a wrong vector", () => {
  const vectors = load("handmade");
  const [frame] = vectors.frames;
  if (frame === undefined) throw new Error("no vector");
  const wrong = { ...frame, fields: { ...frame.fields, mode: 1 } };
  expect(checkFrames({ frames: [wrong] })).toHaveLength(2);
});
