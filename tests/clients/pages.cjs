"use strict";
// Shared by the visitors of pages: the browser, a watch on requests and errors, axe, and the end.
const { readFileSync } = require("node:fs");
const { chromium } = require("playwright-core");

const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const TIMEOUT_MS = 60_000;

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

// The faults that axe finds, worst ones and others.
const violations = async (page) => {
  await page.evaluate(axe);
  const found = (await page.evaluate(() => globalThis.axe.run())).violations;
  return found.map(({ id, impact, help, nodes }) => {
    const [node] = nodes;
    const why = node.any[0] ? node.any[0].message : "";
    return { impact, text: `axe: ${impact} ${id} (${nodes.length}), ${help}: ${node.html.slice(0, 140)} ${why}` };
  });
};

const tooWidePx = (page) =>
  page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);

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

module.exports = { launch, openPage, violations, tooWidePx, conclude };
