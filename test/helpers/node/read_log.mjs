// Copyright 2026 The masmc_ros authors
// SPDX-License-Identifier: Apache-2.0

// Reads a log as viewers do: decodes every message by its definition in the log.
//
//   node read_log.mjs RUN.mcap [LAYOUT.json]
//
// Prints JSON: type, number of messages, digest of all contents and the last message of every
// topic. With a layout it also prints the output of the layout's scripts.
import { createHash } from "node:crypto";
import { open, readFile } from "node:fs/promises";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers } from "@mcap/support";
import { scriptsOf } from "./user_scripts.mjs";

// Adds numbers as float64 and texts as UTF-8, in the order of the definition.
function digest(hash, value) {
  if (typeof value === "string") {
    hash.update(value);
  } else if (typeof value === "object") {
    for (const element of ArrayBuffer.isView(value) ? value : Object.values(value)) {
      digest(hash, element);
    }
  } else {
    const number = Buffer.alloc(8);
    number.writeDoubleLE(Number(value));
    hash.update(number);
  }
}

// Converts typed arrays to plain arrays, and 64-bit integers to numbers.
const plain = (_, value) =>
  typeof value === "bigint" ? Number(value) : ArrayBuffer.isView(value) ? [...value] : value;

const [log, layout] = process.argv.slice(2);
const file = await open(log, "r");
const reader = await McapIndexedReader.Initialize({
  readable: new FileHandleReadable(file),
  decompressHandlers: await loadDecompressHandlers(),
});
const topics = new Map();
for (const channel of reader.channelsById.values()) {
  const schema = reader.schemasById.get(channel.schemaId);
  const definitions = parse(new TextDecoder().decode(schema.data), { ros2: true });
  topics.set(channel.id, {
    topic: channel.topic,
    type: schema.name,
    count: 0,
    hash: createHash("sha256"),
    definitions,
    decoder: new MessageReader(definitions),
  });
}
const scripts = layout
  ? scriptsOf(JSON.parse(await readFile(layout, "utf-8")), [...topics.values()])
  : [];
for await (const message of reader.readMessages()) {
  const topic = topics.get(message.channelId);
  topic.last = topic.decoder.readMessage(message.data);
  topic.count += 1;
  digest(topic.hash, topic.last);
  for (const script of scripts) {
    if (script.inputs.includes(topic.topic)) {
      const receiveTime = {
        sec: Number(message.logTime / 1_000_000_000n),
        nsec: Number(message.logTime % 1_000_000_000n),
      };
      const made = script.default({ topic: topic.topic, receiveTime, message: topic.last });
      if (made != undefined) script.made.push(made);
    }
  }
}
await file.close();
const summary = {
  profile: reader.header.profile,
  statistics: Number(reader.statistics.messageCount),
  topics: {},
  scripts: Object.fromEntries(scripts.map((script) => [script.output, script.made])),
};
for (const { topic, type, count, hash, last } of topics.values()) {
  summary.topics[topic] = { type, count, digest: hash.digest("hex"), last };
}
process.stdout.write(JSON.stringify(summary, plain));
