"use strict";
// Asks for what happens now and appends it to the page. The server answers with the newest frame, so
// a page that is slow gets fewer of them.
(() => {
  const { data, state, events, id, show, play, resize, extended, strips, listEvents, turnFrame, turnScan } = globalThis.tagalong;
  const [run] = data.runs;

  // Frames that can be looked at again, and events that are listed.
  const KEPT = 600;
  const KEPT_EVENTS = 200;
  const STRIPS_EACH_MS = 500;
  const AGAIN_MS = 2000;
  let stripsAt = -Infinity;

  const tell = (text, over) => {
    const place = id("alive");
    if (place.textContent !== text) place.textContent = text;
    place.classList.toggle("over", Boolean(over));
  };

  const forget = () => {
    const old = data.t.length - KEPT;
    if (old <= 0) return;
    for (const list of [data.t, data.images, data.scans, run.frames]) list.splice(0, old);
    state.at = Math.max(0, state.at - old);
    for (const event of events) event.i -= old;
    while (events.length > KEPT_EVENTS) events.shift();
  };

  // The position of the newest frame that is not later than a time; negative for what was before the
  // first frame of this page.
  const positionOf = (time) => {
    let at = data.t.length - 1;
    while (at >= 0 && data.t[at] > time) at -= 1;
    return at;
  };

  const append = (now) => {
    resize(now.image_px);
    turnFrame(now.frame);
    turnScan(now.scan);
    data.t.push(now.t);
    data.images.push(now.image);
    data.scans.push(now.scan);
    run.frames.push(now.frame);
    data.view_rad = now.view_rad;
    Object.assign(run.tests, now.tests);
    forget();
    for (const event of now.events) events.push({ ...event, i: positionOf(event.t), run: 0 });
    extended();
    if (performance.now() - stripsAt > STRIPS_EACH_MS) {
      stripsAt = performance.now();
      strips();
    }
    if (now.events.length) listEvents();
    show(state.playing ? data.t.length - 1 : state.at);
  };

  const pause = (ms) => new Promise((done) => setTimeout(done, ms));

  const once = async (after) => {
    const answer = await fetch(`now?after=${after}`);
    if (!answer.ok) throw new Error(`${answer.status} ${await answer.text()}`);
    const now = await answer.json();
    if (now.frame) {
      append(now);
      tell(state.playing ? "Live: the newest frame is shown." : "Live, paused: Play continues with the newest frame.");
    }
    return now;
  };

  const follow = async () => {
    for (let after = 0; ;) {
      try {
        const now = await once(after);
        if (now.seq) after = now.seq;
        if (now.ended) return tell(`${now.ended} What came before can still be looked at.`, true);
        await new Promise(requestAnimationFrame);
      } catch (error) {
        tell(`No answer (${error.message}): the program has ended, or the network is gone. What came before can still be looked at.`, true);
        await pause(AGAIN_MS);
      }
    }
  };

  [data.images, data.scans] = [[], []];
  id("speed-label").hidden = true;
  play();
  follow();
})();
