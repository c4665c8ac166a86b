// Prints how many messages @mcap/core reads through the index of an MCAP file: node read.mjs FILE
// Without FILE, takes names from standard input, one a line, and prints a line for each: the number, or what is wrong.
import { createRequire } from "node:module";
import { open } from "node:fs/promises";
import { createInterface } from "node:readline";

const require = createRequire(`${process.env.NODE_PATH}/`);
const { McapIndexedReader } = require("@mcap/core");
const { loadDecompressHandlers } = require("@mcap/support");
const decompressHandlers = await loadDecompressHandlers();

async function count(path) {
  const file = await open(path);
  try {
    const { size } = await file.stat();
    const readable = {
      size: async () => BigInt(size),
      read: async (offset, length) => {
        if (offset + length > BigInt(size)) throw new Error(`${length} bytes at ${offset} of ${size}`);
        const bytes = new Uint8Array(Number(length));
        await file.read(bytes, 0, bytes.length, Number(offset));
        return bytes;
      },
    };
    const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
    let messages = 0;
    for await (const _ of reader.readMessages()) messages += 1;
    return messages;
  } finally {
    await file.close();
  }
}

if (process.argv[2]) {
  console.log(await count(process.argv[2]));
} else {
  for await (const path of createInterface({ input: process.stdin })) {
    console.log(await count(path).catch((error) => `refused: ${error.message}`));
  }
}
