"use strict";
// Called by check_report.sh: axe, requests, script errors and overflow of a page.
const { mkdirSync } = require("node:fs");
const { pathToFileURL } = require("node:url");
const path = require("node:path");
const { launch, openPage, violations, tooWidePx, conclude } = require("./pages.cjs");

const url = pathToFileURL(process.argv[2]).href;
const pictures = process.env.TAGALONG_PICTURES;
const SERIOUS = ["serious", "critical"];

const look = async (browser, { colorScheme, javaScript, media }) => {
  const name = [colorScheme, javaScript ? "script" : "no-script", media].join("-");
  const problems = [];
  const options = { colorScheme, javaScriptEnabled: javaScript, viewport: { width: 1280, height: 800 } };
  const page = await openPage(browser, options, (asked) => asked === url, problems);
  await page.goto(url);
  await page.emulateMedia({ media, colorScheme });
  if (pictures && javaScript) await photograph(page, name);
  if (javaScript) problems.push(...(await judge(page, name)));
  await page.context().close();
  return problems.map((problem) => `${name}: ${problem}`);
};

// Everything is unfolded first, because axe does not see what is folded away.
const judge = async (page, name) => {
  await page.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
  const tooWide = await tooWidePx(page);
  const found = await violations(page);
  found.forEach(({ text }) => console.log(`${name}: ${text}`));
  const serious = found.filter(({ impact }) => SERIOUS.includes(impact)).map(({ text }) => text);
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
  const browser = await launch();
  const ways = [
    { colorScheme: "light", javaScript: true, media: "screen" },
    { colorScheme: "dark", javaScript: true, media: "screen" },
    { colorScheme: "dark", javaScript: true, media: "print" },
    { colorScheme: "light", javaScript: false, media: "screen" },
  ];
  const problems = [];
  for (const way of ways) problems.push(...(await look(browser, way)));
  await browser.close();
  return problems;
};

conclude("axe and browser", main);
