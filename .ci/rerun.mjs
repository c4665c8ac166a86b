// Opens recordings in the viewer of Rerun and waits until it shows their log and their timeline; a picture of each.
// By hand: software rendering of the viewer is too slow on small machines for CI.
// node rerun.mjs FOLDER NAME=FILE[,FILE]...     Pictures go into FOLDER. Needs rerun, playwright-core and chromium.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";

const { chromium } = createRequire(join(process.env.NODE_PATH ?? ".", "x.js"))("playwright-core");
const PATIENCE_S = 120;
const [folder, ...sessions] = process.argv.slice(2);

const profile = mkdtempSync(join(tmpdir(), "rerun-"));
const browser = await chromium.launchPersistentContext(profile, {
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  viewport: { width: 1600, height: 1000 },
  args: ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
});
await browser.route(/^https?:\/\/(?!127\.0\.0\.1)/, (route) => route.abort());
const eye = await browser.newPage();
let faults = 0;
for (const session of sessions) {
  const [name, files] = session.split("=");
  const [web, data] = [await freePort(), await freePort()];
  const rerun = spawn(process.env.RERUN ?? "rerun", ["--serve-web", "--web-viewer-port", web, "--port", data,
    "--bind", "127.0.0.1", ...files.split(",")], { env: { ...process.env, RERUN_ANALYTICS: "0" }, stdio: "ignore", detached: true });
  const tab = await browser.newPage();
  const source = encodeURIComponent(`rerun+http://127.0.0.1:${data}/proxy`);
  let seen = {};
  const deadline = Date.now() + PATIENCE_S * 1000;
  do {
    await new Promise((done) => setTimeout(done, 1500));
    if (tab.url() === "about:blank") {
      await tab.goto(`http://127.0.0.1:${web}/?url=${source}&renderer=webgl`).catch(() => {});
    }
    const picture = await tab.screenshot();
    writeFileSync(join(folder, `${name}.png`), picture);
    seen = await eye.evaluate(look, `data:image/png;base64,${picture.toString("base64")}`);
  } while (!(seen.panels > 1500 && seen.timeline > 300) && Date.now() < deadline);
  await tab.close();
  // What was started is a script that starts the viewer.
  process.kill(-rerun.pid);
  const shown = seen.panels > 1500 && seen.timeline > 300;
  console.log(`${name}: ${shown ? "shown" : "NOT SHOWN"}, ${seen.panels} coloured pixels, ${seen.timeline} in the timeline`);
  faults += shown ? 0 : 1;
}
await browser.close();
rmSync(profile, { recursive: true, force: true });
process.exit(faults ? 1 : 0);

function freePort() {
  return new Promise((done) => {
    const server = createServer().listen(0, "127.0.0.1", () => {
      const { port } = server.address();
      server.close(() => done(port));
    });
  });
}

// Coloured pixels in the middle, where log lines and plots are; and what stands on the timeline's ground.
async function look(url) {
  const image = new Image();
  image.src = url;
  await image.decode();
  const { width, height } = image;
  const canvas = new OffscreenCanvas(width, height).getContext("2d");
  canvas.drawImage(image, 0, 0);
  const count = (x0, y0, x1, y1, is) => {
    const [x, y, w, h] = [x0 * width, y0 * height, (x1 - x0) * width, (y1 - y0) * height].map(Math.round);
    const { data } = canvas.getImageData(x, y, w, h);
    let found = 0;
    for (let i = 0; i < data.length; i += 4) found += is(data[i], data[i + 1], data[i + 2]) ? 1 : 0;
    return found;
  };
  const coloured = (r, g, b) => Math.max(r, g, b) - Math.min(r, g, b) > 80;
  const ground = canvas.getImageData(Math.round(0.9 * width), Math.round(0.97 * height), 1, 1).data;
  const marked = (r, g, b) => Math.abs(r - ground[0]) + Math.abs(g - ground[1]) + Math.abs(b - ground[2]) > 200;
  return { panels: count(0.13, 0.1, 0.8, 0.73, coloured), timeline: count(0.14, 0.84, 0.97, 0.99, marked) };
}
