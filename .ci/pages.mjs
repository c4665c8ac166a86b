// Opens report pages at the width of a desk and of a phone, light and dark, as a person would see them:
// nothing may be wider than the page, no text smaller than 11 px or fainter than 4.5 : 1 (WCAG AA), nothing loaded.
// node pages.mjs FOLDER PAGE.html...     Screenshots go into FOLDER. Needs playwright-core and chromium.
import { createRequire } from "node:module";
import { basename, join, resolve } from "node:path";

const { chromium } = createRequire(join(process.env.NODE_PATH ?? ".", "x.js"))("playwright-core");
const [folder, ...pages] = process.argv.slice(2);
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
const browser = await chromium.launch({ executablePath, args: ["--no-sandbox"] });
let faults = 0;
for (const page of pages) {
  for (const [device, width] of [["desk", 1200], ["phone", 375]]) {
    for (const colorScheme of ["light", "dark"]) {
      const tab = await browser.newPage({ viewport: { width, height: 900 }, colorScheme, javaScriptEnabled: true });
      const elsewhere = [];
      tab.on("request", (request) => request.url().startsWith("file:") || elsewhere.push(request.url()));
      await tab.goto(`file://${resolve(page)}`);
      const found = await tab.evaluate(look);
      for (const fault of [...found, ...elsewhere.map((url) => `loads ${url}`)]) {
        console.error(`${page} (${device}, ${colorScheme}): ${fault}`);
        faults += 1;
      }
      await tab.screenshot({ path: join(folder, `${basename(page)}.${device}.${colorScheme}.png`), fullPage: true });
      await tab.close();
    }
  }
}
await browser.close();
console.log(`${pages.length} pages looked at, ${faults} faults`);
process.exit(faults ? 1 : 0);

function look() {
  const faults = new Set();
  const over = document.documentElement.scrollWidth - innerWidth;
  if (over > 0) faults.add(`is ${over} px wider than the screen`);
  // What is unfolded on request may be wider than a phone; what everybody sees may not.
  for (const table of document.querySelectorAll(".scroll:not(details *)")) {
    const cut = table.scrollWidth - table.clientWidth;
    if (cut > 1) faults.add(`cuts ${cut} px off "${table.textContent.trim().slice(0, 40)}"`);
  }
  // Names on the maps of directions cover no dot.
  for (const map of document.querySelectorAll(".map svg")) {
    const dots = [...map.querySelectorAll(".spot")].map((dot) => dot.getBoundingClientRect());
    for (const name of map.querySelectorAll("text")) {
      const box = name.getBoundingClientRect();
      const [x, y] = [box.width / 8, box.height / 4];
      const covered = dots.filter((dot) => dot.right > box.left + x && dot.left < box.right - x
        && dot.bottom > box.top + y && dot.top < box.bottom - y).length;
      if (covered) faults.add(`"${name.textContent}" covers ${covered} dots`);
    }
  }
  const rgb = (color) => (color.match(/[\d.]+/g) ?? []).map(Number);
  const light = (color) => {
    const [r, g, b] = color.map((v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const [r, g, b, a = 1] = rgb(getComputedStyle(at).backgroundColor);
      if (a === 1 && !getComputedStyle(at).backgroundColor.startsWith("color")) return [r, g, b];
    }
    return [255, 255, 255];
  };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    const text = walker.currentNode.textContent.trim();
    if (!text || element.closest("title") || !element.checkVisibility()) continue;
    const style = getComputedStyle(element);
    const scale = element.ownerSVGElement ? element.getScreenCTM().a : 1;
    const size = parseFloat(style.fontSize) * scale;
    if (size < 11) faults.add(`"${text}" is ${size.toFixed(1)} px small`);
    const ink = rgb(element.ownerSVGElement ? style.fill : style.color).slice(0, 3);
    const [a, b] = [light(ink), light(behind(element))];
    const contrast = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
    if (contrast < 4.5) faults.add(`"${text}" has a contrast of ${contrast.toFixed(1)}`);
  }
  return [...faults];
}
