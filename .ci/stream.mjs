// Prints what @mcap/core finds in MCAP files as it streams them: node stream.mjs < NAMES
// A line for each name: messages on topics that are not Stillpoint's, attachments `myFile`, metadata `myMetadata`; or what is wrong.
import { createRequire } from "node:module";
import { readFile } from "node:fs/promises";
import { createInterface } from "node:readline";

const require = createRequire(`${process.env.NODE_PATH}/`);
const { McapStreamReader } = require("@mcap/core");
const { loadDecompressHandlers } = require("@mcap/support");
const decompressHandlers = await loadDecompressHandlers();

async function found(path) {
  const reader = new McapStreamReader({ decompressHandlers, includeChunks: false, validateCrcs: true });
  reader.append(await readFile(path));
  const topics = new Map();
  let [messages, attachments, metadata] = [0, 0, 0];
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Channel") topics.set(record.id, record.topic);
    if (record.type === "Message") messages += !topics.get(record.channelId).includes("/stillpoint/");
    if (record.type === "Attachment") attachments += record.name === "myFile";
    if (record.type === "Metadata") metadata += record.name === "myMetadata";
  }
  if (!reader.done()) throw new Error("it does not end");
  return `${messages} ${attachments} ${metadata}`;
}

for await (const path of createInterface({ input: process.stdin })) {
  console.log(await found(path).catch((error) => `refused: ${error.message}`));
}
