// Reads every message of a recording as Foxglove and Lichtblick do: for tools/check_viewers.py.
// Prints one line of JSON: the profile, and of each topic its schema, messages and newest message.
import { open } from "node:fs/promises";

import { McapIndexedReader } from "@mcap/core";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";

const file = await open(process.argv[2]);
const { size } = await file.stat();
const reader = await McapIndexedReader.Initialize({
  readable: {
    size: async () => BigInt(size),
    read: async (offset, length) => {
      const buffer = new Uint8Array(Number(length));
      await file.read(buffer, 0, Number(length), Number(offset));
      return buffer;
    },
  },
});
const readers = new Map();
for (const channel of reader.channelsById.values()) {
  const schema = reader.schemasById.get(channel.schemaId);
  const text = new TextDecoder().decode(schema.data);
  readers.set(channel.id, new MessageReader(parse(text, { ros2: true })));
}
const topics = {};
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const decoded = readers.get(channel.id).readMessage(message.data);
  const topic = (topics[channel.topic] ??= {
    schema: reader.schemasById.get(channel.schemaId).name,
    count: 0,
  });
  topic.count += 1;
  topic.newest = decoded;
}
await file.close();
const plain = (_, value) =>
  typeof value === "bigint" ? Number(value) : ArrayBuffer.isView(value) ? Array.from(value) : value;
console.log(JSON.stringify({ profile: reader.header.profile, topics }, plain));
