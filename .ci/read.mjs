// Prints how many messages @mcap/core reads through the index of an MCAP file: node read.mjs FILE
import { createRequire } from "node:module";
import { open } from "node:fs/promises";

const require = createRequire(`${process.env.NODE_PATH}/`);
const { McapIndexedReader } = require("@mcap/core");
const { loadDecompressHandlers } = require("@mcap/support");

const file = await open(process.argv[2]);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const bytes = new Uint8Array(Number(length));
    await file.read(bytes, 0, bytes.length, Number(offset));
    return bytes;
  },
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
let messages = 0;
for await (const _ of reader.readMessages()) messages += 1;
console.log(messages);
