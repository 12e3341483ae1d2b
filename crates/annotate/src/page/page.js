"use strict";
// The page shows frames and asks for changes; the server makes them, saves them, and answers with the
// boxes of the people that changed.

// The colours of IDs are those of all pages.
const STYLE = getComputedStyle(document.documentElement);
const SVG = "http://www.w3.org/2000/svg";
const CLICK_PX = 4;
const VISIBLE = [1, 0.75, 0.5, 0.25, 0];
const byId = (id) => document.getElementById(id);

// People by number, each a map from frame to { box, key, ignore, visible, distance, proposed }.
const people = new Map();
let about = null;
let at = 0;
let chosen = null;
let playing = null;
let drag = null;
let able = { undo: false, redo: false, saved: false };
let queue = Promise.resolve();
let finished = false;
// The next click adds a person, also where a box of another one is.
let adding = false;

const frame = () => about.frames[at];
const colour = (id) => STYLE.getPropertyValue(`--t${((id % 20) + 20) % 20}`);
const rowOf = (id) => people.get(id)?.get(frame());
const here = () => [...people.keys()].filter((id) => rowOf(id)).sort((a, b) => a - b);

const svg = (name, attributes) => {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
};

// ---- what the server says ----

const take = (answer) => {
  for (const [id, rows] of Object.entries(answer.people)) {
    if (!rows) people.delete(Number(id));
    else {
      const read = ([number, box, key, ignore, visible, distance, proposed]) =>
        [number, { box, key: key === 1, ignore: ignore === 1, visible, distance, proposed: proposed === 1 }];
      people.set(Number(id), new Map(rows.map(read)));
    }
  }
  able = answer;
  if (answer.select) chosen = answer.select;
  show();
};

const tell = (problem) => {
  byId("problem").hidden = !problem;
  byId("problem").textContent = problem || "";
};

const post = async (path, data) => {
  const answer = await fetch(path, {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(data),
  });
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
};

// One after the other, in the order in which they were made.
const change = (data) => {
  if (finished) return queue;
  queue = queue.then(async () => {
    try {
      take(await post("change", data));
      tell("");
    } catch (error) {
      const gone = error instanceof TypeError;
      tell(gone ? "No answer: `tagalong annotate` has ended. All earlier changes are in the file." : error.message);
      show();
    }
  });
  return queue;
};

// The proposed boxes that nobody reviewed.
const unreviewed = () => {
  const frames = new Set();
  let boxes = 0;
  for (const rows of people.values()) {
    for (const [number, row] of rows) {
      if (!row.proposed) continue;
      frames.add(number);
      boxes += 1;
    }
  }
  return { boxes, frames: frames.size };
};

// ---- what is seen ----

const show = () => {
  byId("number").textContent = frame();
  byId("clock").textContent = `${about.t[at].toFixed(2)} s, ${at + 1} of ${about.frames.length}`;
  byId("frame").value = at;
  byId("frame").setAttribute("aria-valuetext", `frame ${frame()}`);
  byId("undo").disabled = !able.undo;
  byId("redo").disabled = !able.redo;
  byId("add").setAttribute("aria-pressed", String(adding));
  const open = unreviewed();
  byId("review").disabled = !here().some((id) => rowOf(id).proposed);
  byId("open").textContent = open.boxes ? `Not reviewed yet: ${open.boxes} proposed boxes in ${open.frames} frames.` : "";
  byId("saved").textContent = able.saved ? `All is saved in ${about.file}.` : `Not saved yet: ${about.file}`;
  showImage();
  showBoxes();
  showPeople();
  showStrips();
};

const showImage = () => {
  const image = byId("image");
  const source = `frame/${frame()}.jpg`;
  if (image.getAttribute("src") !== source) image.setAttribute("src", source);
  // The next ones are decoded while this one is looked at.
  for (const step of [1, 2]) if (at + step < about.frames.length) new Image().src = `frame/${about.frames[at + step]}.jpg`;
};

// Before the page has its layout, the image has no width.
const scale = () => {
  const { width } = byId("boxes").getBoundingClientRect();
  return width > 0 ? about.size[0] / width : 1;
};

const showBoxes = () => {
  const stage = byId("boxes");
  stage.replaceChildren();
  const unit = scale();
  const ids = here().filter((id) => id !== chosen);
  if (chosen !== null && rowOf(chosen)) ids.push(chosen);
  for (const id of ids) drawBox(stage, id, drag?.id === id && drag.box ? drag.box : rowOf(id).box, unit);
  if (drag && drag.id === null && drag.box) drawBox(stage, null, drag.box, unit);
};

const drawBox = (stage, id, box, unit) => {
  const row = id === null ? { key: true } : rowOf(id);
  const [x, y, width, height] = box;
  const name = id === null ? "new" : `${id}${row.ignore ? " ignored" : ""}${row.distance ? ` ${row.distance.toFixed(1)} m` : ""}`;
  const place = { x, y, width, height };
  stage.append(svg("rect", { ...place, class: "rim" }));
  const classes = ["box", row.key ? "key" : "between", id !== null && id === chosen ? "chosen" : ""].join(" ").trim();
  const rect = svg("rect", { ...place, class: classes, stroke: id === null ? "#fff" : colour(id) });
  if (id !== null) rect.dataset.id = id;
  stage.append(rect);
  const line = 20 * unit;
  const top = Math.max(0, y - line);
  const tagWidth = (8.2 * name.length + 10) * unit;
  const left = Math.min(Math.max(0, x), Math.max(0, about.size[0] - tagWidth));
  stage.append(svg("rect", { x: left, y: top, width: tagWidth, height: line, class: "tag" }));
  const text = svg("text", { class: "tag-text", transform: `translate(${left + 5 * unit} ${top + 15 * unit}) scale(${unit})` });
  text.textContent = name;
  stage.append(text);
  if (id === null || id !== chosen) return;
  const side = 12 * unit;
  for (const [corner, [cx, cy]] of Object.entries({ nw: [x, y], ne: [x + width, y], sw: [x, y + height], se: [x + width, y + height] })) {
    const grip = svg("rect", { x: cx - side / 2, y: cy - side / 2, width: side, height: side, class: corner === "ne" || corner === "sw" ? "grip across" : "grip" });
    grip.dataset.corner = corner;
    stage.append(grip);
  }
};

const showPeople = () => {
  const list = byId("people");
  const held = list.contains(document.activeElement) ? document.activeElement.dataset.id : null;
  list.replaceChildren();
  for (const id of here()) {
    const row = rowOf(id);
    const button = document.createElement("button");
    button.type = "button";
    button.dataset.id = id;
    button.style.setProperty("--c", colour(id));
    button.setAttribute("aria-pressed", String(id === chosen));
    const notes = [row.proposed ? "proposed" : row.key ? "set" : "interpolated", row.distance ? `${row.distance.toFixed(2)} m` : "no depth"];
    if (row.visible < 1) notes.push(`${100 * row.visible} % visible`);
    if (row.ignore) notes.push("ignored");
    button.textContent = `${id}: ${notes.join(", ")}`;
    button.addEventListener("click", () => choose(id));
    const item = document.createElement("li");
    item.append(button);
    list.append(item);
    if (held === String(id)) button.focus();
  }
  if (!list.children.length) list.append(Object.assign(document.createElement("li"), { textContent: "none", className: "soft" }));
  const row = chosen === null ? undefined : rowOf(chosen);
  byId("chosen").disabled = chosen === null || !people.has(chosen);
  byId("chosen-id").textContent = chosen === null ? "none" : chosen;
  for (const id of ["pin", "unpin", "ignore", "visible", "delete"]) byId(id).disabled = !row;
  if (document.activeElement !== byId("to")) byId("to").value = chosen ?? 1;
  byId("ignore").checked = Boolean(row?.ignore);
  byId("visible").value = String(VISIBLE.reduce((best, v) => (Math.abs(v - (row?.visible ?? 1)) < Math.abs(best - (row?.visible ?? 1)) ? v : best), 1));
  byId("hint").textContent = adding
    ? "The next click on a head adds a person, also inside the box of another one."
    : chosen === null
      ? "A click on a head adds a person; with Ctrl also inside the box of another one."
      : `A click on a head places person ${chosen}, with Shift also inside another box; Ctrl and a click adds another person.`;
};

const showStrips = () => {
  const strips = byId("strips");
  const ids = [...people.keys()].sort((a, b) => a - b);
  const old = [...strips.children].map((strip) => strip.dataset.id).join();
  if (old !== ids.join()) {
    strips.replaceChildren(...ids.map((id) => {
      const strip = document.createElement("div");
      strip.className = "strip";
      strip.dataset.id = id;
      const label = Object.assign(document.createElement("span"), { textContent: id });
      const canvas = document.createElement("canvas");
      canvas.setAttribute("role", "img");
      canvas.addEventListener("click", (event) => {
        const box = canvas.getBoundingClientRect();
        choose(id);
        go(Math.round(((event.clientX - box.left) / box.width) * (about.frames.length - 1)));
      });
      strip.append(label, canvas);
      return strip;
    }));
  }
  for (const strip of strips.children) drawStrip(Number(strip.dataset.id), strip.querySelector("canvas"));
};

const drawStrip = (id, canvas) => {
  const count = about.frames.length;
  const width = Math.max(1, Math.round(canvas.getBoundingClientRect().width));
  if (canvas.width !== width) canvas.width = width;
  canvas.height = 16;
  const rows = people.get(id);
  const keys = [...rows.values()].filter((row) => row.key).length;
  canvas.setAttribute("aria-label", `Person ${id}: in ${rows.size} frames, set by hand or proposed in ${keys}`);
  const paint = canvas.getContext("2d");
  const column = (index) => (count < 2 ? 0 : (index / (count - 1)) * (width - 3));
  paint.clearRect(0, 0, width, 16);
  about.frames.forEach((number, index) => {
    const row = rows.get(number);
    if (!row) return;
    paint.fillStyle = colour(id);
    paint.globalAlpha = row.ignore ? 0.35 : 0.75;
    paint.fillRect(column(index), 6, Math.max(2, width / count + 0.5), 6);
    paint.globalAlpha = 1;
    if (row.key) paint.fillRect(column(index), 1, 2, 14);
  });
  paint.fillStyle = getComputedStyle(document.body).color;
  paint.fillRect(column(at), 0, id === chosen ? 3 : 1, 16);
};

// ---- moves of the visitor ----

const go = (index) => {
  at = Math.min(Math.max(0, index), about.frames.length - 1);
  show();
};

const choose = (id) => {
  chosen = id;
  show();
};

const play = (on) => {
  clearInterval(playing);
  playing = on ? setInterval(() => (at + 1 < about.frames.length ? go(at + 1) : play(false)), 120) : null;
  byId("play").setAttribute("aria-pressed", String(on));
};

const onChosen = (make) => {
  if (chosen !== null && people.has(chosen)) change(make(chosen));
};
const pinHere = () => onChosen((id) => ({ op: "pin", frame: frame(), id }));
const unpinHere = () => onChosen((id) => ({ op: "unpin", frame: frame(), id }));
const fillHere = () => onChosen((id) => ({ op: "fill", frame: frame(), id }));
const remove = (scope) => onChosen((id) => ({ op: "delete", frame: frame(), id, scope }));
const note = (notes) => onChosen((id) => ({ op: "note", frame: frame(), id, ignore: null, visible: null, ...notes }));
const renumber = (to, scope) => onChosen((id) => ({ op: "number", frame: frame(), id, to, scope }));
const nextVisible = () => {
  const row = chosen === null ? undefined : rowOf(chosen);
  if (row) note({ visible: VISIBLE[(VISIBLE.indexOf(row.visible) + 1) % VISIBLE.length] });
};
const toggleIgnore = () => {
  const row = chosen === null ? undefined : rowOf(chosen);
  if (row) note({ ignore: !row.ignore });
};
const nextKey = (step) => {
  const rows = people.get(chosen);
  if (!rows) return;
  for (let index = at + step; index >= 0 && index < about.frames.length; index += step) {
    if (rows.get(about.frames[index])?.key) return go(index);
  }
};
const review = () => {
  if (here().some((id) => rowOf(id).proposed)) change({ op: "review", frame: frame() });
  go(at + 1);
};
const add = () => {
  adding = !adding;
  show();
};
const nextPerson = () => {
  const ids = here();
  if (ids.length) choose(ids[(ids.indexOf(chosen) + 1) % ids.length]);
};
const nudge = (dx, dy, grow) => {
  const row = chosen === null ? undefined : rowOf(chosen);
  if (!row) return;
  const [x, y, width, height] = row.box;
  change({ op: "box", frame: frame(), id: chosen, region: [x + dx - grow, y + dy - grow, width + 2 * grow, height + 2 * grow] });
};

const pixel = (event) => {
  const box = byId("boxes").getBoundingClientRect();
  return [(event.clientX - box.left) * (about.size[0] / box.width), (event.clientY - box.top) * (about.size[1] / box.height)];
};

const startDrag = (event) => {
  if (event.button !== 0 || finished) return;
  play(false);
  const from = pixel(event);
  const { corner, id } = event.target.dataset;
  const isNew = adding || event.ctrlKey || event.metaKey;
  // With a key the boxes under the pointer do not count: people stand behind each other.
  if (isNew || event.shiftKey) drag = { kind: "new", id: null, old: null, isNew };
  else if (corner) drag = { kind: "size", id: chosen, corner, old: rowOf(chosen).box };
  else if (id) {
    drag = { kind: "move", id: Number(id), old: rowOf(Number(id)).box };
    if (chosen !== drag.id) choose(drag.id);
  } else drag = { kind: "new", id: null, old: null, isNew };
  Object.assign(drag, { from, client: [event.clientX, event.clientY], box: null });
  byId("boxes").setPointerCapture(event.pointerId);
  event.preventDefault();
};

const isFar = (event) => Math.hypot(event.clientX - drag.client[0], event.clientY - drag.client[1]) >= CLICK_PX;

// The square with one corner here and the opposite one towards there.
const squareBetween = ([x0, y0], [x1, y1]) => {
  const side = Math.max(Math.abs(x1 - x0), Math.abs(y1 - y0), 4);
  return [x1 < x0 ? x0 - side : x0, y1 < y0 ? y0 - side : y0, side, side];
};

const moveDrag = (event) => {
  if (!drag || (!drag.box && !isFar(event))) return;
  const to = pixel(event);
  if (drag.kind === "move") {
    const [x, y, width, height] = drag.old;
    drag.box = [x + to[0] - drag.from[0], y + to[1] - drag.from[1], width, height];
  } else if (drag.kind === "size") {
    const [x, y, width, height] = drag.old;
    const fixed = [drag.corner.includes("w") ? x + width : x, drag.corner.includes("n") ? y + height : y];
    drag.box = squareBetween(fixed, to);
  } else drag.box = squareBetween(drag.from, to);
  showBoxes();
};

const endDrag = (event) => {
  if (!drag) return;
  const { kind, id, box, isNew } = drag;
  adding = false;
  const owner = isNew ? null : chosen;
  const number = frame();
  const tenth = (v) => Math.round(10 * v) / 10;
  if (kind === "new" && !box) {
    change({ op: "head", frame: number, id: owner, at: pixel(event) }).finally(() => show());
  } else if (box) {
    // A drawn box is that of the chosen person unless that one is in the frame already.
    const of = kind === "new" ? (owner !== null && !rowOf(owner) ? owner : null) : id;
    const row = of === null ? null : rowOf(of);
    if (row) row.box = box;
    change({ op: "box", frame: number, id: of, region: box.map(tenth) });
  }
  drag = null;
  showBoxes();
};

const KEYS = {
  ArrowLeft: (event) => go(at - (event.shiftKey ? 10 : 1)),
  ArrowRight: (event) => go(at + (event.shiftKey ? 10 : 1)),
  Home: () => go(0),
  End: () => go(about.frames.length - 1),
  " ": () => play(playing === null),
  Escape: () => { drag = null; adding = false; choose(null); },
  Delete: (event) => remove(event.shiftKey ? "after" : "frame"),
  Backspace: () => remove("frame"),
  "[": () => nextKey(-1),
  "]": () => nextKey(1),
  n: nextPerson, a: add, r: review, k: pinHere, u: unpinHere, f: fillHere, i: toggleIgnore, v: nextVisible,
};
const NUDGES = { ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, -1, 0], ArrowDown: [0, 1, 0], "+": [0, 0, 0.5], "=": [0, 0, 0.5], "-": [0, 0, -0.5] };

const onKey = (event) => {
  const target = event.target;
  const typing = target instanceof HTMLInputElement && target.type === "number" || target instanceof HTMLSelectElement;
  if (!about || typing || finished) return;
  const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  let act = null;
  const digit = /^(?:Digit|Numpad)([1-9])$/.exec(event.code);
  if (event.ctrlKey || event.metaKey) {
    if (name === "z") act = () => change({ op: event.shiftKey ? "redo" : "undo" });
    else if (name === "y") act = () => change({ op: "redo" });
  } else if (event.altKey) {
    if (NUDGES[event.key]) act = () => nudge(...NUDGES[event.key]);
  } else if (digit) act = () => renumber(Number(digit[1]), event.shiftKey ? "after" : "all");
  else if (KEYS[name] && !(name === " " && target instanceof HTMLButtonElement)) act = () => KEYS[name](event);
  if (!act) return;
  event.preventDefault();
  act();
};

const listen = () => {
  const buttons = {
    back: () => go(at - 1), ahead: () => go(at + 1), play: () => play(playing === null),
    undo: () => change({ op: "undo" }), redo: () => change({ op: "redo" }), add, review,
    pin: pinHere, unpin: unpinHere, fill: fillHere,
    delete: () => remove("frame"), "delete-after": () => remove("after"),
    "delete-before": () => remove("before"), "delete-all": () => remove("all"),
    renumber: () => renumber(Number(byId("to").value), "all"),
    "renumber-after": () => renumber(Number(byId("to").value), "after"),
  };
  for (const [id, act] of Object.entries(buttons)) byId(id).addEventListener("click", act);
  byId("frame").addEventListener("input", (event) => go(Number(event.target.value)));
  byId("ignore").addEventListener("change", (event) => note({ ignore: event.target.checked }));
  byId("visible").addEventListener("change", (event) => note({ visible: Number(event.target.value) }));
  byId("finish").addEventListener("click", async () => {
    await queue;
    try {
      await post("finish", {});
      finished = true;
      able.saved = true;
      show();
      // Nothing answers any more.
      play(false);
      document.querySelector("main").inert = true;
      byId("finish").disabled = true;
      byId("saved").textContent = `Finished: all is saved in ${about.file}. This page can be closed.`;
    } catch (error) {
      tell(error.message);
    }
  });
  const boxes = byId("boxes");
  boxes.addEventListener("pointerdown", startDrag);
  boxes.addEventListener("pointermove", moveDrag);
  boxes.addEventListener("pointerup", endDrag);
  boxes.addEventListener("pointercancel", () => { drag = null; showBoxes(); });
  document.addEventListener("keydown", onKey);
  window.addEventListener("resize", show);
  // Lines and letters keep their size on the screen, whenever the image gets its own.
  new ResizeObserver(showBoxes).observe(byId("boxes"));
};

const begin = async () => {
  const answer = await fetch("state");
  if (!answer.ok) throw new Error(await answer.text());
  const state = await answer.json();
  about = state.about;
  document.title = `Annotate ${about.log}`;
  byId("log").textContent = about.log;
  const origin = about.origin.charAt(0).toUpperCase() + about.origin.slice(1);
  byId("origin").textContent = `${origin}; ${about.depth ? "depth gives the positions" : "no depth, so boxes only"}.`;
  byId("frame").max = about.frames.length - 1;
  byId("stage").style.aspectRatio = `${about.size[0]} / ${about.size[1]}`;
  byId("stage").style.setProperty("--shape", about.size[0] / about.size[1]);
  const image = Object.assign(document.createElement("img"), { id: "image", alt: "Image of the frame", draggable: false });
  byId("stage").prepend(image);
  byId("boxes").setAttribute("viewBox", `0 0 ${about.size[0]} ${about.size[1]}`);
  listen();
  take(state.all);
};

begin().catch((error) => tell(`The page cannot begin: ${error.message}`));
