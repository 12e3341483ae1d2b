"use strict";
// Called by check_view.sh: a visitor of the page that clicks, scrubs, plays and reads back; axe,
// requests, script errors and overflow on the way.
const assert = require("node:assert");
const { mkdirSync } = require("node:fs");
const { pathToFileURL } = require("node:url");
const path = require("node:path");
const { WAYS, launch, openPage, violations, layoutFaults, conclude } = require("./pages.cjs");

const url = pathToFileURL(process.argv[2]).href;
const pictures = process.env.TAGALONG_PICTURES;
const name = process.env.TAGALONG_PAGE || "page";

const frameNow = (page) => page.$eval("#frame", (slider) => Number(slider.value));
const readData = (page) => page.$eval("#data", (element) => JSON.parse(element.textContent));
const scrub = (page, at) =>
  page.$eval("#frame", (slider, value) => {
    slider.value = value;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
  }, at);

const checkKeys = async (page, last) => {
  await page.evaluate(() => document.activeElement.blur());
  await page.keyboard.press("Home");
  assert.equal(await frameNow(page), 0, "Home");
  await page.keyboard.press("ArrowRight");
  assert.equal(await frameNow(page), 1, "an arrow goes one frame ahead");
  await page.keyboard.press("Shift+ArrowRight");
  assert.equal(await frameNow(page), Math.min(11, last), "with Shift ten");
  await page.keyboard.press("End");
  assert.equal(await frameNow(page), last, "End");
};

// Of two people at one place both IDs can be read.
const checkIds = async (page, number) => {
  const texts = await page.$$eval(`#plan-${number} .plan-text`, (all) => all.map((text) => {
    const { x, y, width, height } = text.getBBox();
    return { id: text.textContent, x: x + width / 2, y: y + height / 2, width, height };
  }));
  for (const [at, a] of texts.entries()) {
    for (const b of texts.slice(0, at)) {
      // A line of text is higher than its digits.
      const isOver = Math.abs(a.x - b.x) < 0.4 * (a.width + b.width) && Math.abs(a.y - b.y) < 0.25 * (a.height + b.height);
      assert.ok(!isOver, `in the plan the ID ${a.id} is over ${b.id}`);
    }
  }
};

const checkScrubbing = async (page, data) => {
  const middle = Math.floor((data.t.length - 1) / 2);
  await scrub(page, middle);
  const clock = await page.textContent("#clock");
  assert.ok(clock.includes(`${data.t[middle].toFixed(2)} of`), clock);
  for (const [number, run] of data.runs.entries()) {
    const frame = run.frames[middle];
    if (!frame || !data.image_px[0]) continue;
    const boxes = await page.$$eval(`#image-${number} [data-track]`, (all) => all.map((g) => Number(g.dataset.track)));
    assert.deepEqual(boxes.sort(), frame.tracks.map((track) => track.id).sort(), "the boxes of the frame");
    const people = await page.$$eval(`#people-${number} tbody th`, (all) => all.map((th) => Number(th.textContent)));
    assert.deepEqual(people, frame.tracks.map((track) => track.id), "the table of the frame");
    const tests = await page.$$eval(`#funnel-${number} tbody th`, (all) => all.map((th) => th.textContent));
    assert.deepEqual(tests, frame.dropped.map((test) => test.test), "the funnel of the frame");
    await checkIds(page, number);
  }
  const strip = await page.locator("#strip-0").boundingBox();
  await page.mouse.click(strip.x + 0.25 * strip.width, strip.y + 0.5 * strip.height);
  const quarter = 0.25 * (data.t.length - 1);
  assert.ok(Math.abs((await frameNow(page)) - quarter) <= 2, "a click on the strip");
};

const checkEvents = async (page, data) => {
  const first = data.runs.flatMap((run) => run.events).sort((a, b) => a.i - b.i).find((event) => event.i > 0);
  if (!first) return;
  await scrub(page, 0);
  await page.click("#next");
  assert.equal(await frameNow(page), first.i, "the next event");
  await scrub(page, 0);
  await page.click(`#event-list button[data-i="${first.i}"]`);
  assert.equal(await frameNow(page), first.i, "an event of the list");
};

// A dropped candidate whose place is in the image, and that no other one hides.
const findDropped = (data) => {
  for (let at = 0; at < data.t.length; at += 1) {
    const frame = data.runs[0].frames[at];
    const [width, height] = data.image_px;
    const inside = ([x, y, w, h]) => x >= 0 && y >= 0 && x + w <= width && y + h <= height;
    const found = frame && frame.found.find((candidate) => candidate.test && inside(candidate.box));
    const region = frame && frame.dropped.find((test) => (test.boxes || []).some(inside));
    if (found) return { at, test: found.test, box: found.box };
    if (region) return { at, test: region.test, box: region.boxes.find(inside) };
  }
  return null;
};

const checkQuestion = async (page, data) => {
  const dropped = findDropped(data);
  if (!dropped) return console.log("no candidate was dropped inside the image: no click is tried");
  await scrub(page, dropped.at);
  await page.keyboard.press("Escape");
  assert.equal(await page.$$eval("#why-0 table", (all) => all.length), 0, "no answer without a question");
  const [x, y, w, h] = dropped.box;
  const area = await page.locator("#image-0").boundingBox();
  const scale = Math.min(area.width / data.image_px[0], area.height / data.image_px[1]);
  const left = (area.width - scale * data.image_px[0]) / 2;
  const top = (area.height - scale * data.image_px[1]) / 2;
  await page.locator("#image-0").click({ position: { x: left + scale * (x + w / 2), y: top + scale * (y + h / 2) } });
  const tests = await page.$$eval("#why-0 tbody th", (all) => all.map((th) => th.textContent));
  assert.ok(tests.includes(dropped.test), `${dropped.test} is not among ${tests}`);
  const lines = await page.$$eval("#why-0 code", (all) => all.map((code) => code.textContent));
  const expected = data.runs[0].tests[dropped.test].settings;
  assert.ok(expected.every((line) => lines.includes(line)), "the settings that decide the test");
};

const checkMissed = async (page, data) => {
  const missed = data.runs.flatMap((run) => run.events).filter((event) => event.kind === "missed");
  const shown = missed.find((event) => data.truth[event.i].some((person) => person.id === event.person && person.box));
  if (!shown) return console.log("nobody was missed: the key M is not tried");
  await scrub(page, 0);
  for (let i = 0; i < missed.length && (await frameNow(page)) !== shown.i; i += 1) await page.keyboard.press("m");
  const question = await page.textContent("#question");
  if (shown.i > 0) assert.ok(question.includes(`annotated person`), question);
};

// A click on an event far below shows its frame, and the list has the test that the reason names.
const checkMissedEvents = async (page, data) => {
  const missed = data.runs[0].events.filter((event) => event.kind === "missed").slice(0, 5);
  for (const event of missed) {
    await page.locator(`#event-list button[data-i="${event.i}"]`, { hasText: "missed" }).first().click();
    const top = await page.$eval(".runs", (stage) => stage.getBoundingClientRect().top);
    assert.ok(top >= 0 && top < page.viewportSize().height / 2, `the images are at ${top} px after a click on an event`);
    const cause = await page.$eval("#why-0", (place) => (place.querySelector(".cause") || place).textContent);
    const test = /the test "([^"]+)" dropped/.exec(cause);
    const tests = await page.$$eval("#why-0 tbody th", (all) => all.map((th) => th.textContent));
    if (test) assert.ok(tests.includes(test[1]), `${test[1]} is the reason and not among ${tests}`);
  }
};

// A click on the plan is answered there, with an image or without.
const checkPlanClick = async (page) => {
  await page.locator("#plan-0").click({ position: { x: 30, y: 30 } });
  const question = await page.textContent("#question");
  assert.match(question, /of the robot:$|^At annotated person/, "a click on the plan asks there");
  assert.ok((await page.textContent("#why-0")).length > 0, "and is answered");
  await page.keyboard.press("Escape");
};

const checkPlaying = async (page) => {
  await scrub(page, 0);
  // Inside of the page, because a slow browser would come to the end before a second click.
  const name = await page.evaluate(() => new Promise((done) => {
    const [play, slider] = ["play", "frame"].map((id) => document.getElementById(id));
    play.click();
    const look = () => {
      if (Number(slider.value) < 1) return requestAnimationFrame(look);
      const name = play.getAttribute("aria-label");
      play.click();
      return done(name);
    };
    look();
  }));
  assert.equal(name, "Pause", "the button while the page plays");
  const stopped = await frameNow(page);
  await page.waitForTimeout(300);
  assert.equal(await frameNow(page), stopped, "the page goes on after a pause");
};

const checkLayers = async (page, data) => {
  const dropped = findDropped(data);
  if (!dropped) return;
  await scrub(page, dropped.at);
  const count = () => page.$$eval("#image-0 .box.dropped", (all) => all.length);
  const explained = () => page.$eval('#picture-0 [data-layer="dropped"]', (mark) => mark.checkVisibility());
  await page.uncheck("#show-dropped");
  assert.equal(await count(), 0, "dropped candidates are off");
  assert.equal(await explained(), false, "the legend explains what is not shown");
  await page.evaluate(() => document.activeElement.blur());
  await page.keyboard.press("d");
  assert.ok((await count()) > 0, "the key D shows dropped candidates");
  assert.equal(await explained(), true, "the legend explains dropped candidates");
};

// The legend of the plan explains the target where a controller has one.
const checkTarget = async (page, data) => {
  const drives = data.runs.some((run) => run.frames.some((frame) => frame && frame.drive));
  const explained = await page.$eval('.above [data-layer="target"]', (mark) => mark.checkVisibility());
  assert.equal(explained, drives, "the legend explains the target");
};

const visit = async (browser, { way, colorScheme, viewport }) => {
  const problems = [];
  const page = await openPage(browser, { colorScheme, viewport }, (asked) => asked === url, problems);
  await page.goto(url);
  const data = await readData(page);
  try {
    await checkKeys(page, data.t.length - 1);
    await checkScrubbing(page, data);
    await checkEvents(page, data);
    await checkTarget(page, data);
    if (data.image_px[0]) await checkLayers(page, data);
    if (data.image_px[0]) await checkQuestion(page, data);
    if (data.truth) await checkMissed(page, data);
    if (data.truth) await checkMissedEvents(page, data);
    await checkPlanClick(page);
    await checkPlaying(page);
  } catch (error) {
    problems.push(error.message);
  }
  problems.push(...(await violations(page)), ...(await layoutFaults(page)));
  if (pictures) await photograph(page, way, data);
  await page.context().close();
  return problems.map((problem) => `${way}: ${problem}`);
};

const photograph = async (page, way, data) => {
  mkdirSync(pictures, { recursive: true });
  await scrub(page, Math.floor(0.6 * data.t.length));
  await page.evaluate(() => scrollTo(0, 0));
  await page.screenshot({ path: path.join(pictures, `${name}-${way}.png`) });
  await page.screenshot({ path: path.join(pictures, `${name}-${way}-whole.png`), fullPage: true });
};

const main = async () => {
  const browser = await launch();
  const problems = [];
  for (const way of WAYS) problems.push(...(await visit(browser, way)));
  await browser.close();
  return problems;
};

conclude(`${name}: axe and visitor`, main);
