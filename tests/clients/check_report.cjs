"use strict";
// Called by check_report.sh and check_view.sh for pages that are read: axe, requests, script errors, layout
// and length of a page.
const { mkdirSync } = require("node:fs");
const { pathToFileURL } = require("node:url");
const path = require("node:path");
const { WAYS, launch, openPage, violations, layoutFaults, conclude } = require("./pages.cjs");

const url = pathToFileURL(process.argv[2]).href;
const pictures = process.env.TAGALONG_PICTURES;
const name = process.env.TAGALONG_PAGE || "report";
// Height of the folded page by screen, px.
const MOST_PX = { desk: 6000, wide: 6000, phone: 15000 };
// A landscape sheet of A4 without its margins, px.
const SHEET = { width: 1032, height: 703 };
// Rows of a table that axe sees: the others are of the same kind, and axe takes minutes for thousands.
const MOST_ROWS = 6;

const look = async (browser, { way, colorScheme, viewport, javaScript = true, media = "screen" }) => {
  const problems = [];
  const options = { colorScheme, javaScriptEnabled: javaScript, viewport };
  const page = await openPage(browser, options, (asked) => asked === url, problems);
  await page.goto(url);
  await page.emulateMedia({ media, colorScheme });
  const most = MOST_PX[way.split("-")[0]];
  if (most) {
    const height = await page.evaluate(() => document.documentElement.scrollHeight);
    if (height >= most) problems.push(`the page is ${height} px high, and should be below ${most}`);
  }
  if (media === "print") {
    const over = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
    if (over > 0) problems.push(`the printed page is ${over} px too wide`);
  }
  if (pictures && javaScript) await photograph(page, way);
  if (javaScript) problems.push(...(await judge(page, media)));
  await page.context().close();
  return problems.map((problem) => `${way}: ${problem}`);
};

// Everything is unfolded first, because axe does not see what is folded away.
const judge = async (page, media) => {
  const folded = media === "screen" ? await layoutFaults(page) : [];
  await page.evaluate(() => {
    document.querySelectorAll("details").forEach((d) => (d.open = true));
    document.querySelectorAll("button.more").forEach((button) => button.click());
  });
  const unfolded = media === "screen" ? await layoutFaults(page) : [];
  await page.evaluate((most) => {
    for (const body of document.querySelectorAll("tbody")) [...body.rows].slice(most).forEach((row) => row.remove());
  }, MOST_ROWS);
  return [...new Set([...folded, ...unfolded]), ...(await violations(page))];
};

const photograph = async (page, way) => {
  mkdirSync(pictures, { recursive: true });
  await page.screenshot({ path: path.join(pictures, `${name}-${way}.png`) });
  await page.screenshot({ path: path.join(pictures, `${name}-${way}-whole.png`), fullPage: true });
};

const main = async () => {
  const browser = await launch();
  const desk = WAYS[0].viewport;
  const ways = [
    ...WAYS,
    { way: "print", colorScheme: "dark", viewport: SHEET, media: "print" },
    { way: "no-script", colorScheme: "light", viewport: desk, javaScript: false },
  ];
  const problems = [];
  for (const way of ways) problems.push(...(await look(browser, way)));
  await browser.close();
  return problems;
};

conclude(`${name}: axe and browser`, main);
