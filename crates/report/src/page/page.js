"use strict";
(() => {
  const all = (selector, root = document) => [...root.querySelectorAll(selector)];

  // On a phone each row is a list of its cells with the names of their columns; the roles stay those of
  // a table.
  const nameCells = (table) => {
    const nameOf = (head) => {
      const copy = head.cloneNode(true);
      all(".unseen", copy).forEach((part) => part.remove());
      return copy.textContent.trim();
    };
    const names = all("thead th", table).map(nameOf);
    if (!names.length || table.tHead.rows.length !== 1 || table.querySelector("[colspan], [rowspan]")) return;
    table.classList.add("cards");
    table.setAttribute("role", "table");
    for (const part of [table.tHead, ...table.tBodies]) part.setAttribute("role", "rowgroup");
    for (const row of table.rows) {
      row.setAttribute("role", "row");
      for (const cell of row.cells) {
        const isHead = row.parentElement === table.tHead;
        cell.setAttribute("role", isHead ? "columnheader" : cell.tagName === "TH" ? "rowheader" : "cell");
        if (!isHead) cell.dataset.name = names[cell.cellIndex] || "";
      }
    }
  };
  all(".scroll > table").forEach(nameCells);

  // Of a long table that is not folded the first rows are shown, on a phone fewer, with their first cells.
  const MOST_ROWS = 8;
  for (const table of all(".scroll > table").filter((it) => !it.closest("details"))) {
    const count = table.tBodies[0].rows.length;
    if (count <= MOST_ROWS) continue;
    const more = document.createElement("button");
    more.type = "button";
    more.className = "more";
    const shorten = (isShort) => {
      table.classList.toggle("short", isShort);
      more.textContent = isShort ? `Show the whole table of ${count} rows` : "Show the first rows";
    };
    more.addEventListener("click", () => shorten(!table.classList.contains("short")));
    shorten(true);
    table.parentElement.after(more);
  }

  // Tables sort by a click on a heading: once, the other way, and back again.
  const valueOf = (row, column) => {
    const cell = row.cells[column];
    if (cell.classList.contains("none")) return null;
    if (cell.dataset.value !== undefined) return Number(cell.dataset.value);
    const text = cell.textContent.trim();
    return text === "–" ? null : text;
  };
  const order = (a, b) => {
    if (typeof a === "number" && typeof b === "number") return a - b;
    return String(a).localeCompare(String(b), "en", { numeric: true });
  };
  const sort = (table, column, direction, original) => {
    const rows = [...original];
    if (direction !== "none") {
      const sign = direction === "ascending" ? 1 : -1;
      rows.sort((x, y) => {
        const [a, b] = [valueOf(x, column), valueOf(y, column)];
        if (a === null || b === null) return (a === null) - (b === null);
        return sign * order(a, b);
      });
    }
    table.tBodies[0].append(...rows);
  };
  const next = { none: "ascending", ascending: "descending", descending: "none" };
  const headings = [];
  for (const table of all("table.sortable")) {
    const original = [...table.tBodies[0].rows];
    if (original.length < 2) continue;
    const heads = all("thead th:not(.picture)", table);
    for (const head of heads) {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      headings.push([head, button]);
      button.addEventListener("click", () => {
        const direction = next[head.getAttribute("aria-sort") || "none"];
        for (const other of heads) other.removeAttribute("aria-sort");
        if (direction !== "none") head.setAttribute("aria-sort", direction);
        sort(table, head.cellIndex, direction, original);
      });
    }
  }

  // Kinds of events can be switched off.
  const filters = document.querySelector(".filters");
  const kinds = [...new Set(all("#events tr[data-kind]").map((row) => row.dataset.kind))].sort();
  if (filters && kinds.length > 1) {
    filters.setAttribute("role", "group");
    filters.setAttribute("aria-label", "Show kinds of events");
    for (const kind of kinds) {
      const label = document.createElement("label");
      const box = document.createElement("input");
      box.type = "checkbox";
      box.checked = true;
      box.addEventListener("change", () => {
        for (const row of all("tr[data-kind]")) {
          if (row.dataset.kind === kind) row.hidden = !box.checked;
        }
      });
      label.append(box, " " + (kind === "switch" ? "ID switch" : kind.replace("-", " ")));
      filters.append(label);
    }
    filters.hidden = false;
  }

  // Pointing at a pipeline anywhere shows it everywhere.
  const series = all("[data-series]");
  const show = (index) => {
    for (const element of all("svg [data-series]")) {
      element.classList.toggle("faded", index !== null && element.dataset.series !== index);
    }
  };
  for (const element of series) {
    element.addEventListener("pointerenter", () => show(element.dataset.series));
    element.addEventListener("pointerleave", () => show(null));
  }

  // On paper nothing can be opened, and headings that repeat on the next page
  // lose what stands in buttons.
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = all("details.print:not([open])");
    for (const details of opened) details.open = true;
    for (const [head, button] of headings) head.replaceChildren(...button.childNodes);
  });
  addEventListener("afterprint", () => {
    for (const details of opened) details.open = false;
    for (const [head, button] of headings) {
      button.append(...head.childNodes);
      head.append(button);
    }
  });

  // A link to something folded away opens it.
  const reveal = () => {
    const target = location.hash.length > 1 && document.getElementById(location.hash.slice(1));
    for (let at = target; at; at = at.parentElement) if (at.tagName === "DETAILS") at.open = true;
  };
  addEventListener("hashchange", reveal);
  reveal();
})();
