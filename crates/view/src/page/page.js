"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const SVG = "http://www.w3.org/2000/svg";
  const COLOURS = 20;
  let [WIDTH, HEIGHT] = data.image_px;
  let last = data.t.length - 1;
  const id = (name) => document.getElementById(name);

  // Elements are made from names and texts alone, so that no text is read as markup.
  const fill = (element, attributes, children) => {
    for (const [key, value] of Object.entries(attributes || {})) element.setAttribute(key, value);
    element.append(...children.filter((child) => child !== null));
    return element;
  };
  const el = (tag, attributes, ...children) =>
    fill(document.createElement(tag), attributes, children);
  const svg = (tag, attributes, ...children) =>
    fill(document.createElementNS(SVG, tag), attributes, children);
  const colour = (track) => `c${track % COLOURS}`;
  const fixed = (value, digits) => value.toFixed(digits).replace("-", "−");

  // The plan has the robot's first heading upwards, as the pictures of `run --overlay` have it: all
  // coordinates are turned once, when they come.
  let turn = null;
  const turned = ([x, y]) => [turn.cos * x - turn.sin * y, turn.sin * x + turn.cos * y];
  const startTurn = (heading) => {
    const angle = Math.PI / 2 - heading;
    turn = { angle, cos: Math.cos(angle), sin: Math.sin(angle) };
  };
  const turnFrame = (frame) => {
    if (!frame) return;
    if (!turn) startTurn(frame.robot[2]);
    frame.robot = [...turned(frame.robot), frame.robot[2] + turn.angle];
    for (const thing of [...frame.tracks, ...frame.found]) thing.at = turned(thing.at);
    for (const track of frame.tracks) track.v = turned(track.v);
    // In a frozen image people are where they were, and none of them is seen.
    for (const track of frame.tracks) if (frame.stale && track.state !== "tentative") track.state = "stale";
    if (frame.drive) [frame.drive.things, frame.drive.movers].forEach(turnScan);
  };
  const turnScan = (scan) => {
    if (!turn) startTurn(0);
    for (let i = 0; scan && i < scan.length; i += 2) [scan[i], scan[i + 1]] = turned([scan[i], scan[i + 1]]);
  };
  const turnAll = () => {
    for (const run of data.runs) run.frames.forEach(turnFrame);
    for (const scan of data.scans || []) turnScan(scan);
    for (const people of data.truth || []) for (const person of people) if (person.at) {
      if (!turn) startTurn(0);
      person.at = turned(person.at);
    }
  };
  turnAll();

  const state = { at: 0, playing: false, question: null, from: 0, since: 0 };

  // A run that has no frame at a time shows the one before, if that is not long ago.
  const STALE_S = 0.25;
  const frameOf = (run, at) => {
    for (let i = at; i >= 0 && data.t[at] - data.t[i] <= STALE_S; i -= 1) {
      if (run.frames[i]) return run.frames[i];
    }
    return null;
  };
  const imageAt = (at) => {
    for (let i = at; data.images && i >= 0; i -= 1) if (data.images[i]) return data.images[i];
    return null;
  };
  const truthAt = (at) => (data.truth && data.truth[at]) || [];
  const isMissed = (run, at, person) =>
    Boolean(run.hits && run.hits[at] && run.hits[at][person] === null);

  // ---- image -----------------------------------------------------------------------------------

  // Units of a picture for one pixel of the screen: lines and letters keep their size.
  const unitsPerPixel = (element, width, height) => {
    const area = element.getBoundingClientRect();
    return area.width > 0 ? Math.max(width / area.width, height / area.height) : 1;
  };

  const overlaps = (a, b) =>
    a.x < b.x + b.w && b.x < a.x + a.w && a.y < b.y + b.h && b.y < a.y + a.h;

  // Labels take the first free place above, below or inside their box.
  const placeLabel = (taken, [x, y, w, h], width, height) => {
    const inside = (v, room) => Math.max(0, Math.min(v, room));
    const rows = [y - height, y + h, y, y - 2 * height, y + h + height, y + height];
    const places = rows.map((row) => ({
      x: inside(x, WIDTH - width), y: inside(row, HEIGHT - height), w: width, h: height,
    }));
    const free = places.find((place) => !taken.some((other) => overlaps(place, other)));
    const place = free || places[0];
    taken.push(place);
    return place;
  };

  const rect = ([x, y, w, h], attributes) => svg("rect", { x, y, width: w, height: h, ...attributes });

  const outline = (box, kind, k, width, hint) =>
    svg("g", {},
      svg("title", {}, hint),
      rect(box, { class: "halo", "stroke-width": (width + 2) * k }),
      rect(box, { class: `box ${kind}`, "stroke-width": width * k,
        "stroke-dasharray": kind.includes("guess") ? `${6 * k} ${4 * k}`
          : kind.includes("truth") ? `${8 * k} ${3 * k}` : kind.includes("tentative") ? `${2 * k} ${3 * k}` : "none" }));

  const label = (taken, box, text, k) => {
    const size = 13 * k;
    const place = placeLabel(taken, box, (text.length * 0.62 + 0.7) * size, 1.35 * size);
    return svg("g", { class: "label" },
      rect([place.x, place.y, place.w, place.h], { class: "tag", rx: 3 * k }),
      svg("text", { class: "tag-text", x: place.x + 0.35 * size, y: place.y + size, "font-size": size }, text));
  };

  const shownBox = (track) => track.whole || track.box;
  const STATES = { seen: "", hidden: " predicted", predicted: " predicted", tentative: " ?", stale: " stale" };
  // The same in full.
  const stateOf = (track) => (track.state === "hidden" ? "predicted, hidden by another person"
    : track.state === "tentative" ? "not confirmed yet"
      : track.state === "stale" ? "stale, of a frozen image" : track.state);
  // Neither has the colour of a person in sight.
  const isGrey = (track) => track.state === "tentative" || track.state === "stale";
  // The distance from the middle of the robot, with `~` before one that is a guess.
  const away = (track, digits) => `${track.guess ? "~" : ""}${fixed(track.d, digits)} m`;
  const trackKind = (track) =>
    track.state === "seen" ? colour(track.id)
      : isGrey(track) ? track.state : `${colour(track.id)} guess`;

  const trailLine = (track, k) => {
    if (track.state !== "seen" || !track.trail || track.trail.length < 4) return null;
    const points = [];
    for (let i = 0; i < track.trail.length; i += 2) points.push(`${track.trail[i]},${track.trail[i + 1]}`);
    return svg("polyline", { class: `trail ${colour(track.id)}`, points: points.join(" "), "stroke-width": 2 * k });
  };

  const droppedMarks = (frame, k) => [
    ...frame.dropped.flatMap((test) => (test.boxes || []).map((box) => outline(box, "dropped", k, 1, test.test))),
    ...frame.found.filter((c) => c.test).map((c) => outline(c.box, "dropped", k, 1.5, `${c.test} (${c.by})`)),
  ];

  const truthMarks = (run, k) => truthAt(state.at).filter((person) => person.box).map((person) => {
    const missed = isMissed(run, state.at, person.id);
    const kind = missed ? "truth miss" : "truth";
    return outline(person.box, kind, k, missed ? 2.5 : 1, `annotated person ${person.id}${missed ? ", missed" : ""}`);
  });

  // An annotated person in question keeps the marks of the legend, in wider lines.
  const askedMark = (run, { box, person }, k) => {
    if (person === undefined) return outline(box, "asked", k, 2, "the place in question");
    const kind = isMissed(run, state.at, person) ? "truth miss" : "truth";
    return outline(box, kind, k, 4, `annotated person ${person}, in question`);
  };

  const drawImage = (run, number) => {
    const target = id(`image-${number}`);
    if (!WIDTH) return;
    const k = unitsPerPixel(target, WIDTH, HEIGHT);
    const frame = frameOf(run, state.at);
    const picture = imageAt(state.at);
    const parts = [picture
      ? svg("image", { href: `data:image/jpeg;base64,${picture}`, width: WIDTH, height: HEIGHT, preserveAspectRatio: "none" })
      : rect([0, 0, WIDTH, HEIGHT], { class: "blank" })];
    if (id("show-truth").checked) parts.push(...truthMarks(run, k));
    if (frame) {
      if (id("show-dropped").checked) parts.push(...droppedMarks(frame, k));
      const far = [...frame.tracks].reverse();
      if (id("show-trails").checked) parts.push(...far.map((track) => trailLine(track, k)));
      for (const track of far) {
        const node = outline(shownBox(track), trackKind(track), k, track.state === "seen" ? 2.5 : 1.5, describe(track));
        node.dataset.track = track.id;
        parts.push(node);
      }
    }
    // Below the labels, so that it hides none.
    if (state.question && state.question.box) parts.push(askedMark(run, state.question, k));
    if (frame) {
      const taken = [];
      for (const track of frame.tracks) {
        const sign = frame.target === track.id ? "◎" : "";
        parts.push(label(taken, shownBox(track), `${sign}${track.id}${STATES[track.state]} · ${away(track, 1)}`, k));
      }
    }
    // A picture of its own cuts off what lies outside of the image.
    target.replaceChildren(svg("svg", { x: 0, y: 0, width: WIDTH, height: HEIGHT }, ...parts.filter(Boolean)));
  };

  const describe = (track) =>
    `track ${track.id}, ${stateOf(track)}, ${away(track, 1)} from the middle of the robot, ${fixed(Math.hypot(...track.v), 1)} m/s`;

  // ---- plan ------------------------------------------------------------------------------------

  // Follows the robot where the whole way would be too small to see.
  const WHOLE_M = 24;
  const ASPECT = 4 / 3;

  const extent = () => {
    const xs = [];
    const ys = [];
    for (const run of data.runs) for (const frame of run.frames) if (frame) {
      xs.push(frame.robot[0]);
      ys.push(frame.robot[1]);
      for (const track of frame.tracks) if (track.state === "seen" && track.d < 15) {
        xs.push(track.at[0]);
        ys.push(track.at[1]);
      }
    }
    for (const people of data.truth || []) for (const person of people) if (person.at) {
      xs.push(person.at[0]);
      ys.push(person.at[1]);
    }
    const ends = (values) => {
      values.sort((a, b) => a - b);
      return [values[0] ?? 0, values[values.length - 1] ?? 0];
    };
    const [[left, right], [low, high]] = [ends(xs), ends(ys)];
    return { x: (left + right) / 2, y: (low + high) / 2, w: right - left + 2, h: high - low + 2 };
  };
  let whole = extent();
  const windowAt = (frame) => {
    const fits = Math.max(whole.w, whole.h) <= WHOLE_M;
    const centre = fits || !frame ? [whole.x, whole.y] : frame.robot;
    const height = fits ? Math.max(whole.h, whole.w / ASPECT, 5) : 14;
    return { x: centre[0], y: centre[1], w: height * ASPECT, h: height };
  };

  // The part of the plan that is seen: the picture may be wider or higher than its window.
  const visible = (element, area) => {
    const { width, height } = element.getBoundingClientRect();
    const aspect = height > 0 ? width / height : ASPECT;
    return { ...area, w: Math.max(area.w, area.h * aspect), h: Math.max(area.h, area.w / aspect) };
  };

  const gridLines = (area, k) => {
    const step = area.h > 16 ? 2 : 1;
    const parts = [];
    const line = (x1, y1, x2, y2) => parts.push(svg("line", { class: "grid", x1, y1, x2, y2, "stroke-width": k }));
    const from = (v) => Math.ceil(v / step) * step;
    for (let x = from(area.x - area.w / 2); x < area.x + area.w / 2; x += step) line(x, -area.y - area.h / 2, x, -area.y + area.h / 2);
    for (let y = from(area.y - area.h / 2); y < area.y + area.h / 2; y += step) line(area.x - area.w / 2, -y, area.x + area.w / 2, -y);
    const corner = { x: area.x - area.w / 2 + 8 * k, y: -area.y + area.h / 2 - 8 * k };
    parts.push(svg("text", { class: "axis-text", ...corner, "font-size": 12 * k }, `grid ${step} m, up: the robot's first heading`));
    return parts;
  };

  const robotMark = (frame, k) => {
    const [x, y, heading] = frame.robot;
    const parts = [];
    if (data.view_rad) {
      const reach = 40;
      const end = (angle) => `${x + reach * Math.cos(heading + angle)},${-y - reach * Math.sin(heading + angle)}`;
      parts.push(svg("polygon", { class: "view", points: `${x},${-y} ${data.view_rad.map(end).join(" ")}` }));
    }
    const tip = (angle, far) => `${x + far * Math.cos(heading + angle)},${-y - far * Math.sin(heading + angle)}`;
    const r = 11 * k;
    parts.push(svg("polygon", { class: "robot", points: `${tip(0, r)} ${tip(2.5, r)} ${tip(-2.5, r)}` }, svg("title", {}, "robot")));
    return parts;
  };

  // Zones of the config around the robot, each as the outline with an edge that is as wide as the zone
  // reaches, and the way on which the robot comes to stand.
  const zoneMarks = (run, frame) => {
    const robot = run.robot;
    if (!robot || !frame.drive) return [];
    const [x, y, heading] = frame.robot;
    const [cos, sin] = [Math.cos(heading), Math.sin(heading)];
    const placed = (corners) => corners.map(([a, b]) => `${x + cos * a - sin * b},${-(y + sin * a + cos * b)}`).join(" ");
    const around = (kind, reach, hint) => svg("polygon", { class: `zone ${kind}`, points: placed(robot.footprint), "stroke-width": 2 * reach }, svg("title", {}, hint));
    const polygon = (kind, corners, hint) => (corners.length ? svg("polygon", { class: `zone ${kind}`, points: placed(corners) }, svg("title", {}, hint)) : null);
    const [stands, slower] = robot.people || [robot.things, 0];
    return [
      slower ? around("slower", slower, `a person who comes nearer than ${fixed(slower, 1)} m slows the robot at full speed`) : null,
      polygon("slower", robot.slowdown, "slowdown polygon"),
      around("stands", stands, `${slower ? "a person who comes" : "an obstacle"} nearer than ${fixed(stands, 1)} m stops the robot`),
      polygon("stands", robot.stop, "stop polygon"),
      wayAhead(robot, frame),
      svg("polygon", { class: "footprint", points: placed(robot.footprint) }),
    ];
  };

  const WAY_STEPS = 16;
  const wayAhead = (robot, frame) => {
    const { v, w } = frame.drive;
    if (Math.abs(v) < 0.02) return null;
    const sides = robot.footprint.map((corner) => corner[1]);
    const length = Math.abs(v) * robot.reaction + (v * v) / (2 * robot.decel) + Math.max(...robot.footprint.map((corner) => corner[0]));
    let [x, y, heading] = frame.robot;
    const points = [`${x},${-y}`];
    const step = (Math.sign(v) * length) / WAY_STEPS;
    for (let i = 0; i < WAY_STEPS; i += 1) {
      heading += (w / v) * step;
      x += step * Math.cos(heading);
      y += step * Math.sin(heading);
      points.push(`${x},${-y}`);
    }
    return svg("polyline", { class: "way", points: points.join(" "), "stroke-width": Math.max(...sides) - Math.min(...sides) }, svg("title", {}, "path until the robot stops"));
  };

  // Many points as one line of dots.
  const dots = (points, kind, k) => {
    if (!points || !points.length) return null;
    let d = "";
    for (let i = 0; i < points.length; i += 2) d += `M${points[i] / 100} ${-points[i + 1] / 100}h0`;
    return svg("path", { class: `dots ${kind}`, d, "stroke-width": Math.max(0.1, 2.5 * k) });
  };

  const obstacleMarks = (frame, k) => (frame.drive
    ? [dots(frame.drive.things, "things", k), dots(frame.drive.movers, "movers", k)] : []);

  const targetLine = (frame, k) => {
    const track = frame.tracks.find((other) => other.id === frame.target);
    if (!track || track.state === "stale") return null;
    return svg("line", { class: `target ${colour(track.id)}`, x1: frame.robot[0], y1: -frame.robot[1], x2: track.at[0], y2: -track.at[1], "stroke-width": 1.5 * k, "stroke-dasharray": `${4 * k} ${4 * k}` });
  };

  const wayOf = (run, k) => {
    const points = [];
    for (let i = 0; i <= state.at; i += 1) {
      const frame = run.frames[i];
      if (frame) points.push(`${frame.robot[0]},${-frame.robot[1]}`);
    }
    return svg("polyline", { class: "path", points: points.join(" "), "stroke-width": 1.5 * k });
  };

  const TRAIL_S = 2;
  const planTrail = (run, track, k) => {
    if (track.state !== "seen") return null;
    const points = [];
    let from = state.at;
    while (from > 0 && data.t[state.at] - data.t[from - 1] <= TRAIL_S) from -= 1;
    for (let i = from; i <= state.at; i += 1) {
      const past = run.frames[i] && run.frames[i].tracks.find((other) => other.id === track.id);
      if (past && past.state === "seen") points.push(`${past.at[0]},${-past.at[1]}`);
    }
    return svg("polyline", { class: `trail ${colour(track.id)}`, points: points.join(" "), "stroke-width": 2 * k });
  };

  const personMark = (run, track, k) => {
    const [x, y] = [track.at[0], -track.at[1]];
    const r = Math.min(Math.max(0.2, 5 * k), 9 * k);
    const kind = isGrey(track) ? track.state
      : `${colour(track.id)}${track.state === "seen" ? "" : " guess"}`;
    const ahead = { x1: x, y1: y, x2: x + track.v[0], y2: y - track.v[1] };
    return svg("g", { "data-track": track.id },
      svg("title", {}, describe(track)),
      id("show-trails").checked && !isGrey(track) ? planTrail(run, track, k) : null,
      isGrey(track) ? null : svg("line", { class: `speed ${colour(track.id)}`, ...ahead, "stroke-width": 2.5 * k }),
      svg("circle", { class: `person ${kind}`, cx: x, cy: y, r, "stroke-width": 2 * k }));
  };

  // IDs at the first free place around their circle, or farther out with a line to it: of two people at one
  // place both can be read.
  const planIds = (tracks, k) => {
    const size = 13 * k;
    const taken = [];
    return tracks.map((track) => {
      const [x, y] = [track.at[0], -track.at[1]];
      const text = String(track.id);
      const [w, h] = [0.62 * size * text.length, 0.8 * size];
      const r = Math.min(Math.max(0.2, 5 * k), 9 * k);
      const placeAt = (far) => {
        const [right, left] = [x + 0.8 * r + 3 * k + far, x - 0.8 * r - 3 * k - far - w];
        const [above, below] = [y - 0.8 * r - h - far, y + 0.8 * r + far];
        return [[right, above], [right, below], [left, above], [left, below]];
      };
      const places = [0, 1.2 * size, 2.4 * size, 3.6 * size]
        .flatMap((far) => placeAt(far).map(([px, py]) => ({ x: px, y: py, w, h, far })));
      const place = places.find((other) => !taken.some((known) => overlaps(known, other))) || places[0];
      taken.push(place);
      const middle = { x2: place.x + w / 2, y2: place.y + h / 2 };
      return svg("g", {},
        place.far ? svg("line", { class: `lead ${colour(track.id)}`, x1: x, y1: y, ...middle, "stroke-width": k }) : null,
        svg("text", { class: "plan-text", x: place.x, y: place.y + h, "font-size": size, "stroke-width": 3 * k }, text));
    });
  };

  const truthSpots = (run, k) => truthAt(state.at).filter((person) => person.at).map((person) => {
    const r = 9 * k;
    const missed = isMissed(run, state.at, person.id);
    return rect([person.at[0] - r, -person.at[1] - r, 2 * r, 2 * r],
      { class: `truth-spot${missed ? " miss" : ""}`, "stroke-width": (missed ? 2.5 : 1.5) * k });
  });

  const drawPlan = (run, number) => {
    const target = id(`plan-${number}`);
    const frame = frameOf(run, state.at);
    const area = windowAt(frame);
    target.setAttribute("viewBox", `${area.x - area.w / 2} ${-area.y - area.h / 2} ${area.w} ${area.h}`);
    const k = unitsPerPixel(target, area.w, area.h);
    const parts = gridLines(visible(target, area), k);
    const scan = data.scans && data.scans[state.at];
    for (let i = 0; scan && i < scan.length; i += 2) {
      parts.push(svg("circle", { class: "scan", cx: scan[i] / 100, cy: -scan[i + 1] / 100, r: 1.6 * k }));
    }
    if (frame) parts.push(...zoneMarks(run, frame), ...obstacleMarks(frame, k));
    parts.push(wayOf(run, k));
    if (frame) {
      parts.push(targetLine(frame, k), ...robotMark(frame, k));
      if (id("show-truth").checked) parts.push(...truthSpots(run, k));
      if (id("show-dropped").checked) {
        for (const c of frame.found.filter((candidate) => candidate.test)) {
          const [x, y, r] = [c.at[0], -c.at[1], 4 * k];
          parts.push(svg("path", { class: "cross", d: `M${x - r} ${y - r}L${x + r} ${y + r}M${x - r} ${y + r}L${x + r} ${y - r}`, "stroke-width": 1.5 * k }, svg("title", {}, c.test)));
        }
      }
      parts.push(...[...frame.tracks].reverse().map((track) => personMark(run, track, k)));
      parts.push(...planIds(frame.tracks, k));
    }
    if (state.question && state.question.at) {
      const [x, y] = state.question.at;
      parts.push(svg("circle", { class: "asked-spot", cx: x, cy: -y, r: 15 * k, "stroke-width": 2 * k }));
    }
    target.replaceChildren(...parts.filter(Boolean));
  };

  // ---- legends ---------------------------------------------------------------------------------

  // A layer that is off has no marks to explain.
  const drawLegends = () => {
    const isOn = { truth: data.truth && id("show-truth").checked, dropped: id("show-dropped").checked,
      scan: (data.scans || []).some(Boolean), target: !id("drive").hidden };
    for (const mark of document.querySelectorAll("[data-layer]")) mark.hidden = !isOn[mark.dataset.layer];
  };

  // Without zones for people things alone stop the robot.
  const fitZones = (run, number) => {
    const zones = id(`zones-${number}`);
    zones.hidden = !run.robot;
    const shown = run.robot && run.robot.people ? "people" : "things";
    for (const mark of zones.querySelectorAll("[data-zone]")) mark.hidden = mark.dataset.zone !== shown;
  };

  // ---- time line -------------------------------------------------------------------------------

  // Lanes: each track in the first one that is free again.
  const lanesOf = (run) => {
    const lives = new Map();
    run.frames.forEach((frame, at) => frame && frame.tracks.forEach((track) => {
      if (track.state === "tentative") return;
      if (!lives.has(track.id)) lives.set(track.id, []);
      lives.get(track.id).push([at, track.state === "seen"]);
    }));
    const ends = [];
    return [...lives].map(([track, points]) => {
      const start = points[0][0];
      let lane = ends.findIndex((end) => end < start);
      if (lane < 0) lane = ends.length;
      ends[lane] = points[points.length - 1][0];
      return { track, points, lane };
    });
  };

  // Widths of the strips, px: letters are not stretched.
  const widths = data.runs.map(() => 1000);
  const column = (at, number) => (last > 0 ? (at / last) * widths[number] : 0);

  const stretches = (points) => {
    const out = [];
    for (const [at, seen] of points) {
      const open = out[out.length - 1];
      if (open && open.to >= at - 2 && open.seen === seen) open.to = at;
      else out.push({ from: at, to: at, seen });
    }
    return out;
  };

  // Times of one reason of the command; a frame that is left out continues the one before.
  const motionsOf = (run) => {
    const out = [];
    run.frames.forEach((frame, at) => {
      const drive = frame && frame.drive;
      if (!drive || !drive.motion) return;
      const open = out[out.length - 1];
      if (open && open.text === drive.reason[1]) open.to = at + 1;
      else out.push({ from: at, to: at + 1, motion: drive.motion, text: drive.reason[1] });
    });
    return out;
  };

  // Pixels: the row of one person, and the bar of the command above them.
  const ROW = 13;
  const LEAST_ROW = 4;
  const LETTERS_ROW = 7;
  const COMMAND = 8;

  const lifeMarks = (life, number, y, row) => {
    const parts = stretches(life.points).map((part) =>
      svg("line", { class: `life ${colour(life.track)}${part.seen ? "" : " weak"}`, x1: column(part.from, number), x2: Math.max(column(part.to, number), column(part.from, number) + 1.5), y1: y, y2: y, "stroke-width": row - 3 },
        svg("title", {}, `track ${life.track}`)));
    if (row < LETTERS_ROW) return parts;
    const x = Math.min(column(life.points[0][0], number) + 3, widths[number] - 14);
    parts.push(svg("text", { class: "strip-id", x, y: y + 0.33 * row, "font-size": Math.max(9, row - 2), "stroke-width": 2.5 }, String(life.track)));
    return parts;
  };

  const drawStrip = (run, number) => {
    const target = id(`strip-${number}`);
    widths[number] = target.getBoundingClientRect().width || widths[number];
    const lives = lanesOf(run);
    const rows = Math.max(1, ...lives.map((life) => life.lane + 1));
    const motions = motionsOf(run);
    const top = motions.length ? COMMAND + 2 : 0;
    const isSmall = innerHeight < 800 || innerWidth < 740;
    const room = (isSmall ? 56 : 100) * (data.runs.length > 1 ? 0.72 : 1);
    const row = Math.max(LEAST_ROW, Math.min(ROW, (room - top) / rows));
    const height = top + row * rows + 5;
    target.setAttribute("viewBox", `0 0 ${widths[number]} ${height}`);
    target.style.height = `${height}px`;
    const parts = motions.map((part) =>
      rect([column(part.from, number), 0, Math.max(1, column(part.to, number) - column(part.from, number)), COMMAND], { class: `motion ${part.motion}` }));
    parts.forEach((part, at) => part.append(svg("title", {}, motions[at].text)));
    parts.push(...lives.flatMap((life) => lifeMarks(life, number, top + row * (life.lane + 0.5), row)));
    for (const event of run.events) if (event.kind === "missed" || event.kind === "fault") {
      const x = column(event.i, number);
      const isFault = event.kind === "fault";
      const mark = svg("line", { class: isFault ? "fault" : "gap", x1: x, x2: x, y1: isFault ? 0 : height - 5, y2: height, "stroke-width": 2 });
      if (isFault) mark.append(svg("title", {}, event.text));
      parts.push(mark);
    }
    parts.push(svg("line", { class: "head", "stroke-width": 1.5, y1: 0, y2: height }));
    target.replaceChildren(...parts);
  };

  const moveHeads = () => data.runs.forEach((run, number) => {
    const head = id(`strip-${number}`).querySelector(".head");
    head.setAttribute("x1", column(state.at, number));
    head.setAttribute("x2", column(state.at, number));
  });

  // ---- tables ----------------------------------------------------------------------------------

  const NUMBERS = ["From the robot's middle", "Speed", "Probability", "Number"];
  const table = (caption, heads, rows) =>
    el("div", { class: "scroll", role: "region", "aria-label": caption, tabindex: "0" }, el("table", {},
      el("thead", {}, el("tr", {}, ...heads.map((head) => el("th", { scope: "col", class: NUMBERS.includes(head) ? "number" : "" }, head)))),
      el("tbody", {}, ...rows)));

  const number = (text) => el("td", { class: "number" }, text);

  const people = (run, place) => {
    const frame = frameOf(run, state.at);
    const tracks = frame ? frame.tracks : [];
    if (!tracks.length) return place.replaceChildren(el("p", { class: "soft" }, "No person is tracked."));
    const row = (track) => el("tr", {},
      el("th", { scope: "row" }, el("span", { class: `swatch ${colour(track.id)}` }), String(track.id)),
      el("td", {}, stateOf(track)), number(away(track, 2)), number(`${fixed(Math.hypot(...track.v), 2)} m/s`), number(fixed(track.p, 2)));
    return place.replaceChildren(table(`People of ${run.name}`, ["Track", "State", "From the robot's middle", "Speed", "Probability"], tracks.map(row)));
  };

  const settings = (run, test) => {
    const of = run.tests[test];
    return el("td", {}, ...(of ? of.settings : []).map((line) => el("code", {}, line)));
  };

  const funnel = (run, place) => {
    const frame = frameOf(run, state.at);
    if (!frame) return place.replaceChildren(el("p", { class: "soft" }, "The run has no frame here."));
    const used = frame.found.filter((candidate) => !candidate.test);
    const started = used.filter((candidate) => candidate.starts).length;
    const most = Math.max(1, ...frame.dropped.map((test) => test.n));
    const row = (test) => el("tr", {},
      el("th", { scope: "row" }, test.test), number(String(test.n)), el("td", {}, bar(test.n / most)));
    return place.replaceChildren(
      el("p", {}, `${frame.found.length} ${frame.found.length === 1 ? "candidate" : "candidates"} of the detectors: ${used.length - started} given to tracks, ${started} started tracks, ${frame.found.length - used.length} dropped. The tests of the detectors drop places before they become candidates; the table counts these, too.`),
      frame.dropped.length ? table(`Funnel of ${run.name}`, ["Dropped by", "Number", "As a bar (square root)"], frame.dropped.map(row)) : el("p", { class: "soft" }, "No test dropped anything."));
  };

  const bar = (part) => {
    const node = el("span", { class: "bar" });
    node.style.width = `${(8 * Math.sqrt(part)).toFixed(2)}rem`;
    return node;
  };

  // Turn rates below this are shown as straight, rad/s: they would print as zero.
  const STRAIGHT = 0.005;
  const turnOf = (rate) => Math.abs(rate) < STRAIGHT
    ? "does not turn"
    : `turns ${rate < 0 ? "right" : "left"} by ${fixed(Math.abs(rate), 2)} rad/s`;

  // The state of the target lock and the reason of the command, each with its meaning.
  const drive = (run, place) => {
    const frame = frameOf(run, state.at);
    const now = frame && frame.drive;
    if (!now) return place.replaceChildren(el("p", { class: "soft" }, "The run has no controller: it follows no person."));
    const target = frame.target === undefined || frame.target === null ? "nobody" : `track ${frame.target}`;
    const sure = now.belief === null ? "" : `, the same person with probability ${fixed(now.belief, 2)}`;
    const row = (name, sign, text) => el("tr", {}, el("th", { scope: "row" }, name), el("td", {}, el("strong", {}, sign)), el("td", {}, text));
    return place.replaceChildren(table(`Target and command of ${run.name}`, ["Part", "State", "Meaning"], [
      row("Target", target, `${now.lock[1]}${sure}`),
      row("Lock", now.lock[0], `for ${fixed(now.since, 1)} s: ${now.why}`),
      row("Command", now.reason[0], now.cause ? `${now.reason[1]}: ${now.cause}` : now.reason[1]),
      row("Speed", `${fixed(now.v, 2)} m/s`, turnOf(now.w)),
    ]));
  };

  // ---- why was a person missed? ------------------------------------------------------------------

  const AROUND = 7;
  const isNear = (box, question) => {
    const [x, y, w, h] = box;
    const [qx, qy, qw, qh] = question.box;
    const [dx, dy] = [x + w / 2 - qx - qw / 2, y + h / 2 - qy - qh / 2];
    const reach = 0.5 * Math.max(w, h) + 0.5 * Math.max(qw, qh);
    return Math.hypot(dx, dy) <= Math.max(reach * 0.75, 0.03 * WIDTH);
  };

  // Without a box places on the floor are compared.
  const NEAR_M = 0.75;
  const isAt = (thing, question) => (question.box ? isNear(thing.box, question)
    : Math.hypot(thing.at[0] - question.at[0], thing.at[1] - question.at[1]) <= NEAR_M);
  const hasPlace = (person) => Boolean(person.box || person.at);

  // Near for a candidate, by the rule that finds the cause: its centre is in the box, or both have a tenth
  // of the smaller one in common.
  const LEAST_SHARE = 0.1;
  const touches = ([x, y, w, h], { box: [qx, qy, qw, qh] }) => {
    const [cx, cy] = [x + w / 2, y + h / 2];
    if (qx <= cx && cx <= qx + qw && qy <= cy && cy <= qy + qh) return true;
    const across = Math.min(x + w, qx + qw) - Math.max(x, qx);
    const down = Math.min(y + h, qy + qh) - Math.max(y, qy);
    return across > 0 && down > 0 && across * down >= LEAST_SHARE * Math.min(w * h, qw * qh);
  };
  const isDroppedAt = (thing, question) => (question.box ? touches(thing.box, question) : isAt(thing, question));

  // The candidates that were dropped at a place, those of the last stage first.
  const droppedNear = (run, frame, question) => {
    const found = frame.found.filter((c) => c.test && isDroppedAt(c, question))
      .map((c) => ({ test: c.test, text: `${c.by}, log-odds ${fixed(c.score, 1)}` }));
    for (const test of frame.dropped) (test.boxes || []).forEach((box, at) => {
      const text = (test.values || {})[at] || "a position that did not become a candidate";
      if (question.box && touches(box, question)) found.push({ test: test.test, text });
    });
    const stage = (item) => (run.tests[item.test] ? run.tests[item.test].stage : 0);
    return found.sort((a, b) => stage(b) - stage(a));
  };

  const grouped = (items) => {
    const groups = new Map();
    for (const item of items) groups.set(item.test, [...(groups.get(item.test) || []), item.text]);
    return [...groups];
  };

  const told = (texts) => {
    const different = [...new Set(texts)];
    return texts.length > 1 ? `${texts.length}: ${different.join("; ")}` : texts[0];
  };

  const aroundCounts = (run, question) => {
    const counts = new Map();
    for (let i = Math.max(0, state.at - AROUND); i <= Math.min(last, state.at + AROUND); i += 1) {
      if (!run.frames[i]) continue;
      for (const test of new Set(droppedNear(run, run.frames[i], question).map((item) => item.test))) counts.set(test, (counts.get(test) || 0) + 1);
    }
    return [...counts].sort((a, b) => b[1] - a[1]);
  };

  // Of an annotated person who is missed the data has the cause; of any other place the page tells what
  // is there.
  const causeOf = (run, frame, question) => {
    const missed = (run.missed || {})[state.at] || {};
    if (question.person !== undefined && missed[question.person] !== undefined) return run.causes[missed[question.person]];
    const hit = ((run.hits || [])[state.at] || {})[question.person];
    if (hit) return `Annotated person ${question.person} is found as track ${hit}.`;
    const here = frame.tracks.filter((track) => isAt(track, question));
    const tracks = here.map((track) => `track ${track.id}, ${stateOf(track)}`).join("; ") || "no track";
    const [last] = droppedNear(run, frame, question);
    const why = last && run.tests[last.test] ? `${run.tests[last.test].why} (${last.text})` : "no recorded candidate was dropped";
    return `At this place: ${tracks}; ${why}.`;
  };

  // Many tests drop thousands of places and record some of them.
  const unplaced = (frame) => {
    const count = (test) => test.n - (test.boxes || []).length - frame.found.filter((c) => c.test === test.test).length;
    const list = frame.dropped.filter((test) => count(test) > 0).map((test) => `${test.test} ${count(test)}`).join(", ");
    return list ? `Anywhere in this frame, at positions that were not recorded: ${list}.` : "";
  };

  const explain = (run, place) => {
    const frame = frameOf(run, state.at);
    if (!state.question || !frame) return place.replaceChildren();
    const isOpen = Boolean(place.querySelector("details[open]"));
    const groups = grouped(droppedNear(run, frame, state.question));
    const row = ([test, texts]) => el("tr", {},
      el("th", { scope: "row" }, test), el("td", {}, told(texts)), settings(run, test));
    const rest = [groups.length
      ? table(`Tests of ${run.name} that dropped candidates here`, ["Dropped by", "What", "Decided by"], groups.map(row))
      : el("p", {}, "No recorded candidate was dropped near this place in this frame.")];
    rest.push(el("p", { class: "soft" }, unplaced(frame)));
    const around = aroundCounts(run, state.question);
    if (around.length) rest.push(el("p", { class: "soft" }, `In the ${2 * AROUND + 1} frames around: ${around.map(([test, n]) => `${test} in ${n}`).join(", ")}.`));
    return place.replaceChildren(el("p", { class: "cause" }, causeOf(run, frame, state.question)),
      el("details", isOpen ? { open: "" } : {}, el("summary", {}, "All tests here"), ...rest));
  };

  const ask = (question) => {
    state.question = question;
    id("question").textContent = question ? question.text : invitation();
    draw();
  };
  const invitation = () => `Click on the ${WIDTH ? "image or the plan" : "plan"} where a person was missed${data.truth ? ", or choose an event \"missed\"" : ""}.`;
  const HALF_PX = 0.04;

  const askAt = (event) => {
    const target = event.currentTarget;
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(target.getScreenCTM().inverse());
    const half = HALF_PX * WIDTH;
    const missed = missedAt(point);
    if (missed) return askPerson(missed);
    pause();
    ask({ box: [point.x - half, point.y - half, 2 * half, 2 * half], text: `At column ${Math.round(point.x)}, row ${Math.round(point.y)}:` });
    return undefined;
  };

  // The same for a place of the plan of a run.
  const askAtPlan = (event, number) => {
    const target = event.currentTarget;
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(target.getScreenCTM().inverse());
    const at = [point.x, -point.y];
    const far = (person) => Math.hypot(person.at[0] - at[0], person.at[1] - at[1]);
    const missed = truthAt(state.at).filter((person) => person.at && far(person) <= NEAR_M
      && data.runs.some((run) => isMissed(run, state.at, person.id))).sort((a, b) => far(a) - far(b));
    if (missed.length) return askPerson(missed[0]);
    pause();
    ask({ at, text: placeText(frameOf(data.runs[number], state.at), at) });
    return undefined;
  };

  const placeText = (frame, at) => {
    if (!frame) return "At this place:";
    const [dx, dy] = [at[0] - frame.robot[0], at[1] - frame.robot[1]];
    const [sin, cos] = [Math.sin(frame.robot[2]), Math.cos(frame.robot[2])];
    const [ahead, left] = [cos * dx + sin * dy, cos * dy - sin * dx];
    return `At ${fixed(Math.abs(ahead), 1)} m ${ahead < 0 ? "behind" : "ahead"}, ${fixed(Math.abs(left), 1)} m to the ${left < 0 ? "right" : "left"} of the robot:`;
  };

  // The missed person at a point of the image: of several the one with the smallest box, which is behind the others.
  const missedAt = (point) => {
    const holds = ([x, y, w, h]) => x <= point.x && point.x < x + w && y <= point.y && point.y < y + h;
    const here = truthAt(state.at).filter((person) => person.box && holds(person.box)
      && data.runs.some((run) => isMissed(run, state.at, person.id)));
    return here.sort((a, b) => a.box[2] * a.box[3] - b.box[2] * b.box[3])[0];
  };

  const atPerson = (person) => `At annotated person ${person}:`;
  const askPerson = (person) => {
    pause();
    ask({ box: person.box, at: person.at, text: atPerson(person.id), person: person.id });
  };

  // Keeps the question on the annotated person while time goes on.
  const followQuestion = () => {
    if (!state.question || state.question.person === undefined) return;
    const person = truthAt(state.at).find((other) => other.id === state.question.person && hasPlace(other));
    if (person) [state.question.box, state.question.at] = [person.box, person.at];
    const text = person ? atPerson(state.question.person)
      : `Annotated person ${state.question.person} is not in this frame; at the last place:`;
    // The same text again would be read out again.
    if (id("question").textContent !== text) id("question").textContent = text;
  };

  const missedButtons = () => {
    const place = id("missed");
    const missed = truthAt(state.at).filter((person) => hasPlace(person) && data.runs.some((run) => isMissed(run, state.at, person.id)));
    place.hidden = !missed.length;
    const button = (person) => {
      const by = data.runs.length > 1 ? ` by ${data.runs.filter((run) => isMissed(run, state.at, person.id)).map((run) => run.name).join(" and ")}` : "";
      const node = el("button", { type: "button" }, `annotated person ${person.id}, missed${by}`);
      node.addEventListener("click", () => askPerson(person));
      return node;
    };
    place.replaceChildren(...missed.map(button));
  };

  // ---- events ----------------------------------------------------------------------------------

  const events = data.runs.flatMap((run, number) => run.events.map((event) => ({ ...event, t: data.t[event.i], run: number })))
    .sort((a, b) => a.i - b.i || a.run - b.run);
  const SIGNS = { started: "●", lost: "○", found: "◐", ended: "■", recognised: "↺", doubt: "?", corrected: "↹", target: "◎", lock: "◆", drives: "▶", slower: "▽", stands: "▮", missed: "✕", switched: "⇄", "wrong person": "≠", "false track": "△", fault: "⚡" };
  const BAD = ["missed", "switched", "wrong person", "false track", "fault"];
  const hiddenKinds = new Set();
  const knownKinds = new Set();

  // The list of events is below: the picture of the frame must be in sight, and the reason beneath it.
  const bringIntoView = () => {
    const stage = document.querySelector(".runs");
    const { top } = stage.getBoundingClientRect();
    if (top < 0 || top > innerHeight / 2) stage.scrollIntoView({ block: "start" });
  };

  const goToEvent = (event) => {
    pause();
    show(event.i);
    bringIntoView();
    const person = truthAt(event.i).find((other) => other.id === event.person && hasPlace(other));
    if (event.kind === "missed" && person) askPerson(person);
  };

  // Each event with its button; an event of frames that are forgotten cannot be jumped to.
  let listed = [];
  const fillEvents = () => {
    listed = events.filter((event) => !hiddenKinds.has(event.kind)).map((event) => {
      const text = data.runs.length > 1 ? `${data.runs[event.run].name}: ${event.text}` : event.text;
      const node = el("button", { type: "button", "data-i": event.i },
        el("span", { class: "when" }, `${fixed(event.t, 2)} s`),
        el("span", { class: BAD.includes(event.kind) ? "kind bad" : "kind" }, `${SIGNS[event.kind] || "·"} ${event.kind}`), el("span", {}, text));
      node.addEventListener("click", () => goToEvent(event));
      return { event, node };
    });
    id("event-list").replaceChildren(...listed.map(({ node }) => el("li", {}, node)));
    markEvents();
  };

  const fillKinds = () => {
    for (const kind of [...new Set(events.map((event) => event.kind))].sort()) {
      if (knownKinds.has(kind)) continue;
      knownKinds.add(kind);
      const box = el("input", { type: "checkbox" });
      box.checked = true;
      box.addEventListener("change", () => {
        if (box.checked) hiddenKinds.delete(kind);
        else hiddenKinds.add(kind);
        fillEvents();
      });
      id("kinds").append(el("label", {}, box, ` ${kind}`));
    }
  };

  const markEvents = () => {
    for (const { event, node } of listed) {
      if (event.i === state.at) node.setAttribute("aria-current", "true");
      else node.removeAttribute("aria-current");
      node.disabled = event.i < 0;
    }
  };

  const step = (direction, wanted) => {
    const kinds = events.filter((event) => event.i >= 0 && (wanted ? event.kind === wanted : !hiddenKinds.has(event.kind))).sort((a, b) => a.i - b.i);
    const ahead = direction > 0 ? kinds.find((event) => event.i > state.at) : kinds.filter((event) => event.i < state.at).pop();
    if (ahead) goToEvent(ahead);
  };

  // ---- time ------------------------------------------------------------------------------------

  const draw = () => {
    if (last < 0) return;
    followQuestion();
    data.runs.forEach((run, number) => {
      drawImage(run, number);
      drawPlan(run, number);
      const frame = frameOf(run, state.at);
      const seen = frame ? frame.tracks.filter((track) => track.state === "seen").length : 0;
      id(`now-${number}`).textContent = !frame ? "no frame"
        : frame.stale ? "frozen image: the places of people are old" : `${seen} seen`;
      people(run, id(`people-${number}`));
      drive(run, id(`drive-${number}`));
      funnel(run, id(`funnel-${number}`));
      explain(run, id(`why-${number}`));
    });
    drawLegends();
    missedButtons();
    moveHeads();
    markEvents();
  };

  const show = (at) => {
    if (last < 0) return;
    state.at = Math.max(0, Math.min(last, at));
    id("frame").value = state.at;
    const frame = frameOf(data.runs[0], state.at);
    const clock = `${fixed(data.t[state.at], 2)} of ${fixed(data.t[last], 2)} s`;
    id("clock").textContent = frame ? `${clock}, frame ${frame.n}` : clock;
    id("frame").setAttribute("aria-valuetext", clock);
    draw();
  };

  const setPlaying = (playing) => {
    state.playing = playing;
    id("play").textContent = playing ? "❚❚" : "▶";
    id("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    id("play").title = playing ? "Pause" : "Play";
  };
  const pause = () => setPlaying(false);

  const play = () => {
    if (data.live) {
      setPlaying(true);
      return show(last);
    }
    if (state.at >= last) show(0);
    setPlaying(true);
    [state.from, state.since] = [data.t[state.at], performance.now()];
    return requestAnimationFrame(tick);
  };

  const tick = (now) => {
    if (!state.playing) return;
    const time = state.from + ((now - state.since) / 1000) * Number(id("speed").value);
    let at = state.at;
    while (at < last && data.t[at + 1] <= time) at += 1;
    if (at !== state.at) show(at);
    if (at >= last) pause();
    else requestAnimationFrame(tick);
  };

  const toggle = (name) => {
    id(name).checked = !id(name).checked;
    draw();
  };

  const KEYS = {
    " ": () => (state.playing ? pause() : play()),
    ArrowLeft: (event) => move(event.shiftKey ? -10 : -1),
    ArrowRight: (event) => move(event.shiftKey ? 10 : 1),
    Home: () => move(-Infinity),
    End: () => move(Infinity),
    p: () => step(-1),
    n: () => step(1),
    m: () => step(1, "missed"),
    d: () => toggle("show-dropped"),
    t: () => toggle("show-trails"),
    Escape: () => ask(null),
  };
  const move = (by) => {
    pause();
    show(state.at + by);
  };

  const onKey = (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const on = event.target.closest("button, select, input, a, summary");
    // A focused control keeps the keys that it has a use for.
    if (on && event.key === " ") return;
    if (on && (on.tagName === "SELECT" || (on.id === "frame" && !event.shiftKey)) && /^(Arrow|Home|End)/.test(event.key)) return;
    const act = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act) return;
    event.preventDefault();
    act(event);
  };

  const jump = (event) => {
    const area = event.currentTarget.getBoundingClientRect();
    pause();
    show(Math.round(((event.clientX - area.left) / area.width) * last));
  };

  const fitImage = (number) => {
    const image = id(`image-${number}`);
    image.setAttribute("viewBox", `0 0 ${WIDTH || 4} ${HEIGHT || 3}`);
    id(`picture-${number}`).hidden = !WIDTH;
    image.closest(".views").classList.toggle("alone", !WIDTH);
    if (!state.question) id("question").textContent = invitation();
  };

  const prepare = () => {
    id("frame").max = last;
    id("frame").addEventListener("input", (event) => {
      pause();
      show(Number(event.target.value));
    });
    id("speed").addEventListener("change", () => state.playing && play());
    id("play").addEventListener("click", () => (state.playing ? pause() : play()));
    for (const [name, act] of [["back", () => move(-1)], ["ahead", () => move(1)], ["before", () => step(-1)], ["next", () => step(1)]]) id(name).addEventListener("click", act);
    for (const name of ["show-dropped", "show-trails", "show-truth"]) id(name).addEventListener("change", draw);
    id("truth-label").hidden = !data.truth;
    id("drive").hidden = !data.live && !data.runs.some((run) => run.frames.some((frame) => frame && frame.drive));
    data.runs.forEach((run, number) => {
      id(`image-${number}`).addEventListener("click", askAt);
      id(`plan-${number}`).addEventListener("click", (event) => askAtPlan(event, number));
      fitImage(number);
      drawStrip(run, number);
      id(`strip-${number}`).addEventListener("click", jump);
    });
    fillKinds();
    fillEvents();
    addEventListener("keydown", onKey);
    addEventListener("resize", () => {
      strips();
      draw();
    });
    addEventListener("hashchange", () => show(openAt()));
    id("legend-missed").hidden = !data.truth;
    id("legend-drive").hidden = id("drive").hidden;
    data.runs.forEach(fitZones);
    drawLegends();
  };
  const strips = () => data.runs.forEach(drawStrip);

  // The time that the address asks for, as #t=12.5, else the first one with the most people.
  const openAt = () => {
    const asked = /^#t=(\d+(\.\d+)?)$/.exec(location.hash);
    if (asked) return Math.max(0, data.t.filter((time) => time <= Number(asked[1]) + 1e-6).length - 1);
    const seen = (run, at) => (run.frames[at] ? run.frames[at].tracks.filter((track) => track.state === "seen").length : 0);
    const counts = data.t.map((_, at) => data.runs.reduce((sum, run) => sum + seen(run, at), 0));
    return Math.max(0, counts.indexOf(Math.max(...counts)));
  };

  prepare();
  if (last >= 0) show(openAt());

  // For live.js, which appends frames as they come.
  const resize = (size) => {
    if (size[0] === WIDTH && size[1] === HEIGHT) return;
    [WIDTH, HEIGHT] = size;
    data.runs.forEach((run, number) => fitImage(number));
  };
  const extended = () => {
    last = data.t.length - 1;
    id("frame").max = last;
    whole = extent();
  };
  const listEvents = () => {
    fillKinds();
    fillEvents();
  };
  if (data.live) globalThis.tagalong = { data, state, events, id, show, play, resize, extended, strips, listEvents, turnFrame, turnScan };
})();
