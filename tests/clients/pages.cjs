"use strict";
// Shared by the visitors of pages: the browser, a watch on requests and errors, axe, and the end.
const { readFileSync } = require("node:fs");
const { chromium } = require("playwright-core");

const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const TIMEOUT_MS = 60_000;

// Ways in which each page is visited: a small and a large screen and a phone, light and dark.
const SCREENS = [
  { screen: "desk", viewport: { width: 1280, height: 800 } },
  { screen: "wide", viewport: { width: 1920, height: 1080 } },
  { screen: "phone", viewport: { width: 390, height: 844 } },
];
const WAYS = SCREENS.flatMap(({ screen, viewport }) =>
  ["light", "dark"].map((colorScheme) => ({ way: `${screen}-${colorScheme}`, colorScheme, viewport })));

const launch = () => chromium.launch({
  executablePath: process.env.TAGALONG_CHROMIUM,
  args: ["--no-sandbox", "--disable-gpu", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run"],
  timeout: TIMEOUT_MS,
});

// Opens a page that notes every request that is not allowed, and every error.
const openPage = async (browser, options, isAllowed, problems) => {
  const context = await browser.newContext(options);
  const page = await context.newPage();
  page.setDefaultTimeout(TIMEOUT_MS);
  page.on("request", (request) => {
    const asked = request.url();
    if (!isAllowed(asked) && !asked.startsWith("data:")) problems.push(`asks for ${asked}`);
  });
  page.on("pageerror", (error) => problems.push(`script error: ${error.message}`));
  page.on("console", (line) => line.type() === "error" && problems.push(line.text()));
  return page;
};

// The faults that axe finds, whatever their impact.
const violations = async (page) => {
  await page.evaluate(axe);
  const found = (await page.evaluate(() => globalThis.axe.run())).violations;
  return found.map(({ id, impact, help, nodes }) => {
    const [node] = nodes;
    const why = node.any[0] ? node.any[0].message : "";
    return `axe: ${impact} ${id} (${nodes.length}), ${help}: ${node.html.slice(0, 140)} ${why}`;
  });
};

// Faults of the layout: a page that is too wide, and cells of tables that are cut or squeezed.
const layoutFaults = (page) => page.evaluate(() => {
  const { scrollWidth, clientWidth } = document.documentElement;
  const faults = scrollWidth > clientWidth ? [`the page is ${scrollWidth - clientWidth} px too wide`] : [];
  const small = [...document.querySelectorAll("body *")].filter((element) =>
    element.checkVisibility() && [...element.childNodes].some((node) => node.nodeType === 3 && node.data.trim())
      && !element.closest("svg") && parseFloat(getComputedStyle(element).fontSize) < 11);
  if (small.length) faults.push(`letters below 11 px (${small.length}): ${small[0].outerHTML.slice(0, 120)}`);
  for (const table of document.querySelectorAll("table")) {
    const box = table.parentElement;
    if (!box || !box.checkVisibility()) continue;
    const isCut = table.scrollWidth > box.clientWidth + 1;
    if (isCut && !["auto", "scroll"].includes(getComputedStyle(box).overflowX)) {
      faults.push(`a table is cut: ${table.outerHTML.slice(0, 120)}`);
    }
  }
  return faults;
});

// Runs a visitor that returns problems, prints them and ends the program.
const conclude = (title, visit) => {
  visit().then((problems) => {
    problems.forEach((problem) => console.error(problem));
    console.log(problems.length ? `${title}: failed` : `${title}: ok`);
    process.exit(problems.length ? 1 : 0);
  }).catch((error) => {
    console.error(error);
    process.exit(1);
  });
};

module.exports = { WAYS, launch, openPage, violations, layoutFaults, conclude };
