// Opens what Rerun took in, in its viewer, and waits until that shows the log and the timeline; a picture of each.
// node rerun.mjs RERUN FOLDER NAME...     Opens FOLDER/NAME.rrd; pictures stand beside. Needs playwright-core and chromium.
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { createServer } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";

const { chromium } = createRequire(join(process.env.NODE_PATH ?? ".", "x.js"))("playwright-core");
// The viewer is drawn without a graphics card: a picture takes seconds, on a busy machine many.
const PATIENCE_S = 240;
const [rerun, folder, ...names] = process.argv.slice(2);

const profile = mkdtempSync(join(tmpdir(), "rerun-"));
const browser = await chromium.launchPersistentContext(profile, {
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  viewport: { width: 1200, height: 750 },
  args: ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
});
await browser.route(/^https?:\/\/(?!127\.0\.0\.1)/, (route) => route.abort());
const eye = await browser.newPage();
let faults = 0;
for (const name of names) {
  const began = Date.now();
  const left = () => PATIENCE_S * 1000 - (Date.now() - began);
  const [web, data] = [await freePort(), await freePort()];
  const server = spawn(rerun, ["--serve-web", "--web-viewer-port", web, "--port", data, "--bind", "127.0.0.1",
    join(folder, `${name}.rrd`)], { env: { ...process.env, RERUN_ANALYTICS: "0" }, stdio: "ignore" });
  const tab = await browser.newPage();
  const source = encodeURIComponent(`rerun+http://127.0.0.1:${data}/proxy`);
  const isShown = (seen) => seen.panels > 3000 && seen.timeline > 1000;
  let seen = { panels: 0, timeline: 0 };
  while (!isShown(seen) && left() > 0) {
    try {
      if (tab.url() === "about:blank") {
        await tab.goto(`http://127.0.0.1:${web}/?url=${source}&renderer=webgl`, { waitUntil: "commit", timeout: left() });
      }
      await tab.waitForTimeout(1500);
      const picture = await tab.screenshot({ timeout: Math.max(left(), 1) });
      writeFileSync(join(folder, `${name}.png`), picture);
      seen = await eye.evaluate(look, `data:image/png;base64,${picture.toString("base64")}`);
    } catch (error) {
      // It is not listening yet, or too busy to be drawn.
      await new Promise((done) => setTimeout(done, 500));
    }
  }
  server.kill();
  await tab.close();
  const seconds = ((Date.now() - began) / 1000).toFixed(0);
  const word = isShown(seen) ? "shown" : "NOT SHOWN";
  console.log(`${name}: ${word} after ${seconds} s, ${seen.panels} coloured pixels, ${seen.timeline} in the timeline`);
  faults += isShown(seen) ? 0 : 1;
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
  return { panels: count(0.17, 0.09, 0.745, 0.74, coloured), timeline: count(0.18, 0.84, 0.97, 0.99, marked) };
}
