// Takes the pictures of the README: the report, an annotated recording in Lichtblick, and one that is being recorded.
// node pictures.mjs STILLPOINT FOLDER [LICHTBLICK]     .ci/pictures prepares FOLDER and says what LICHTBLICK is.
import { spawn } from "node:child_process";
import {
  appendFileSync, createReadStream, mkdirSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync,
} from "node:fs";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { createServer as createSocket } from "node:net";
import { join, normalize } from "node:path";
import { crc32 } from "node:zlib";

const { chromium } = createRequire(join(process.env.NODE_PATH ?? ".", "x.js"))("playwright-core");
const [stillpoint, folder, lichtblick] = process.argv.slice(2);
const PATIENCE_MS = 240_000;
const printed = readFileSync(join(folder, "printed.txt"), "utf8");
const rests = Number(/(\d+) accepted/.exec(printed)[1]);

const [pages, live] = [await serve(), await freePort()];
const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  // The addresses in the title bar are those that a reader would see, whichever ports are free here.
  args: ["--no-sandbox", "--disable-quic", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    `--host-resolver-rules=MAP localhost:80 127.0.0.1:${pages.address().port}, MAP localhost:8765 127.0.0.1:${live}`],
});
mkdirSync(join(folder, "pictures"));
try {
  await report();
  if (lichtblick) {
    await annotated();
    await recorded();
  }
} finally {
  await browser.close();
  pages.close();
}

async function report() {
  const tab = await browser.newPage({ viewport: { width: 1100, height: 1010 }, colorScheme: "light" });
  await tab.goto(`file://${join(folder, "report.html")}`);
  keep("report", await tab.screenshot());
}

// The annotated recording at its end, played from its start: the 3D panel and the log show what was played.
async function annotated() {
  const tab = await viewer("remote-file", "http://localhost/demo.annotated.mcap");
  // Before the first messages were shown, it would not play.
  await tab.getByTestId("diagnostic-row").first().waitFor();
  await tab.getByTestId("play-button").click();
  await tab.mouse.move(700, 1);
  const rows = ["bias", "scale"].flatMap((name) => {
    const line = new RegExp(`^ +${name} .*`, "m").exec(printed)[0];
    const numbers = [...line.matchAll(/(-?[\d.]+) ±/g)].map(([, number]) => number);
    return numbers.map((number, i) => [new RegExp(`^${name}.*, ${"xyz"[i]}$`), number]);
  });
  const { picture } = await filled(tab, rests, (table) => rows.every(([key, number]) => {
    const [, shown = ""] = table.find(([name]) => key.test(name)) ?? [];
    const digits = number.split(".")[1].length;
    return Math.abs(parseFloat(shown.replace("−", "-")) - Number(number)) < 0.6 * 10 ** -digits;
  }));
  keep("viewer", picture);
}

// What a tail shows while the last rest is recorded. Each chunk is written at once, as recorders do, after the time
// that it took to record; the second and later ones once the viewer shows the first.
async function recorded() {
  const [whole, growing] = [readFileSync(join(folder, "demo.mcap")), join(folder, "growing.mcap")];
  // A viewer that is slow to subscribe misses the first readings.
  for (let tries = 3; ; tries -= 1) {
    const command = ["tail", growing, "-o", join(folder, "live.annotated.mcap"), "--idle-timeout", "1h",
      "--live", `127.0.0.1:${live}`];
    const tail = spawn(stillpoint, command, { stdio: "ignore" });
    const ended = new Promise((done) => tail.on("exit", done));
    try {
      const tab = await viewer("foxglove-websocket", "ws://localhost:8765");
      for (const { bytes, seconds } of written(whole).slice(0, -1)) {
        appendFileSync(growing, bytes);
        await tab.getByTestId("diagnostic-row").first().waitFor();
        await tab.waitForTimeout(1000 * seconds);
      }
      const { picture, isFromStart } = await filled(tab, rests - 1, () => true);
      if (isFromStart) return keep("live", picture);
      if (tries === 1) throw new Error("the viewer missed the first readings three times: is the machine too busy?");
      await tab.close();
    } finally {
      tail.kill("SIGKILL");
      await ended;
    }
    readdirSync(folder).filter((name) => /^(growing|live)\./.test(name)).forEach((name) => rmSync(join(folder, name)));
  }
}

// Lichtblick with the layout of the recording and a source of data.
async function viewer(source, url) {
  const context = await browser.newContext({
    viewport: { width: 1600, height: 1000 }, colorScheme: "light", locale: "en-GB", timezoneId: "UTC",
  });
  await context.route(/^https?:\/\/(?!localhost\/)/, (route) => route.abort());
  await context.addInitScript(() => {
    const settings = { colorScheme: "light", timezone: "UTC", "telemetry.telemetryEnabled": false };
    for (const [key, value] of Object.entries(settings)) {
      localStorage.setItem(`studio.app-configuration.${key}`, JSON.stringify(value));
    }
  });
  const tab = await context.newPage();
  tab.setDefaultTimeout(PATIENCE_MS);
  await tab.goto(`http://localhost/?ds=${source}&ds.url=${encodeURIComponent(url)}`);
  await tab.getByTestId("left-sidebar-button").click();
  await tab.mouse.move(700, 1);
  return tab;
}

// The picture of a viewer once nothing moves any more, a calibration from so many rests is shown as it should be, and
// no panel is empty; and whether it shows the readings from the first on.
async function filled(tab, fromRests, isRight) {
  const [end, eye] = [Date.now() + PATIENCE_MS, await browser.newPage()];
  let [before, wants] = [Buffer.alloc(0), "a picture"];
  while (Date.now() < end) {
    await tab.waitForTimeout(1000);
    // The log stops following its end while it is laid out.
    await tab.evaluate(() => document.querySelector("[data-testid=scrollable-list]")?.scrollTo(0, 1e6));
    const panels = await tab.evaluate(look);
    const picture = await tab.screenshot();
    const ink = await eye.evaluate(count, [picture.toString("base64"), panels]);
    wants = panels.flatMap(({ name, text, table }, i) => {
      const isDrawn = name.startsWith("3D") || name.startsWith("State") ? ink[i].all > 500 : ink[i].end > 20;
      if (/^(Plot|State|3D)/.test(name)) return isDrawn ? [] : [`${name}: a drawing`];
      if (name.includes("calibration")) {
        const isShown = text.includes(`from ${fromRests} rests`) && isRight(table);
        return isShown ? [] : [`${name}: the calibration from ${fromRests} rests`];
      }
      return text.split("\n").filter((line) => line.trim()).length > 3 ? [] : [`${name}: text`];
    });
    if (panels.length < 10) wants.push("all panels");
    if (!wants.length && picture.equals(before)) {
      await eye.close();
      const readings = panels.findIndex(({ name }) => name.startsWith("Plot!acceleration"));
      return { picture, isFromStart: ink[readings].start > 20 };
    }
    before = picture;
  }
  writeFileSync(join(folder, "wanting.png"), before);
  throw new Error(`not shown in time: ${wants.join(", ") || "a picture that stays"}`);
}

// What the panels say, and where they are.
function look() {
  return [...document.querySelectorAll("[data-testid^=panel-mouseenter-container]")].map((panel) => {
    const { x, y, width, height } = panel.getBoundingClientRect();
    const table = [...panel.querySelectorAll("tr")].map((row) => [...row.cells].map((cell) => cell.innerText.trim()));
    return { name: panel.dataset.testid.split(" ").at(-1), text: panel.innerText, table, x, y, width, height };
  });
}

// Coloured pixels of each panel below its title: all, those in its last fifth, and those where lines begin beside the
// legend of the readings.
async function count([picture, panels]) {
  const image = new Image();
  image.src = `data:image/png;base64,${picture}`;
  await image.decode();
  const canvas = new OffscreenCanvas(image.width, image.height).getContext("2d");
  canvas.drawImage(image, 0, 0);
  const ink = (x, y, width, height) => {
    const { data } = canvas.getImageData(x, y, width, height);
    let found = 0;
    for (let i = 0; i < data.length; i += 4) {
      const [r, g, b] = [data[i], data[i + 1], data[i + 2]];
      found += Math.max(r, g, b) - Math.min(r, g, b) > 80 ? 1 : 0;
    }
    return found;
  };
  return panels.map(({ x, y, width, height }) => ({
    all: ink(x, y + 32, width, height - 32),
    end: ink(x + 0.8 * width, y + 32, 0.2 * width, height - 32),
    start: ink(x + 185, y + 32, 60, height - 32),
  }));
}

// What a recorder wrote at a time: its chunks, each with what precedes it, and how long they took to record.
function written(mcap) {
  const found = [];
  for (let [from, at] = [0, 8]; at < mcap.length - 8; ) {
    const [isChunk, next] = [mcap[at] === 6, at + 9 + Number(mcap.readBigUInt64LE(at + 1))];
    if (isChunk) {
      const [start, end] = [9, 17].map((field) => mcap.readBigUInt64LE(at + field));
      found.push({ bytes: mcap.subarray(from, next), seconds: Number(end - start) / 1e9 });
      from = next;
    }
    at = next;
  }
  return found;
}

// Keeps a picture with what the program prints, as its description: https://www.w3.org/TR/png-3/#11iTXt
function keep(name, picture) {
  const chunk = Buffer.concat([Buffer.from("iTXtDescription\0\0\0\0\0"), Buffer.from(printed)]);
  const [length, sum, head] = [Buffer.alloc(4), Buffer.alloc(4), 8 + 25];
  length.writeUInt32BE(chunk.length - 4);
  sum.writeUInt32BE(crc32(chunk));
  const described = Buffer.concat([picture.subarray(0, head), length, chunk, sum, picture.subarray(head)]);
  writeFileSync(join(folder, "pictures", `${name}.png`), described);
  console.log(`${name}.png made`);
}

// Lichtblick with the layout as its default, and what stands in the folder; recordings are read in parts.
async function serve() {
  const types = { html: "text/html", js: "text/javascript", wasm: "application/wasm", css: "text/css" };
  const server = createServer((request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url, "http://localhost").pathname));
    if (path === "/") {
      const layout = readFileSync(join(folder, "layout.json"), "utf8").replaceAll("<", "\\u003c");
      const page = readFileSync(join(lichtblick, "index.html"), "utf8");
      response.writeHead(200, { "content-type": types.html });
      return response.end(page.replace("/*LICHTBLICK_SUITE_DEFAULT_LAYOUT_PLACEHOLDER*/", () => layout));
    }
    const file = join(path.endsWith(".mcap") ? folder : lichtblick, path);
    const size = statSync(file, { throwIfNoEntry: false })?.size;
    if (size === undefined) return response.writeHead(404).end();
    const [, from, to] = /^bytes=(\d+)-(\d*)$/.exec(request.headers.range ?? "") ?? [];
    const [start, end] = [Number(from ?? 0), to ? Math.min(Number(to), size - 1) : size - 1];
    response.writeHead(from ? 206 : 200, {
      "content-type": types[path.split(".").at(-1)] ?? "application/octet-stream",
      "content-length": end - start + 1, "accept-ranges": "bytes", "content-range": `bytes ${start}-${end}/${size}`,
    });
    if (request.method === "HEAD") return response.end();
    return createReadStream(file, { start, end }).pipe(response);
  });
  return new Promise((done) => server.listen(0, "127.0.0.1", () => done(server)));
}

function freePort() {
  return new Promise((done) => {
    const socket = createSocket().listen(0, "127.0.0.1", () => {
      const { port } = socket.address();
      socket.close(() => done(port));
    });
  });
}
