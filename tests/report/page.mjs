// What must hold of any page of `rhec report`, in a browser: node page.mjs <page> <folder with node_modules> <browser> <folder to write to>
import {statSync} from "node:fs";
import {createRequire} from "node:module";
import {join, resolve} from "node:path";
import {pathToFileURL} from "node:url";

const [page, modules, browserPath, folder] = process.argv.slice(2);
const {chromium} = createRequire(join(resolve(modules), "package.json"))("playwright-core");
const address = pathToFileURL(resolve(page)).href;
const findings = [];
let expectations = 0;
const expect = (truth, text) => {
  ++expectations;
  if (!truth) findings.push(text);
};

const browser = await chromium.launch({executablePath: browserPath, args: ["--no-sandbox"]});

/// A fresh window on the page, without any network; what it complains of becomes a finding.
async function open(options, what) {
  const context = await browser.newContext({viewport: {width: 1440, height: 900}, ...options});
  await context.route("**/*", (route) => {
    if (route.request().url().startsWith("file:") || route.request().url().startsWith("data:")) return route.continue();
    findings.push(`${what}: asks the network for ${route.request().url()}`);
    return route.abort();
  });
  context.setDefaultTimeout(180000);  // a busy machine is no fault of the page; scripts/measure/report-page takes its time
  const view = await context.newPage();
  view.on("console", (message) => ["error", "warning"].includes(message.type()) && findings.push(`${what}: console: ${message.text()}`));
  view.on("pageerror", (error) => findings.push(`${what}: ${error.message}`));
  await view.goto(address);
  await view.evaluate(() => document.querySelectorAll("details:not(.numbers):not(.licences)").forEach((each) => (each.open = true)));
  await view.waitForFunction(() => [...document.querySelectorAll(".chart")].every((chart) => chart.dataset.drawn));
  return view;
}

/// Whether something comes true; a busy machine takes a while to draw.
async function eventually(isSo) {
  for (const end = Date.now() + 60000; !(await isSo()); await new Promise((go) => setTimeout(go, 50))) if (Date.now() > end) return false;
  return true;
}

/// Of each figure what is drawn of data: shapes that have not the colours of axes and are larger than those of a legend, or
/// many small ones; of a canvas the colours that it has.
const drawn = (view) => view.evaluate(() => [...document.querySelectorAll("figure")].map((figure) => {
  const canvas = figure.querySelector("canvas"), colours = new Set();
  if (canvas) {
    const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    for (let i = 0; i < data.length; i += 4) if (data[i + 3] > 200) colours.add((data[i] << 16) | (data[i + 1] << 8) | data[i + 2]);
  }
  const axes = ["#8c959f", "#e4e8ec", "#6b7580", "#2a3138", "none", null];
  const shapes = [...figure.querySelectorAll("svg path, svg image, svg circle, svg polygon")]
    .filter((shape) => shape.tagName === "image" || !axes.includes(shape.getAttribute("stroke")) || !axes.includes(shape.getAttribute("fill")))
    .map((shape) => shape.getBoundingClientRect());
  const large = shapes.filter(({width, height}) => width > 30 || height > 30).length;
  return {name: figure.dataset.figure, title: figure.querySelector("h3").textContent, hasData: colours.size > 30 || large > 0 || shapes.length >= 10};
}));

async function looksRight(view, what, width) {
  const figures = await drawn(view);
  expect(figures.length >= 3, `${what}: ${figures.length} figures`);
  for (const {name, title, hasData} of figures) {
    expect(title.length > 5 && !/undefined|null|NaN|\[object/.test(title), `${what}: figure ${name} is called '${title}'`);
    expect(hasData, `${what}: figure ${name} shows no data`);
  }
  const wide = await view.evaluate(() => document.documentElement.scrollWidth);
  expect(wide <= width, `${what}: the page is ${wide} pixels wide in a window of ${width}`);
  const text = await view.evaluate(() => document.body.innerText);
  expect(!/undefined|NaN|\[object/.test(text), `${what}: the text has ${(text.match(/.{20}(undefined|NaN|\[object).{20}/s) || ["?"])[0]}`);
  const clipped = await view.evaluate(() => [...document.querySelectorAll(".chart")].flatMap((chart) => {
    const frame = chart.getBoundingClientRect();
    return [...chart.querySelectorAll("svg text")].filter((label) => {
      const box = label.getBoundingClientRect();
      return box.width > 0 && (box.left < frame.left - 2 || box.right > frame.right + 2 || box.top < frame.top - 2 || box.bottom > frame.bottom + 2);
    }).map((label) => `'${label.textContent}' of ${chart.parentElement.dataset.figure}`);
  }));
  expect(clipped.length === 0, `${what}: labels reach out of their figures: ${clipped.slice(0, 5).join(", ")}`);
}

/// Contrast as WCAG counts it, of all text of the page itself and of the figures, against the ground it stands on.
const weakText = (view) => view.evaluate(() => {
  const parse = (colour) => {
    const numbers = (colour.match(/[\d.]+/g) || []).map(Number);
    return numbers.length >= 3 && (numbers[3] === undefined || numbers[3] > 0.9) ? numbers.slice(0, 3) : null;
  };
  const probe = document.createElement("span");
  document.body.append(probe);
  const computed = (colour) => {
    probe.style.color = colour;
    return parse(getComputedStyle(probe).color);
  };
  const luminance = (rgb) => rgb.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4)).reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const contrast = (a, b) => {
    const [high, low] = [luminance(a), luminance(b)].sort((x, y) => y - x);
    return (high + 0.05) / (low + 0.05);
  };
  const ground = (element) => {
    for (let at = element; at; at = at.parentElement) {
      const colour = parse(getComputedStyle(at).backgroundColor);
      if (colour) return colour;
    }
    return [255, 255, 255];
  };
  const weak = [];
  const texts = [...document.querySelectorAll("h1, h2, h3, p, a, dt, dd, li, summary, button, select, label span, output, th, td")].filter((each) => each.offsetParent && each.textContent.trim());
  for (const each of texts) {
    const ratio = contrast(parse(getComputedStyle(each).color), ground(each));
    if (ratio < 4.5) weak.push(`${each.tagName} '${each.textContent.slice(0, 20)}' ${ratio.toFixed(2)}`);
  }
  // Labels of figures; numbers inside coloured cells stand on their cell, whose colour chose theirs.
  for (const each of document.querySelectorAll('figure:not([data-figure*="heat"]) svg text')) {
    const colour = computed(each.getAttribute("fill") || "#000");
    const ratio = contrast(colour, ground(each.closest("figure")));
    if (ratio < 4.5) weak.push(`label '${each.textContent.slice(0, 20)}' ${ratio.toFixed(2)}`);
  }
  probe.remove();
  return weak;
});

for (const width of [390, 820, 1440]) {
  for (const colorScheme of ["light", "dark"]) {
    const what = `${width} pixels, ${colorScheme}`, view = await open({viewport: {width, height: 900}, colorScheme}, what);
    await looksRight(view, what, width);
    const look = await view.evaluate(() => document.documentElement.dataset.look);
    expect(look === colorScheme, `${what}: the page's look is ${look}`);
    const weak = await weakText(view);
    expect(weak.length === 0, `${what}: too little contrast: ${weak.slice(0, 4).join("; ")}`);
    await view.context().close();
  }
}

const view = await open({reducedMotion: "reduce"}, "keyboard");

// Everything that can be used can be reached with Tab, and shows that it is.
const wanted = await view.evaluate(() => [...document.querySelectorAll("a[href], button, select, input, summary, [tabindex='0']")].filter((each) => each.checkVisibility()).length);
const reached = new Set();
let unseen = 0;
for (let i = 0; i < wanted + 20; ++i) {
  await view.keyboard.press("Tab");
  const at = await view.evaluate(() => {
    const focused = document.activeElement;
    if (!focused || focused === document.body) return null;
    window.order = window.order || new Map();
    if (!window.order.has(focused)) window.order.set(focused, window.order.size);
    const style = getComputedStyle(focused);
    return {index: window.order.get(focused), outlined: style.outlineStyle !== "none" && parseFloat(style.outlineWidth) >= 2, skip: focused.className === "skip"};
  });
  if (at && !at.outlined) ++unseen;
  if (at) reached.add(at.index);
}
expect(reached.size >= wanted, `keyboard: Tab reaches ${reached.size} of ${wanted} controls`);
expect(unseen === 0, `keyboard: ${unseen} times the focus is not visible`);

// The numbers of every figure can be opened and have rows.
for (const folded of await view.locator("figure details.numbers > summary").all()) {
  await folded.focus();
  await view.keyboard.press("Enter");
}
const withoutRows = () => view.evaluate(() => [...document.querySelectorAll("figure")].filter((figure) => {
  const folded = figure.querySelector("details.numbers");
  return folded && (!folded.open || figure.querySelectorAll("tbody tr").length === 0);
}).map((figure) => figure.dataset.figure));
await eventually(async () => (await withoutRows()).length === 0);  // tables are made when the browser says that they were opened
const empty = await withoutRows();
expect(empty.length === 0, `numbers: without rows: ${empty.join(", ")}`);
// With the keyboard, which needs no figure to stand still; whichever of the two fails is told with its own words.
await view.locator("figure button", {hasText: "Save as CSV"}).first().focus();
const [download] = await Promise.all([view.waitForEvent("download"), view.keyboard.press("Enter")]);
const csv = join(folder, "saved.csv");
await download.saveAs(csv);
expect(statSync(csv).size > 20, "numbers: the CSV that was saved is empty");

// The look can be chosen against the system's.
await view.locator("#look").click();
await view.locator("#look").click();
expect(await view.evaluate(() => document.documentElement.dataset.look) === "dark", "look: two presses do not make the page dark");
await view.locator("#look").click();

const scrubber = view.locator("#scrubber");
if (await scrubber.count()) {
  const at = () => scrubber.evaluate((slider) => [Number(slider.value), Number(slider.max)]);
  const drawings = () => view.evaluate(() => document.querySelector('[data-figure="window-strip"] .chart').innerHTML);
  const words = () => view.locator("#sample-words").textContent();
  await scrubber.focus();
  for (const [key, expected] of [["Home", () => 0], ["ArrowRight", () => 1], ["Shift+ArrowRight", (last) => Math.min(11, last)], ["ArrowLeft", (last) => Math.min(11, last) - 1],
                                 ["End", (last) => last], ["Shift+ArrowLeft", (last) => Math.max(last - 10, 0)]]) {
    const before = [await words(), await drawings()];
    await view.keyboard.press(key);
    const [now, last] = await at();
    expect(now === expected(last), `scrubber: after ${key} it is at ${now} of ${last}, expected ${expected(last)}`);
    expect(await eventually(async () => before[0] !== await words() && before[1] !== await drawings()), `scrubber: after ${key} words or figure are as before`);
  }
  const box = await scrubber.boundingBox();
  await view.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  const [middle, last] = await at();
  expect(Math.abs(middle - last / 2) <= last / 8 + 1, `scrubber: a click into its middle leads to ${middle} of ${last}`);
  const figure = view.locator("figure:has(.cursor) .chart").first();
  await figure.scrollIntoViewIfNeeded();
  const place = await figure.boundingBox();
  await view.mouse.click(place.x + place.width * 0.8, place.y + place.height * 0.4);
  expect(await eventually(async () => (await at())[0] > middle), "scrubber: a click into a figure over time does not lead there");
  await view.locator("button", {hasText: "Play"}).click();
  const start = (await at())[0];
  await view.waitForFunction((from) => Number(document.getElementById("scrubber").value) !== from, start);
  await view.locator("button", {hasText: "Pause"}).click();
  await view.locator("#sample-numbers > summary").click();
  expect(await eventually(async () => await view.locator("#sample-numbers tbody tr").count() > 5), "scrubber: the sample has no numbers");
  await view.locator(".bar select").selectOption("10");
  await looksRight(view, "ten seconds around the sample", 1440);
}

const turned = view.locator("figure .chart[aria-description*=turn]");
if (await turned.count()) {
  const pixels = (of) => of.locator("canvas").evaluate((canvas) => canvas.toDataURL());
  const first = turned.first();
  const before = await pixels(first);
  await first.focus();
  await view.keyboard.press("ArrowLeft");
  expect(await eventually(async () => before !== await pixels(first)), "surface: an arrow key does not turn it");
  await view.keyboard.press("Home");
  expect(await eventually(async () => before === await pixels(first)), "surface: Home does not put it back");
  const box = await first.boundingBox();
  await view.mouse.move(box.x + 100, box.y + 100);
  await view.mouse.down();
  await view.mouse.move(box.x + 180, box.y + 120);
  await view.mouse.up();
  expect(await eventually(async () => before !== await pixels(first)), "surface: dragging does not turn it");
  const map = view.locator("figure[data-figure=heat] .chart"), told = view.locator("figure[data-figure=heat] p[role=status]");
  const chosen = await told.textContent();
  await map.focus();
  await view.keyboard.press("ArrowRight");
  expect(chosen !== await told.textContent(), "map: an arrow key does not choose another cell");
  for (const menu of await view.locator(".choices select").all()) {
    const title = await view.locator("figure[data-figure=heat] h3").textContent();
    const other = await menu.evaluate((select) => [...select.options].find((option) => !option.selected).value);
    await menu.selectOption(other);
    expect(title !== await view.locator("figure[data-figure=heat] h3").textContent(), "settings: another choice changes nothing");
  }
  await view.locator("button", {hasText: "Relative"}).click();
  expect((await view.locator("figure[data-figure=heat] h3").textContent()).includes("%"), "map: 'relative' changes nothing");
  await looksRight(view, "other choices", 1440);
}

// Printed: on white, in full, no controls.
await view.emulateMedia({media: "print"});
const onPaper = () => view.evaluate(() => ({
  ground: getComputedStyle(document.body).backgroundColor, bar: [...document.querySelectorAll("nav, .bar, button")].filter((each) => each.offsetParent).length,
  undrawn: [...document.querySelectorAll("figure")].filter((figure) => figure.offsetParent && figure.querySelectorAll("svg path").length < 3).map((figure) => figure.dataset.figure)}));
await eventually(async () => (await onPaper()).undrawn.length === 0);
const printed = await onPaper();
expect(printed.ground === "rgb(255, 255, 255)", `print: the ground is ${printed.ground}`);
expect(printed.bar === 0, `print: ${printed.bar} controls are on paper`);
expect(printed.undrawn.length === 0, `print: not drawn: ${printed.undrawn.join(", ")}`);
const paper = await view.pdf({format: "A4"});
expect(paper.length > 20000, `print: the PDF has ${paper.length} bytes`);

await browser.close();
for (const finding of findings) console.log(finding);
console.log(`page: ${expectations} expectations, ${findings.length} failed`);
process.exit(findings.length || !expectations ? 1 : 0);
