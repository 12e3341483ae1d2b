"use strict";
// Called by check_report.sh: axe, requests, script errors and overflow of a page.
const { readFileSync, mkdirSync } = require("node:fs");
const { pathToFileURL } = require("node:url");
const path = require("node:path");
const { chromium } = require("playwright-core");

const url = pathToFileURL(process.argv[2]).href;
const axe = readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
const pictures = process.env.TAGALONG_PICTURES;
const TIMEOUT_MS = 60_000;
const SERIOUS = ["serious", "critical"];

const look = async (browser, { colorScheme, javaScript, media }) => {
  const name = [colorScheme, javaScript ? "script" : "no-script", media].join("-");
  const problems = [];
  const context = await browser.newContext({
    colorScheme,
    javaScriptEnabled: javaScript,
    viewport: { width: 1280, height: 800 },
  });
  const page = await context.newPage();
  page.setDefaultTimeout(TIMEOUT_MS);
  page.on("request", (request) => {
    const asked = request.url();
    if (asked !== url && !asked.startsWith("data:")) problems.push(`asks for ${asked}`);
  });
  page.on("pageerror", (error) => problems.push(`script error: ${error.message}`));
  page.on("console", (line) => line.type() === "error" && problems.push(line.text()));
  await page.goto(url);
  await page.emulateMedia({ media, colorScheme });
  if (pictures && javaScript) await photograph(page, name);
  if (javaScript) problems.push(...(await judge(page, name)));
  await context.close();
  return problems.map((problem) => `${name}: ${problem}`);
};

// Everything is unfolded first, because axe does not see what is folded away.
const judge = async (page, name) => {
  await page.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
  const tooWide = await page.evaluate(
    () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
  );
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  for (const { id, impact, nodes } of violations) {
    console.log(`axe, ${name}: ${impact} ${id} (${nodes.length}): ${nodes[0].html.slice(0, 120)}`);
    if (nodes[0].any[0]) console.log(`  ${nodes[0].any[0].message}`);
  }
  const serious = violations.filter((v) => SERIOUS.includes(v.impact)).map((v) => `axe: ${v.help}`);
  return tooWide > 0 && !name.endsWith("print")
    ? [...serious, `the page is ${tooWide} px too wide`]
    : serious;
};

const photograph = async (page, name) => {
  mkdirSync(pictures, { recursive: true });
  for (const section of await page.$$("main > section")) {
    const id = await section.getAttribute("id");
    await section.screenshot({ path: path.join(pictures, `${name}-${id}.png`) });
  }
  await page.screenshot({ path: path.join(pictures, `${name}.png`) });
};

const main = async () => {
  const browser = await chromium.launch({
    executablePath: process.env.TAGALONG_CHROMIUM,
    args: ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"],
    timeout: TIMEOUT_MS,
  });
  const ways = [
    { colorScheme: "light", javaScript: true, media: "screen" },
    { colorScheme: "dark", javaScript: true, media: "screen" },
    { colorScheme: "dark", javaScript: true, media: "print" },
    { colorScheme: "light", javaScript: false, media: "screen" },
  ];
  const problems = [];
  for (const way of ways) problems.push(...(await look(browser, way)));
  await browser.close();
  problems.forEach((problem) => console.error(problem));
  console.log(problems.length ? "axe and browser: failed" : "axe and browser: ok");
  process.exit(problems.length ? 1 : 0);
};

main().catch((error) => {
  console.error(error);
  process.exit(1);
});
