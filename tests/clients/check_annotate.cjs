"use strict";
// Called by check_annotate.sh: a visitor of the page that annotates, and reads the file back.
const assert = require("node:assert");
const { spawn } = require("node:child_process");
const { existsSync, mkdirSync, readFileSync } = require("node:fs");
const path = require("node:path");
const { WAYS, launch, openPage, violations, layoutFaults, conclude } = require("./pages.cjs");

const [program, log, file] = process.argv.slice(2);
const pictures = process.env.TAGALONG_PICTURES;

// Starts the program; resolves with its address once it listens.
const start = () => new Promise((done, failed) => {
  const child = spawn(program, ["annotate", log, "-o", file], { stdio: ["ignore", "pipe", "pipe"] });
  let [said, errors] = ["", ""];
  child.ended = new Promise((over) => child.on("exit", (code, signal) => over({ code, signal })));
  child.stderr.on("data", (data) => (errors += data));
  child.on("exit", () => failed(new Error(`the program ended: ${errors}`)));
  child.stdout.on("data", (data) => {
    said += data;
    const address = /http:\/\/127\.0\.0\.1:\d+\/[0-9a-f]{32}\//.exec(said);
    if (address) done({ child, url: address[0] });
  });
});

const readRows = () => {
  if (!existsSync(file)) return [];
  const [header, ...lines] = readFileSync(file, "utf8").trim().split("\n");
  const names = header.split(",");
  return lines.map((line) => Object.fromEntries(line.split(",").map((cell, i) => [names[i], i === 14 || i === 18 ? cell : Number(cell)])));
};
const rowsOf = (id) => readRows().filter((row) => row.id === id);
const rowAt = (id, frame) => rowsOf(id).find((row) => row.frame === frame);

const shownPeople = (page) => page.$$eval("#people button", (all) => all.map((button) => Number(button.dataset.id)));
const goTo = (page, index) => page.$eval("#frame", (slider, value) => {
  slider.value = value;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
}, index);
const frameNow = async (page) => Number(await page.textContent("#number"));

// Does something that changes the document, and waits until the server has answered.
const change = async (page, act) => {
  const answered = page.waitForResponse((response) => response.url().endsWith("/change"));
  await act();
  assert.equal((await answered).status(), 200, "the change is taken");
  await page.waitForTimeout(50);
  assert.equal(await page.isVisible("#problem"), false, await page.textContent("#problem"));
};
const press = (page, key) => change(page, async () => {
  await page.evaluate(() => document.activeElement.blur());
  await page.keyboard.press(key);
});

// The middle of a box in pixels of the screen, and pixels of the screen per pixel of the image.
const onScreen = async (page, id) => {
  const box = await page.locator(`#boxes [data-id="${id}"]`).boundingBox();
  const stage = await page.locator("#boxes").boundingBox();
  const width = await page.$eval("#boxes", (boxes) => boxes.viewBox.baseVal.width);
  return { x: box.x + box.width / 2, y: box.y + box.height / 2, box, stage, scale: stage.width / width };
};
const dragBy = (page, from, [dx, dy]) => change(page, async () => {
  await page.mouse.move(from[0], from[1]);
  await page.mouse.down();
  await page.mouse.move(from[0] + dx / 2, from[1] + dy / 2);
  await page.mouse.move(from[0] + dx, from[1] + dy);
  await page.mouse.up();
});
const isNear = (a, b, off, what) => assert.ok(Math.abs(a - b) <= off, `${what}: ${a} instead of ${b}`);

const findBusyFrame = async (page) => {
  const count = await page.$eval("#frame", (slider) => Number(slider.max));
  for (let index = Math.floor(count / 3); index < count; index += 1) {
    await goTo(page, index);
    if ((await shownPeople(page)).length > 0) return index;
  }
  throw new Error("no person is proposed");
};

const checkMoving = async (page) => {
  const frame = await frameNow(page);
  const [id] = await shownPeople(page);
  const { x, y, scale } = await onScreen(page, id);
  assert.equal(existsSync(file), false, "nothing is written before a change");
  await page.mouse.click(x, y);
  await dragBy(page, [x, y], [6, 4]);
  const first = rowAt(id, frame);
  assert.equal(first.key, 1, "a moved box is set by hand");
  await dragBy(page, [x + 6, y + 4], [40, 0]);
  const moved = rowAt(id, frame);
  isNear(moved.ub_x - first.ub_x, 40 / scale, 1.5, "the box is moved");
  isNear(moved.ub_w, first.ub_w, 0.2, "its size stays");
  const { box } = await onScreen(page, id);
  await dragBy(page, [box.x + box.width, box.y + box.height], [20, 20]);
  isNear(rowAt(id, frame).ub_w - moved.ub_w, 20 / scale, 3, "a corner resizes");
  for (const wanted of [moved, first]) {
    await press(page, "Control+z");
    isNear(rowAt(id, frame).ub_x, wanted.ub_x, 0.01, "undo, place");
    isNear(rowAt(id, frame).ub_w, wanted.ub_w, 0.01, "undo, size");
  }
  await press(page, "Control+y");
  isNear(rowAt(id, frame).ub_x, moved.ub_x, 0.01, "redo");
  await press(page, "Control+z");
};

// A new person is clicked in two frames, numbered, interpolated, and taken out of one frame.
const checkNewPerson = async (page, index) => {
  const stage = await page.locator("#boxes").boundingBox();
  const clickAt = (part) => change(page, () => page.mouse.click(stage.x + part * stage.width, stage.y + 0.12 * stage.height));
  const before = await shownPeople(page);
  await page.keyboard.press("Escape");
  await clickAt(0.1);
  const added = (await shownPeople(page)).filter((id) => !before.includes(id));
  assert.equal(added.length, 1, "a click with nobody chosen adds a person");
  await press(page, "9");
  assert.ok((await shownPeople(page)).includes(9) && rowsOf(added[0]).length === 0, "a digit is the number");
  await goTo(page, index + 8);
  const last = await frameNow(page);
  await clickAt(0.2);
  const rows = rowsOf(9);
  assert.equal(rows.length, 9, "the frames between are filled");
  assert.deepEqual(rows.map((row) => row.key), [1, 0, 0, 0, 0, 0, 0, 0, 1]);
  isNear(rows[4].ub_x, (rows[0].ub_x + rows[8].ub_x) / 2, 1.5, "the middle is half way");
  const withDepth = rows.filter((row) => row.head_z > 0).length;
  assert.ok(withDepth > 0, "depth gives the place");
  await goTo(page, index + 4);
  await press(page, "Delete");
  assert.equal(rowsOf(9).length, 8, "deleted in one frame");
  await press(page, "f");
  assert.equal(rowsOf(9).length, 9, "the pause is filled");
  await press(page, "k");
  assert.equal(rowAt(9, last - 4).key, 1, "set here");
  await press(page, "i");
  assert.equal(rowAt(9, last - 4).ignore, 1, "ignored");
  await press(page, "v");
  assert.equal(rowAt(9, last - 4).visible, 0.75, "visible");
  await press(page, "u");
  assert.equal(rowAt(9, last - 4).key, 0, "interpolated again");
  await page.click("#delete-after");
  await page.waitForTimeout(300);
  assert.equal(rowsOf(9).length, 4, "deleted from here on");
};

// A person behind another one gets a box inside the box of that one.
const checkBehind = async (page) => {
  const before = await shownPeople(page);
  const { x, y } = await onScreen(page, before[0]);
  await page.keyboard.down("Control");
  await change(page, () => page.mouse.click(x, y));
  await page.keyboard.up("Control");
  assert.equal((await shownPeople(page)).length, before.length + 1, "Ctrl and a click add a person in a box");
  await press(page, "Control+z");
  await page.click("#add");
  await change(page, () => page.mouse.click(x, y));
  assert.equal((await shownPeople(page)).length, before.length + 1, "the next click adds a person");
  await press(page, "Control+z");
};

// Proposed boxes are marked in the file until somebody says that they are right.
const checkReview = async (page) => {
  const frame = await frameNow(page);
  const open = () => readRows().filter((row) => row.frame === frame && row.proposed).length;
  assert.ok(open() > 0 && (await page.textContent("#open")).includes("Not reviewed yet"), "the boxes are proposed");
  await press(page, "r");
  assert.equal(open(), 0, "they are reviewed");
  assert.notEqual(await frameNow(page), frame, "the next frame is shown");
};

const checkKill = async (page, child) => {
  const before = readFileSync(file, "utf8");
  child.kill("SIGKILL");
  await child.ended;
  assert.equal(readFileSync(file, "utf8"), before, "the kill leaves the file whole");
  await page.click("#undo");
  await page.waitForSelector("#problem:not([hidden])");
  assert.ok((await page.textContent("#problem")).includes("has ended"));
};

const checkContinued = async (page, url, before) => {
  await page.goto(url);
  await page.waitForSelector("#number:not(:empty)");
  assert.ok((await page.textContent("#origin")).includes("is continued"));
  await page.click('#strips [data-id="9"] canvas', { position: { x: 1, y: 8 } });
  const row = rowsOf(9)[0];
  await goTo(page, await page.evaluate((frame) => about.frames.indexOf(frame), row.frame));
  assert.ok((await shownPeople(page)).includes(9), "the person is still there");
  await press(page, "i");
  await press(page, "i");
  assert.equal(readFileSync(file, "utf8"), before, "two changes that cancel each other leave the same bytes");
};

const judge = async (browser, url, ways) => {
  const problems = [];
  for (const { way, ...options } of ways) {
    const found = [];
    const page = await openPage(browser, options, (asked) => asked.startsWith(url), found);
    await page.goto(url);
    await page.waitForSelector("#number:not(:empty)");
    await findBusyFrame(page);
    await page.click("#people button");
    await page.evaluate(() => document.querySelectorAll("details").forEach((d) => (d.open = true)));
    found.push(...(await violations(page)), ...(await layoutFaults(page)));
    if (pictures) {
      mkdirSync(pictures, { recursive: true });
      await page.waitForTimeout(300);
      await page.screenshot({ path: path.join(pictures, `annotate-${way}.png`), fullPage: true });
    }
    await page.context().close();
    problems.push(...found.map((problem) => `${way}: ${problem}`));
  }
  return problems;
};

const main = async () => {
  const browser = await launch();
  const problems = [];
  const first = await start();
  const options = { colorScheme: "light", viewport: { width: 1360, height: 900 } };
  const own = (asked) => /^http:\/\/127\.0\.0\.1:\d+\/[0-9a-f]{32}\//.test(asked);
  const page = await openPage(browser, options, own, problems);
  await page.goto(first.url);
  await page.waitForSelector("#number:not(:empty)");
  const index = await findBusyFrame(page);
  await checkMoving(page);
  await checkBehind(page);
  await checkReview(page);
  await goTo(page, index);
  await checkNewPerson(page, index);
  assert.deepEqual(problems, [], `errors of the page: ${problems.join("; ")}`);
  await checkKill(page, first.child);
  problems.length = 0; // The connection that was refused is an error of the page.
  const before = readFileSync(file, "utf8");
  const second = await start();
  await checkContinued(page, second.url, before);
  problems.push(...(await judge(browser, second.url, WAYS)));
  await page.click("#finish");
  assert.deepEqual(await second.child.ended, { code: 0, signal: null }, "Finish ends the program");
  await browser.close();
  return problems;
};

conclude("annotate: axe and visitor", main);
