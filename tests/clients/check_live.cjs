"use strict";
// Called by check_live.sh: a visitor of the page of a run that goes on.
const assert = require("node:assert");
const { spawn } = require("node:child_process");
const { existsSync, mkdirSync, writeFileSync } = require("node:fs");
const path = require("node:path");
const { WAYS, launch, openPage, violations, layoutFaults, conclude } = require("./pages.cjs");

const [program, config, log, home] = process.argv.slice(2);
const pictures = process.env.TAGALONG_PICTURES;
const folder = path.join(home, "run");

// Starts a run; resolves with the address of its page.
const start = () => new Promise((done, failed) => {
  const child = spawn(program, ["run", config, log, "-o", folder, "--overwrite", "--serve", "--realtime"], { stdio: ["ignore", "pipe", "pipe"] });
  let said = "";
  child.ended = new Promise((over) => child.on("exit", (code, signal) => over({ code, signal, said })));
  child.on("exit", () => failed(new Error(`the program ended: ${said}`)));
  child.stderr.on("data", (data) => {
    said += data;
    const address = /http:\/\/127\.0\.0\.1:\d+\/[0-9a-f]{32}\//.exec(said);
    if (address) done({ child, url: address[0] });
  });
});

const frameNow = async (page) => Number(/frame (\d+)/.exec(await page.textContent("#clock"))?.[1] ?? 0);
const waitForFrame = (page, after) => page.waitForFunction((least) =>
  Number(/frame (\d+)/.exec(document.getElementById("clock").textContent)?.[1] ?? 0) > least, after);

const checkFrames = async (page) => {
  await waitForFrame(page, 0);
  const first = await frameNow(page);
  await waitForFrame(page, first + 5);
  assert.match(await page.textContent("#alive"), /^Live: /);
  await page.waitForFunction(() => document.querySelectorAll("#image-0 .box:not(.dropped)").length > 0);
  assert.equal(await page.$$eval("#image-0 image", (all) => all.length), 1, "an image");
  assert.ok((await page.$$eval("#people-0 tbody tr", (all) => all.length)) > 0, "people in the table");
  assert.ok((await page.$$eval("#plan-0 circle.person", (all) => all.length)) > 0, "people in the plan");
};

const checkDrive = async (page) => {
  const rows = await page.$$eval("#drive-0 tbody tr", (all) => all.map((row) => [...row.children].map((cell) => cell.textContent)));
  assert.deepEqual(rows.map(([part]) => part), ["Target", "Lock", "Command", "Speed"]);
  const [, lock, command] = rows;
  assert.match(lock[1], /^(initial|training|locked|suspect|lost|re-found)$/);
  assert.match(command[1], /^[a-z-]+$/);
  assert.ok(rows.every((row) => row[2].length > 5), "each state with its meaning");
  const explained = await page.$eval('.above [data-layer="target"]', (mark) => mark.checkVisibility());
  assert.ok(explained, "the legend explains the target");
};

const checkPause = async (page) => {
  await page.click("#play");
  const stopped = await frameNow(page);
  await page.waitForTimeout(500);
  assert.equal(await frameNow(page), stopped, "the page goes on after a pause");
  assert.match(await page.textContent("#alive"), /paused/);
  await page.keyboard.press("Escape");
  await page.evaluate(() => document.activeElement.blur());
  await page.keyboard.press("ArrowLeft");
  assert.ok((await frameNow(page)) < stopped, "one frame back");
  await page.locator("#image-0").click({ position: { x: 30, y: 30 } });
  assert.match(await page.textContent("#question"), /^At column/);
  await page.click("#play");
  await waitForFrame(page, stopped + 3);
};

const visit = async (browser, url, { way, colorScheme, viewport }) => {
  const problems = [];
  const page = await openPage(browser, { colorScheme, viewport }, (asked) => asked.startsWith(url), problems);
  const answer = await page.goto(url);
  writeFileSync(path.join(home, "live.html"), await answer.text());
  try {
    await checkFrames(page);
    await checkDrive(page);
    await checkPause(page);
    assert.ok((await page.$$eval("#event-list li", (all) => all.length)) > 0, "events");
  } catch (error) {
    problems.push(error.message);
  }
  problems.push(...(await violations(page)), ...(await layoutFaults(page)));
  if (pictures) {
    mkdirSync(pictures, { recursive: true });
    await page.screenshot({ path: path.join(pictures, `live-${way}.png`) });
    await page.screenshot({ path: path.join(pictures, `live-${way}-whole.png`), fullPage: true });
  }
  return { page, problems: problems.map((problem) => `${way}: ${problem}`) };
};

// Ctrl-C: the page says so and keeps what it has, the program ends with its code, and the run is whole.
const checkEnd = async (page, child, problems) => {
  child.kill("SIGINT");
  const { code, said } = await child.ended;
  if (code !== 130) problems.push(`ended with ${code}: ${said}`);
  await page.waitForFunction(() => /has ended/.test(document.getElementById("alive").textContent));
  if ((await frameNow(page)) === 0) problems.push("the last frame is gone");
  for (const name of ["tracks.mcap", "report.json", "tracks.csv"]) {
    if (!existsSync(path.join(folder, name))) problems.push(`${name} is missing`);
  }
};

const main = async () => {
  const browser = await launch();
  const problems = [];
  for (const way of WAYS) {
    const { child, url } = await start();
    const { page, problems: found } = await visit(browser, url, way);
    problems.push(...found);
    await checkEnd(page, child, problems);
    await page.context().close();
  }
  await browser.close();
  return problems;
};

conclude("live page: axe and visitor", main);
